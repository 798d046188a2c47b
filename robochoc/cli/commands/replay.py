"""`robochoc replay`: compare a recorded run with the installed protocol."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.saved import journal_team_option, saved_journal
from robochoc.cli.options.solve import protocol_settings
from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.journal.journal import Journal
    from robochoc.replay import ReplayOptions, ReplayResult


@click.command()
@click.argument("journal", type=InputPath(), metavar="JOURNAL")
@journal_team_option
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="A protocol parameter of the recorded run, for a journal that does not include the robots' local problems. May"
    " be given more than once.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@local_options
@invalid_input_fails
def replay(
    journal: Path,
    folder: Path | None,
    settings: tuple[str, ...],
    local_solutions: int,
    local_timeout: float,
    *,
    as_json: bool,
    always_ace: bool,
    no_cache: bool,
) -> int:
    """Replay the messages in JOURNAL through the protocol, and compare all results with the recorded ones.

    The exit status is 0 if they are the same, and 4 if not: then the protocol or the journal has changed. The first
    difference is printed, and each claim of the header or the outcome that the steps contradict. An incomplete journal
    is replayed to its end. An altered journal is replayed up to the alteration and is invalid (status 1). A journal
    without steps is invalid, too, unless a robot without a local solution decided the run before it began.
    """
    from robochoc.formats import read_team
    from robochoc.replay import ReplayOptions
    from robochoc.solver.cache import SolutionCache

    recorded = saved_journal(journal)
    options = ReplayOptions(
        team=read_team(folder) if folder else None,
        settings=protocol_settings(settings),
        limits=limits(local_solutions, local_timeout, always_ace=always_ace),
        cache=None if no_cache else SolutionCache(),
    )
    with errors_as_failures(journal):
        replayed = _replayed(journal, recorded, options)
    if as_json:
        from robochoc.cli.reports.replay import replay_json

        click.echo(replay_json(recorded, replayed))
    else:
        from robochoc.cli.reports.replay import replay_report

        click.echo(replay_report(recorded, replayed))
    if replayed.differs:
        return LOST
    return 0 if (replayed.identical or replayed.decided_before) and not _altered(recorded) else INVALID


def _altered(journal: Journal) -> bool:
    """Return whether part of the journal was altered."""
    return journal.damage is not None and not journal.truncated


def _replayed(path: Path, journal: Journal, options: ReplayOptions) -> ReplayResult:
    from robochoc.cli.reports.progress import progress_line
    from robochoc.formats import on_one_line
    from robochoc.replay import CannotReplayError
    from robochoc.replay import replay as play

    try:
        with progress_line(on_one_line(journal.header.team)) as progress:
            return play(journal, options, progress=progress)
    except CannotReplayError as why:
        status = INVALID if why.broken or _altered(journal) else USAGE
        damage = f"the journal was altered: {journal.damage}; " if _altered(journal) else ""
        raise Failure(status, on_one_line(f"{path}: {damage}the run cannot be replayed: {why}")) from why
