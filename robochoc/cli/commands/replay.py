"""`robochoc replay`: whether a recorded run would go the same way again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.saved import saved_journal
from robochoc.cli.options.solve import protocol_settings
from robochoc.cli.reports.failures import INVALID, LOST, USAGE, Failure, failures_told, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.journal.journal import Journal
    from robochoc.replay import Means, Replayed


@click.command()
@click.argument("journal", type=InputPath(), metavar="JOURNAL")
@click.option(
    "--team",
    "folder",
    type=InputPath(),
    metavar="DIR",
    help="The team's folder, for a journal that does not say what robots were given: one from across machines.",
)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="NAME=VALUE",
    help="What was set of the protocol, for a journal that does not say what robots were given.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as one JSON object.")
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
    """Drive the same protocol objects through the packets in JOURNAL, and compare all that they say and do.

    The exit status is 0 if that is the same as was recorded, and 4 if not: then the protocol is another one than it
    was, or the journal is. The first difference is shown. So is what its header and its outcome claim, where that does
    not follow from its steps. A journal that ends early is played as far as it goes. One that was altered is played up
    to there, and is invalid (1), as is one that holds nothing to be compared.
    """
    from robochoc.formats import read_team
    from robochoc.replay import Means
    from robochoc.solver.cache import SolutionCache

    recorded = saved_journal(journal)
    means = Means(
        team=read_team(folder) if folder else None,
        settings=protocol_settings(settings),
        limits=limits(local_solutions, local_timeout, always_ace=always_ace),
        cache=None if no_cache else SolutionCache(),
    )
    with failures_told(journal):
        replayed = _replayed(journal, recorded, means)
    if as_json:
        from robochoc.cli.reports.replay import result_json

        click.echo(result_json(recorded, replayed))
    else:
        from robochoc.cli.reports.replay import report

        click.echo(report(recorded, replayed))
    if replayed.differs:
        return LOST
    return 0 if replayed.identical and not _altered(recorded) else INVALID


def _altered(journal: Journal) -> bool:
    """Return whether a part of the journal was altered."""
    return journal.damage is not None and not journal.truncated


def _replayed(path: Path, journal: Journal, means: Means) -> Replayed:
    from robochoc.cli.reports.progress import progress_line
    from robochoc.formats import on_one_line
    from robochoc.replay import CannotReplayError
    from robochoc.replay import replay as play

    try:
        with progress_line(on_one_line(journal.header.team)) as progress:
            return play(journal, means, progress=progress)
    except CannotReplayError as why:
        status = INVALID if why.broken or _altered(journal) else USAGE
        damage = f"it was altered: {journal.damage}; " if _altered(journal) else ""
        raise Failure(status, on_one_line(f"{path}: {damage}it cannot be played again: {why}")) from why
