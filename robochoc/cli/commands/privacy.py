"""`robochoc privacy`: measures how much robots learned about each other in a recorded run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.local_problems import limits, local_options
from robochoc.cli.options.paths import InputPath, OutputFile, refuse_same_places
from robochoc.cli.options.saved import journal_team_option, saved_journal
from robochoc.cli.options.value_types import WholeNumber
from robochoc.cli.reports.failures import INVALID, USAGE, Failure, errors_as_failures, invalid_input_fails

if TYPE_CHECKING:
    from robochoc.journal import Journal
    from robochoc.privacy import Measure, PrivacyReport
    from robochoc.replay import ReplayOptions

MEASURES = ("linear", "entropy", "known")


@click.command()
@click.argument("journal", type=InputPath(), metavar="JOURNAL")
@click.option("--run", "number", type=WholeNumber(1), metavar="N", help="Run or epoch N.  [default: the last]")
@click.option("--measure", type=click.Choice(MEASURES), help="Measure shown in the table.  [default: entropy]")
@click.option(
    "--html", type=OutputFile(), metavar="FILE", help="Write a page with the loss of each robot to each other robot."
)
@click.option(
    "--coalition",
    type=WholeNumber(1),
    metavar="K",
    help="Measure what each coalition of K robots learns: repeat the run with every table of the other robots' costs"
    " (small teams).",
)
@click.option(
    "--coins", type=WholeNumber(1), metavar="N", help="With --coalition: seeds of other robots to try.  [default: 1]"
)
@journal_team_option
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, with all measures of all pairs.")
@local_options
@invalid_input_fails
def privacy(
    journal: Path,
    number: int | None,
    measure: str | None,
    html: Path | None,
    coalition: int | None,
    coins: int | None,
    folder: Path | None,
    *,
    as_json: bool,
    **local: Any,  # noqa: ANN401 - the options of local problems
) -> None:
    """Measure how much robots learned about each other's problems in the run that JOURNAL records.

    The table has the mean loss of each robot to all other robots: 0 if they can exclude nothing, 1 if they know
    everything. There are three kinds of secrets: the value in the answer (decision), the possible values of the robot
    and their costs (domain), and the entries of constraints that it shares with third robots (constraints).

    Losses are lower bounds: they count only what the rules of the messages prove. If a robot received a message without
    a rule, the loss is not known (documentation, page How much robots learn of each other).

    With --coalition, the table has the share of the other robots' tables that each coalition of K robots can exclude
    together: by its own values in the answer, and of the rest by all messages that it receives.
    """
    from robochoc.formats import read_team
    from robochoc.privacy import Measure
    from robochoc.replay import ReplayOptions
    from robochoc.solver.cache import SolutionCache

    if coalition is None and coins is not None:
        raise click.UsageError("--coins can be used with --coalition only")
    for option, given in (("--html", html), ("--measure", measure)):
        if coalition is not None and given is not None:
            raise click.UsageError(f"{option} cannot be used with --coalition")
    refuse_same_places({"--html": html}, {"the journal": journal})
    options = ReplayOptions(
        team=read_team(folder) if folder else None,
        limits=limits(local["local_solutions"], local["local_timeout"], always_ace=local["always_ace"]),
        cache=None if local["no_cache"] else SolutionCache(),
    )
    if coalition is not None:
        _print_coalitions(journal, number, options, coalition, coins or 1, as_json=as_json)
        return
    shown = Measure(measure or Measure.ENTROPY)
    report = _measured(journal, number, options)
    if as_json:
        from robochoc.cli.reports.privacy import privacy_json

        click.echo(privacy_json(report))
    else:
        from robochoc.cli.reports.privacy import print_privacy

        print_privacy(report, shown)
    if html is not None:
        _write(html, report, shown)


def _print_coalitions(
    path: Path, number: int | None, options: ReplayOptions, size: int, coins: int, *, as_json: bool
) -> None:
    from robochoc.cli.reports.coalitions import coalitions_json, print_coalitions
    from robochoc.privacy import coalitions_of

    recorded = _unaltered(path)
    with _privacy_errors(path):
        report = coalitions_of(recorded, size, options, number, coins=coins)
    _warn_of_unused_team(recorded, options)
    if as_json:
        click.echo(coalitions_json(report))
    else:
        print_coalitions(report)


def _unaltered(path: Path) -> Journal:
    recorded = saved_journal(path)
    if recorded.damage is not None and not recorded.truncated:
        raise Failure(INVALID, f"{path}: the journal was altered: {recorded.damage}")
    return recorded


@contextmanager
def _privacy_errors(path: Path) -> Iterator[None]:
    from robochoc.privacy import PrivacyError

    try:
        with errors_as_failures(path):
            yield
    except PrivacyError as why:
        raise Failure(INVALID if why.broken else USAGE, f"{path}: {why}") from why


def _measured(path: Path, number: int | None, options: ReplayOptions) -> PrivacyReport:
    from robochoc.cli.reports.progress import progress_line
    from robochoc.formats import on_one_line
    from robochoc.privacy import privacy_of

    recorded = _unaltered(path)
    with _privacy_errors(path), progress_line(on_one_line(recorded.header.team)) as progress:
        report = privacy_of(recorded, options, number, progress=progress)
    _warn_of_unused_team(recorded, options)
    return report


def _warn_of_unused_team(recorded: Journal, options: ReplayOptions) -> None:
    from robochoc.replay.rebuild import reads_files

    if options.team is not None and not reads_files(recorded.events):
        click.echo("--team is not used: the journal contains the robots' problems", err=True)


def _write(html: Path, report: PrivacyReport, measure: Measure) -> None:
    from robochoc.privacy.page import page_of
    from robochoc.system.files import write_atomically

    try:
        write_atomically(html, page_of(report, measure).encode())
    except OSError as error:
        raise Failure(INVALID, f"{html}: the page cannot be written: {error.strerror}") from error
    click.echo(f"{html}: written", err=True)
