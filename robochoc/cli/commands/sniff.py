"""`robochoc sniff`: a page that shows and explains the messages of a run."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.commands.sniff_master import Page, asks_master, master_options, sniff_master
from robochoc.cli.options.numbers import WholeNumber
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.saved import JOURNAL_STEP
from robochoc.cli.options.sections import COMMON, SectionedCommand, Sections
from robochoc.cli.reports.failures import INVALID, USAGE, Failure, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.sniffer.session import SnifferSession


_SECTIONS: Sections = {
    COMMON: ("--robots", "--team", "--port", "--open", "--help"),
    "A run elsewhere": (
        "--master", "--as", "--token-file", "--token", "--identity", "--patience", "--journal", "--no-page",
    ),
}  # fmt: skip


@click.command(cls=SectionedCommand, sections=_SECTIONS)
@click.argument("journal", type=InputPath(), metavar="[JOURNAL]", required=False)
@master_options
@click.option("--port", type=WholeNumber(0, 65535), default=0, metavar="N", help="Port of the page; 0: any free one.")
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
    help="The team's folder, for the 3D scene.  [default: the journal's own data]",
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
    **asked: Any,  # noqa: ANN401 - who follows a master, and how
) -> None:
    """Show all messages of a run on a page of this machine, with their reasons, until Ctrl-C.

    JOURNAL is a file of 'robochoc solve --journal'; while the run goes on, the page follows it. With --master, the run
    of a master on another machine is followed (docs/guides/several-machines.md).

    \b
    robochoc sniff out/run.journal --robots 'Robot2.*' --open
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    elsewhere = asks_master(journal, folder, asked)
    if elsewhere or journal is None:
        from robochoc.sniffer.patterns import patterns_in

        context.exit(sniff_master(Page(tuple(patterns_in(chosen)), port, open_browser), **asked))
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
        raise Failure(USAGE, f"port {port}: {error.strerror} (choose another, or none)") from error


def _session(journal: Path, chosen: str, folder: Path | None) -> SnifferSession:
    """Return a session on the opened journal. Its first piece is read, so that an invalid file fails at once."""
    from robochoc.formats import on_one_line, read_team
    from robochoc.journal.journal import JournalError
    from robochoc.sniffer.patterns import patterns_in
    from robochoc.sniffer.session import SnifferSession
    from robochoc.sniffer.trace import TraceTooLargeError

    robots = {robot.name: robot for robot in read_team(folder).robots} if folder else {}
    with ExitStack() as unless_it_can_be_shown:
        try:
            session = SnifferSession(journal, chosen=patterns_in(chosen), robots=robots)
            unless_it_can_be_shown.callback(session.close)
            session.begin()
        except (JournalError, TraceTooLargeError) as wrong:
            raise Failure(INVALID, on_one_line(f"{journal}: {wrong} ({JOURNAL_STEP})")) from wrong
        except OSError as error:
            raise Failure(INVALID, on_one_line(f"{journal}: {error.strerror or error} ({JOURNAL_STEP})")) from error
        unless_it_can_be_shown.pop_all()
    return session
