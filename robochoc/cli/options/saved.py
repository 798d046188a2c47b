"""Input files that robochoc has written: journals and results, and the teams that belong to them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.journal.journal import Journal
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Robot, Team

LARGEST_FILE = 1 << 30
"""1 GiB: a journal of hundreds of millions of messages, or one of millions as text."""
JOURNAL_STEP = "give what 'robochoc solve --journal' wrote"
_OUTCOME_STEP = "give what 'robochoc solve --json' or '--journal' wrote"

team_option = click.option(
    "--team",
    "folder",
    type=TeamFolder(),
    metavar="DIR",
    help="The team's folder, for names and topics.  [default: the journal's own data, or instances/TEAM]",
)

journal_team_option = click.option(
    "--team",
    "folder",
    type=TeamFolder(),
    metavar="DIR",
    help="The team's folder, for a journal without the robots' problems (from several machines).",
)


def saved_content(file: Path, next_step: str) -> bytes:
    """Return the content of `file`. Raises `Failure`, whose message ends in `next_step`."""
    try:
        with file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise _refused(file, str(error.strerror or error), next_step) from error
    if len(content) > LARGEST_FILE:
        raise _refused(file, f"it has more than {LARGEST_FILE:,} bytes", next_step)
    return content


def saved_journal(file: Path) -> Journal:
    """The journal in `file`. Raises `Failure`."""
    from robochoc.journal.journal import JournalError, read_journal

    content = saved_content(file, JOURNAL_STEP)
    try:
        return read_journal(content)
    except JournalError as wrong:
        raise _refused(file, str(wrong), JOURNAL_STEP) from wrong


def saved_outcome(saved: Path) -> tuple[Outcome, Team | None]:
    """Return the outcome in a file, a JSON result or a journal; and the team, if a journal has it.

    Raises `Failure`.
    """
    from robochoc.formats.result import ResultError, read_result
    from robochoc.journal.journal import JournalError, is_journal, read_journal

    content = saved_content(saved, _OUTCOME_STEP)
    try:
        if not is_journal(content):
            return read_result(content), None
        journal = read_journal(content)
    except (JournalError, ResultError) as wrong:
        raise Failure(INVALID, f"{saved}: {wrong} ({_OUTCOME_STEP})") from wrong
    if journal.outcome is None:
        why = journal.damage or "the run broke off"
        raise Failure(INVALID, f"{saved}: {why}, so there is no outcome to show ({_OUTCOME_STEP})")
    return journal.outcome, _given_team(journal)


def _given_team(journal: Journal) -> Team | None:
    """Return the team of a journal, with all robots in their first state; None if the journal does not contain it."""
    from robochoc.journal.events import Given
    from robochoc.journal.given import GivenProblemError, TeamReader
    from robochoc.model.problem import Team

    reader = TeamReader()
    robots: dict[str, Robot] = {}
    try:
        for event in journal.events:
            if isinstance(event, Given):
                robots = {robot.name: robot for robot in reader.team(event).robots} | robots
    except GivenProblemError:  # robots on other machines keep their problems to themselves, say
        return None
    return Team(journal.header.team, tuple(robots.values())) if robots else None


def saved_team(
    outcome: Outcome, given: Team | None, saved: Path, folder: Path | None
) -> tuple[Team | None, Path | None]:
    """Return the team of a saved outcome, and its folder. None if there is none.

    The team is read from `folder`; without one, it is that of the journal (`given`), or read from the default folder.

    Raises `InvalidInputError`, and `Failure` for another team than that of `outcome`, which is from the file `saved`.
    """
    from robochoc.formats import read_team, robot_names

    if folder is None and given is not None and _is_team_of(outcome, given):
        usual = _usual_folder(outcome)
        is_there = usual is not None and set(robot_names(usual)) <= {robot.name for robot in given.robots}
        return given, usual if is_there else None  # for its map
    folder = folder or _usual_folder(outcome)
    if folder is None:
        missing = Path("instances") / Path(outcome.team).name
        click.echo(
            f"{missing} is not there: drones are named for variables, without topics (give --team DIR)", err=True
        )
    team = read_team(folder) if folder else None
    if team and not _is_team_of(outcome, team):
        why = f"this is not the team of {saved}, {outcome.team} (give its folder with --team)"
        raise Failure(INVALID, f"{folder}: {why}")
    return team, folder


def _is_team_of(outcome: Outcome, team: Team) -> bool:
    """Return whether `team`, or its scenario, has all robots and all decided values of `outcome`."""
    from robochoc.flight.mission import all_robots

    robots = all_robots(team)
    names = {robot.name for robot in robots}
    variables = {variable.name for robot in robots for variable in robot.variables}
    epochs = outcome.epochs
    there = {*outcome.withdrawn, *(name for epoch in epochs for name in epoch.robots)}
    decided = {*outcome.assignment, *(name for epoch in epochs for name in epoch.assignment)}
    return there <= names and decided <= variables


def _usual_folder(outcome: Outcome) -> Path | None:
    """Return the folder in which `generate` puts teams of that name. None: there is no such folder."""
    name = Path(outcome.team).name
    folder = Path("instances") / name
    return folder if name not in {"", ".."} and folder.is_dir() else None


def _refused(file: Path, why: str, next_step: str) -> Failure:
    from robochoc.formats import on_one_line

    return Failure(INVALID, on_one_line(f"{file}: {why} ({next_step})"))
