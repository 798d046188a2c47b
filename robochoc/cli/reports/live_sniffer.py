"""The option `robochoc solve --sniff`: a page in a separate process shows a run live, from the run's journal."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import IO, TYPE_CHECKING, Self

import click

from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.posix import IS_POSIX, REQUIREMENT

if TYPE_CHECKING:
    from robochoc.model.problem import Team
    from robochoc.sniffer.viewer import Viewer

_BROWSER_S = 8.0
"""The maximum time in seconds that a run waits for the browser opened by --open."""


@dataclass(frozen=True)
class SnifferRequest:
    """The values of --sniff and --open: patterns of the robots shown first, and whether to open a browser."""

    chosen: tuple[str, ...]
    open_browser: bool


def sniffer_request(chosen: str | None, *, open_browser: bool) -> SnifferRequest | None:
    """Return the values of --sniff and --open. Raises `click.UsageError` for --open without --sniff, and on Windows."""
    if chosen is None:
        if open_browser:
            raise click.UsageError("--open requires --sniff")
        return None
    if not IS_POSIX:
        raise click.UsageError(
            f"--sniff {REQUIREMENT}; --journal FILE saves the messages, and 'robochoc replay' reads them"
        )
    from robochoc.sniffer.patterns import patterns_in

    return SnifferRequest(patterns_in(chosen), open_browser)


def check_patterns(request: SnifferRequest | None, team: Team) -> None:
    """Raise `click.UsageError` if a pattern of --sniff matches no robot in `team` or in its scenario."""
    if request is None or not request.chosen:
        return
    from robochoc.flight.mission import all_robots
    from robochoc.formats.diagnostics import on_one_line, suggestion
    from robochoc.sniffer.patterns import unmatched

    names = [robot.name for robot in all_robots(team)]
    for pattern in unmatched(names, request.chosen):
        hint = suggestion(pattern, names, "robots")
        raise click.UsageError(on_one_line(f"--sniff: {team.name} has no robot called {pattern!r} ({hint})"))


class LiveSniffer:
    """A context manager with the viewer for one run, if requested. On exit, the viewer is ended."""

    def __init__(self, request: SnifferRequest | None) -> None:
        self._request = request
        self._viewer: Viewer | None = None
        self._file: IO[bytes] | None = None
        self._stack = ExitStack()
        self._write_error = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def start(self) -> list[Callable[[bytes], object]]:
        """Start the viewer, and return the functions that write the journal's blocks for it; empty without a viewer.

        The blocks are written to an unnamed file, which disappears when the program ends. The viewer's URL is printed,
        and a browser is opened if requested.
        """
        if self._request is None:
            return []
        from robochoc.sniffer.viewer import Viewer
        from robochoc.system.temporary_files import unnamed_file

        file = unnamed_file(buffered=False)
        self._file = self._stack.enter_context(file)
        opens = self._request.open_browser
        viewer = self._stack.enter_context(Viewer(file.fileno(), self._request.chosen, open_browser=opens))
        self._viewer = viewer
        click.echo(f"{viewer.url} shows the run on this machine", err=True)
        if opens and not viewer.wait_until_seen(_BROWSER_S):
            click.echo("no browser has shown the page yet; the run starts without it", err=True)
        return [self._write]

    def wait(self) -> None:
        """Keep the page open until Ctrl-C, or until the viewer ends."""
        viewer = self._viewer
        if viewer is None:
            return
        if self._write_error:
            click.echo(f"the page lacks the end of the run: {self._write_error}", err=True)
        if viewer.is_gone:
            click.echo("the page is gone: its process ended during the run, which continued without it", err=True)
            return
        with suppress(KeyboardInterrupt):  # Ctrl-C may come at any time from here
            viewer.finish()
            click.echo(f"{viewer.url} stays until Ctrl-C", err=True)
            viewer.wait()
            click.echo("the page is gone: its process has ended", err=True)

    def _write(self, block: bytes) -> None:
        """Write a block. After an error, the page lacks the following blocks, but the run continues."""
        if self._file is None or self._write_error:
            return
        try:
            done = 0
            while done < len(block):
                done += self._file.write(memoryview(block)[done:])
        except OSError as error:
            self._write_error = error.strerror or str(error)
