"""`robochoc solve --sniff`: a viewer's process beside a run, on the journal that the run writes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from typing import IO, TYPE_CHECKING, Self

import click

if TYPE_CHECKING:
    from robochoc.model.problem import Team
    from robochoc.sniffer.viewer import Viewer

_BROWSER_S = 8.0
"""The longest wait of a run for the page that --open requested, in seconds."""


@dataclass(frozen=True)
class Watching:
    """The values of --sniff: the robots to begin with (names and patterns), and whether to open a browser."""

    chosen: tuple[str, ...]
    open_browser: bool


def watching(chosen: str | None, *, open_browser: bool) -> Watching | None:
    """Return what --sniff and --open ask for. Raises `click.UsageError` for --open alone."""
    if chosen is None:
        if open_browser:
            raise click.UsageError("--open is for the page of --sniff")
        return None
    from robochoc.sniffer.patterns import patterns_in

    return Watching(patterns_in(chosen), open_browser)


def check_chosen(watching: Watching | None, team: Team) -> None:
    """Raise `click.UsageError` where a pattern of --sniff fits no robot of `team`, nor any that is to come."""
    if watching is None or not watching.chosen:
        return
    from robochoc.flight.mission import all_robots
    from robochoc.formats.diagnostics import on_one_line, suggestion
    from robochoc.sniffer.patterns import unmatched

    names = [robot.name for robot in all_robots(team)]
    for pattern in unmatched(names, watching.chosen):
        hint = suggestion(pattern, names, "robots")
        raise click.UsageError(on_one_line(f"--sniff: no robot of {team.name} is called {pattern!r} ({hint})"))


class Watch:
    """The viewer of one run, if there is to be one; it is over when the `with` is."""

    def __init__(self, watching: Watching | None) -> None:
        self._watching = watching
        self._viewer: Viewer | None = None
        self._file: IO[bytes] | None = None
        self._stack = ExitStack()
        self._cut = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def begun(self) -> list[Callable[[bytes], object]]:
        """Start the viewer and return the functions that write the journal's blocks for it. Without a viewer: none.

        The blocks go to an unnamed file, which disappears with the program. The viewer's URL is printed, and a browser
        is opened if requested.
        """
        if self._watching is None:
            return []
        from robochoc.sniffer.viewer import Viewer
        from robochoc.system.temporary_files import unnamed_file

        file = unnamed_file(buffered=False)
        self._file = self._stack.enter_context(file)
        opens = self._watching.open_browser
        viewer = self._stack.enter_context(Viewer(file.fileno(), self._watching.chosen, open_browser=opens))
        self._viewer = viewer
        click.echo(f"{viewer.url} shows the run on this machine", err=True)
        if opens and not viewer.wait_until_seen(_BROWSER_S):
            click.echo("no browser has shown the page yet; the run begins", err=True)
        return [self._write]

    def stay(self) -> None:
        """Keep the page until Ctrl-C, unless it is gone."""
        viewer = self._viewer
        if viewer is None:
            return
        if self._cut:
            click.echo(f"the page lacks the end of the run: {self._cut}", err=True)
        if viewer.is_gone:
            click.echo("the page is gone: its process ended during the run, which went on without it", err=True)
            return
        with suppress(KeyboardInterrupt):  # which may come as soon as it is asked for
            viewer.finish()
            click.echo(f"{viewer.url} stays until Ctrl-C", err=True)
            viewer.wait()
            click.echo("the page is gone: its process has ended", err=True)

    def _write(self, block: bytes) -> None:
        """Write a block. If that fails, only the page lacks it: the run goes on."""
        if self._file is None or self._cut:
            return
        try:
            done = 0
            while done < len(block):
                done += self._file.write(memoryview(block)[done:])
        except OSError as error:
            self._cut = error.strerror or str(error)
