"""`robochoc sniff`: a page that shows and explains the messages in a run on this machine or on a remote master."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from robochoc.cli.options.network import (
    identity_option,
    masters_option,
    network_errors_as_failures,
    patience_option,
    token_options,
)
from robochoc.cli.options.paths import InputPath, OutputFile
from robochoc.cli.options.saved import JOURNAL_STEP
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure, invalid_input_fails
from robochoc.system.lazy_dataclass import dataclass

if TYPE_CHECKING:
    from robochoc.authority.identity import Identity
    from robochoc.run.networked.address import Address
    from robochoc.sniffer.remote import FollowResult
    from robochoc.sniffer.session import SnifferSession
    from robochoc.sniffer.viewer import Viewer


_SECTIONS: Sections = {
    COMMON: ("--robots", "--team", "--port", "--open", "--help"),
    "A run elsewhere": (
        "--master", "--as", "--token-file", "--token", "--identity", "--patience", "--journal", "--no-page",
    ),
}  # fmt: skip


Command = TypeVar("Command", bound=Callable[..., object])
NAME = "Sniffer"
"""The default name of a sniffer."""
_MASTER_ONLY = {"as": "name", "identity": "identity", "journal": "copy", "no-page": "no_page"}
"""The options that require --master, and their arguments."""
_OPTIONS = (
    masters_option(
        "--master",
        "places",
        "Address of a master that runs with --sniffable; several, if there are standby masters.",
        required=False,
    ),
    click.option(
        "--as",
        "name",
        metavar="NAME",
        help=f"Your name, enrolled with --may sniff.  [default: {NAME}]",
    ),
    token_options(),
    identity_option,
    patience_option("Time without contact after which the master counts as lost.", 10.0),
    click.option("--journal", "copy", type=OutputFile(), metavar="FILE", help="Save the journal of the run in FILE."),
    click.option("--no-page", is_flag=True, help="With --journal: show no page, and exit at the end of the run."),
)


def master_options(command: Command) -> Command:
    """Add the options with which `robochoc sniff` follows a master."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("journal", type=InputPath(), metavar="[JOURNAL]", required=False)
@master_options
@click.option("--port", type=WholeNumber(0, 65535), default=0, metavar="N", help="Port of the page; 0 is a free port.")
@click.option("--open", "open_browser", is_flag=True, help="Open the page in a browser.")
@click.option(
    "--robots",
    "chosen",
    default="",
    metavar="PATTERNS",
    help="Robots shown first, such as Robot3.1,Robot2.*.  [default: all]",
)
@click.option(
    "--team",
    "folder",
    type=InputPath(),
    metavar="DIR",
    help="The team's folder, for the 3D scene.  [default: the team in the journal]",
)
@click.pass_context
@invalid_input_fails
def sniff(
    context: click.Context,
    /,
    journal: Path | None,
    port: int,
    chosen: str,
    folder: Path | None,
    *,
    open_browser: bool,
    **asked: Any,  # noqa: ANN401 - the values of `master_options`
) -> None:
    """Show all messages of a run, with their reasons, on a page of this machine until Ctrl-C.

    JOURNAL is a file of 'robochoc solve --journal'; the page is updated while the run continues. With --master, the
    page shows the run of a master on another machine (documentation, page Several machines).

    \b
    robochoc sniff out/run.journal --robots 'Robot2.*' --open
    """  # noqa: D301 - \\b keeps click from wrapping the lines
    if _follows_master(journal, folder, asked) or journal is None:
        from robochoc.sniffer.patterns import patterns_in

        context.exit(_sniff_master(_PageOptions(tuple(patterns_in(chosen)), port, open_browser), **asked))
    from robochoc.sniffer.server import serve_sniffer

    session = _session(journal, chosen, folder)
    try:
        serve_sniffer(
            session,
            port=port,
            open_browser=open_browser,
            ready=lambda url: click.echo(f"{url} shows {journal} on this machine; Ctrl-C ends it", err=True),
        )
    except OSError as error:
        raise Failure(USAGE, f"port {port}: {error.strerror} (use another --port, or omit it)") from error


def _session(journal: Path, chosen: str, folder: Path | None) -> SnifferSession:
    """Return a session on the journal. The first piece is read now, so that an invalid file is reported at once."""
    from robochoc.formats import on_one_line, read_team
    from robochoc.journal.journal import JournalError
    from robochoc.sniffer.patterns import patterns_in
    from robochoc.sniffer.session import SnifferSession
    from robochoc.sniffer.trace import TraceTooLargeError

    robots = {robot.name: robot for robot in read_team(folder).robots} if folder else {}
    with ExitStack() as on_error:
        try:
            session = SnifferSession(journal, chosen=patterns_in(chosen), robots=robots)
            on_error.callback(session.close)
            session.read_header()
        except (JournalError, TraceTooLargeError) as error:
            raise Failure(INVALID, on_one_line(f"{journal}: {error} ({JOURNAL_STEP})")) from error
        except OSError as error:
            raise Failure(INVALID, on_one_line(f"{journal}: {error.strerror or error} ({JOURNAL_STEP})")) from error
        on_error.pop_all()
    return session


def _follows_master(journal: Path | None, folder: Path | None, asked: Mapping[str, Any]) -> bool:
    """Return whether to follow a master instead of reading a `journal`. `asked`: the values of `master_options`.

    Raises `UsageError` if both or neither are given, or if an option cannot be combined with them.
    """
    if not asked["places"]:
        if journal is None:
            raise click.UsageError("give a JOURNAL, or --master HOST:PORT to follow a run")
        useless = [f"--{option}" for option, name in _MASTER_ONLY.items() if asked[name]]
        if useless:
            raise click.UsageError(f"{useless[0]} requires --master")
    elif journal is not None:
        raise click.UsageError("a JOURNAL cannot be used with --master; remove one (--journal FILE saves a run)")
    elif folder is not None:
        raise click.UsageError("--team requires a JOURNAL: a master does not send the robots' files")
    elif asked["no_page"] and asked["copy"] is None:
        raise click.UsageError("--no-page requires --journal FILE: otherwise there is no output")
    return bool(asked["places"])


@dataclass(frozen=True)
class _PageOptions:
    """The page for a run: patterns of the robots shown first, the port, and whether to open a browser."""

    chosen: tuple[str, ...]
    port: int
    open_browser: bool


def _sniff_master(
    page: _PageOptions,
    *,
    places: tuple[Address, ...],
    copy: Path | None,
    patience_s: float,
    no_page: bool,
    **given: Any,  # noqa: ANN401 - the sniffer's identity
) -> int:
    """Follow the run of the leading master to its end, keep the page until Ctrl-C, and return the exit status."""
    from robochoc.formats import on_one_line

    with network_errors_as_failures(places[0]), ExitStack() as stack:
        from robochoc.run.networked.leader_search import at_leader

        identity = _identity(places[0], patience_s, **given)
        target = _JournalTarget(None if no_page else page, copy, stack)
        ending = at_leader(places, patience_s, lambda place: _receive(place, identity, patience_s, target))
        click.echo(on_one_line(f"{ending.why}; {target.summary}"), err=True)
        target.wait()
    return 0 if ending.over else LOST


def _identity(
    place: Address, patience_s: float, *, name: str | None, token: str | None, identity: Path | None
) -> Identity:
    """Return the sniffer's identity. By default, `name` is the name in the identity."""
    from robochoc.authority.identity import Identity
    from robochoc.run.networked.join import identity_of

    name = name or (Identity.load(identity).name if identity and not token else NAME)
    return identity_of(name, place, identity, token, patience_s)


def _receive(place: Address, identity: Identity, patience_s: float, target: _JournalTarget) -> FollowResult:
    from robochoc.sniffer.remote import receive

    try:
        return receive(place, identity, target.write, patience_s=patience_s, granted=partial(target.start, place))
    except _JournalWriteError as error:
        raise Failure(INVALID, f"{error} (free some space, or name another file)") from error


class _JournalWriteError(Exception):
    """The received journal cannot be written."""


class _JournalTarget:
    """The targets for a received journal: an unnamed file that the page's process reads, and the user's file."""

    def __init__(self, page: _PageOptions | None, copy: Path | None, stack: ExitStack) -> None:
        self._page = page
        self._copy = copy
        self._stack = stack
        self._sinks: list[Callable[[bytes], object]] = []
        self._viewer: Viewer | None = None
        self._size = 0

    def start(self, place: Address) -> None:
        """Open the targets after the master at `place` has granted access."""
        from robochoc.formats import on_one_line
        from robochoc.journal.journal import JournalFile

        if self._copy:
            file = JournalFile(self._copy)
            self._stack.callback(file.close)
            self._sinks.append(file.write)
        if self._page is None:
            click.echo(on_one_line(f"following the run at {place} into {self._copy}"), err=True)
            return
        from robochoc.sniffer.viewer import Viewer
        from robochoc.system.temporary_files import unnamed_file

        journal = self._stack.enter_context(unnamed_file())

        def write(blocks: bytes) -> None:
            journal.write(blocks)
            journal.flush()

        self._sinks.append(write)
        try:
            page = self._page
            viewer = Viewer(journal.fileno(), page.chosen, page.port, open_browser=page.open_browser)
        except OSError as error:
            why = f"port {self._page.port}: {error.strerror} (use another --port, or omit it)"
            raise Failure(USAGE, why) from error
        self._viewer = self._stack.enter_context(viewer)
        click.echo(f"{viewer.url} shows the run at {place} on this machine; Ctrl-C ends it", err=True)

    def write(self, blocks: bytes) -> None:
        """Write complete blocks to all targets. Raises `_JournalWriteError`."""
        try:
            for sink in self._sinks:
                sink(blocks)
        except OSError as error:
            what = f"{self._copy}: " if self._copy else ""
            raise _JournalWriteError(f"{what}the journal of the run cannot be written: {error.strerror}") from error
        self._size += len(blocks)

    @property
    def summary(self) -> str:
        """A text about the size of the received journal."""
        received = f"{self._size:,} bytes of its journal received"
        return f"{received}, in {self._copy}" if self._copy else received

    def wait(self) -> None:
        """Keep the page open until Ctrl-C, or until its process ends."""
        if self._viewer is None:
            return
        with suppress(KeyboardInterrupt):  # Ctrl-C may come at any time from here
            click.echo(f"{self._viewer.url} stays until Ctrl-C", err=True)
            self._viewer.wait()
