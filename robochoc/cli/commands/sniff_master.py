"""`robochoc sniff --master`: follow a run of a master elsewhere, on a page of this machine, or into a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from robochoc.cli.options.network import PlaceType, identity_option, network_failures_told, patience_option
from robochoc.cli.options.paths import OutputFile
from robochoc.cli.options.tokens import token_options
from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure

if TYPE_CHECKING:
    from robochoc.authority.identity import Identity
    from robochoc.run.networked.address import Address
    from robochoc.sniffer.remote import Followed
    from robochoc.sniffer.viewer import Viewer

Command = TypeVar("Command", bound=Callable[..., object])
NAME = "Sniffer"
"""The default name of a sniffer."""
_ONLY_THERE = {"as": "name", "identity": "identity", "journal": "copy", "no-page": "no_page"}
_OPTIONS = (
    click.option(
        "--master",
        "place",
        type=PlaceType(),
        metavar="HOST:PORT",
        help="Address of the master, which runs with --sniffable.",
    ),
    click.option(
        "--as",
        "name",
        metavar="NAME",
        help=f"Your name, enrolled with --may sniff.  [default: {NAME}]",
    ),
    token_options(),
    identity_option,
    patience_option("Time without contact after which the master is given up.", 10.0),
    click.option("--journal", "copy", type=OutputFile(), metavar="FILE", help="Keep the journal of the run in FILE."),
    click.option("--no-page", is_flag=True, help="With --journal: show no page, and end with the run."),
)


def master_options(command: Command) -> Command:
    """Add the options with which `robochoc sniff` follows a master."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def asks_master(journal: Path | None, folder: Path | None, asked: Mapping[str, Any]) -> bool:
    """Return whether to follow a master, and not to read a `journal`. `asked` holds the values of `master_options`.

    Raises `UsageError` where both are asked for, neither is, or something that does not go with it.
    """
    if asked["place"] is None:
        if journal is None:
            raise click.UsageError("give a JOURNAL, or --master HOST:PORT to follow a run")
        useless = [f"--{option}" for option, name in _ONLY_THERE.items() if asked[name]]
        if useless:
            raise click.UsageError(f"{useless[0]} goes with --master")
    elif journal is not None:
        raise click.UsageError("a JOURNAL and --master exclude each other; drop one (--journal FILE saves a run)")
    elif folder is not None:
        raise click.UsageError("--team goes with a JOURNAL: a sniffer never sees the robots' files")
    elif asked["no_page"] and asked["copy"] is None:
        raise click.UsageError("--no-page goes with --journal FILE: otherwise there is no output")
    return asked["place"] is not None


@dataclass(frozen=True)
class Page:
    """The page of the run: the robots to begin with (names and patterns), its port, and whether to open a browser."""

    chosen: tuple[str, ...]
    port: int
    open_browser: bool


def sniff_master(
    page: Page,
    *,
    place: Address,
    copy: Path | None,
    patience_s: float,
    no_page: bool,
    **given: Any,  # noqa: ANN401 - who sniffs
) -> int:
    """Follow the run of the master at `place` until it ends, then keep the page until Ctrl-C; the exit status."""
    from robochoc.formats import on_one_line

    with network_failures_told(place), ExitStack() as stack:
        proof = _proof(place, patience_s, **given)
        showing = _Showing(place, None if no_page else page, copy, stack)
        ending = _received(place, proof, patience_s, showing)
        click.echo(on_one_line(f"{ending.why}; {showing.kept}"), err=True)
        showing.stay()
    return 0 if ending.over else LOST


def _proof(
    place: Address, patience_s: float, *, name: str | None, token: str | None, identity: Path | None
) -> Identity:
    """Return the sniffer's identity. The default of `name` is the identity's name."""
    from robochoc.authority.identity import Identity
    from robochoc.run.networked.join import identity_of

    who = name or (Identity.load(identity).name if identity and not token else NAME)
    return identity_of(who, place, identity, token, patience_s)


def _received(place: Address, proof: Identity, patience_s: float, showing: _Showing) -> Followed:
    from robochoc.sniffer.remote import receive

    try:
        return receive(place, proof, showing.write, patience_s=patience_s, granted=showing.begin)
    except _NotKeptError as error:
        raise Failure(INVALID, f"{error} (free some space, or name another file)") from error


class _NotKeptError(Exception):
    """The received journal cannot be written."""


class _Showing:
    """The targets of the journal: an unnamed file, which the page's process reads, and the user's file."""

    def __init__(self, place: Address, page: Page | None, copy: Path | None, stack: ExitStack) -> None:
        self._place = place
        self._page = page
        self._copy = copy
        self._stack = stack
        self._sinks: list[Callable[[bytes], object]] = []
        self._viewer: Viewer | None = None
        self._size = 0

    def begin(self) -> None:
        """The master has agreed: show what will come."""
        from robochoc.formats import on_one_line
        from robochoc.journal.journal import JournalFile

        if self._copy:
            file = JournalFile(self._copy)
            self._stack.callback(file.close)
            self._sinks.append(file.write)
        if self._page is None:
            click.echo(on_one_line(f"following the run at {self._place} into {self._copy}"), err=True)
            return
        from robochoc.sniffer.viewer import Viewer
        from robochoc.system.temporary_files import unnamed_file

        journal = self._stack.enter_context(unnamed_file())

        def write(blocks: bytes) -> None:
            journal.write(blocks)
            journal.flush()

        self._sinks.append(write)
        try:
            asked = self._page
            viewer = Viewer(journal.fileno(), asked.chosen, asked.port, open_browser=asked.open_browser)
        except OSError as error:
            why = f"port {self._page.port}: {error.strerror} (choose another, or none)"
            raise Failure(USAGE, why) from error
        self._viewer = self._stack.enter_context(viewer)
        click.echo(f"{viewer.url} shows the run at {self._place} on this machine; Ctrl-C ends it", err=True)

    def write(self, blocks: bytes) -> None:
        """Take in whole blocks. Raises `_NotKeptError`."""
        try:
            for sink in self._sinks:
                sink(blocks)
        except OSError as error:
            what = f"{self._copy}: " if self._copy else ""
            raise _NotKeptError(f"{what}the journal of the run cannot be written: {error.strerror}") from error
        self._size += len(blocks)

    @property
    def kept(self) -> str:
        """Return a text on how much of the journal was received."""
        where = f"{self._size:,} bytes of its journal are here"
        return f"{where}, in {self._copy}" if self._copy else where

    def stay(self) -> None:
        """Keep the page until Ctrl-C, or until its process has ended."""
        if self._viewer is None:
            return
        with suppress(KeyboardInterrupt):  # which may come as soon as it is asked for
            click.echo(f"{self._viewer.url} stays until Ctrl-C", err=True)
            self._viewer.wait()
