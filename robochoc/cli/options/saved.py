"""Reads input files that robochoc has written, journals and results, and finds their teams."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

import click

from robochoc.cli.options.paths import TeamFolder
from robochoc.cli.reports.failures import INVALID, USAGE, Failure

if TYPE_CHECKING:
    from robochoc.journal.events import AnyEvent
    from robochoc.journal.journal import Journal
    from robochoc.model.outcome import Outcome
    from robochoc.model.problem import Robot, Team
    from robochoc.sniffer.trace import Trace

LARGEST_FILE = 1 << 30
"""The maximum size of a file: 1 GiB, a journal with hundreds of millions of messages, or millions as text."""
JOURNAL_STEP = "give a file of 'robochoc solve --journal'"
_OUTCOME_STEP = "give a result of 'robochoc solve --json' or a journal of '--journal'"

team_option = click.option(
    "--team",
    "folder",
    type=TeamFolder(),
    metavar="DIR",
    help="The team's folder, for names and topics.  [default: the team in the journal, or instances/TEAM]",
)

journal_team_option = click.option(
    "--team",
    "folder",
    type=TeamFolder(),
    metavar="DIR",
    help="The team's folder, for a journal without the robots' problems (a run on several machines).",
)


def saved_content(file: Path, next_step: str, opened: BinaryIO | None = None) -> bytes:
    """Return the content of `file`, which may be `opened` already. Raises `Failure`, which ends with `next_step`."""
    try:
        with opened or file.open("rb") as stream:
            content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise _failure(file, str(error.strerror or error), next_step) from error
    if len(content) > LARGEST_FILE:
        raise _failure(file, f"the file has more than {LARGEST_FILE:,} bytes", next_step)
    return content


def saved_journal(file: Path, opened: BinaryIO | None = None) -> Journal:
    """Return the journal in `file`, which may be `opened` already. Raises `Failure`."""
    from robochoc.journal.journal import JournalError, read_journal

    content = saved_content(file, JOURNAL_STEP, opened)
    try:
        return read_journal(content)
    except JournalError as error:
        raise _failure(file, str(error), JOURNAL_STEP) from error


class SavedTrace(NamedTuple):
    """The trace of a journal, and its events and entries, which are read from the file on each call."""

    trace: Trace
    events: Callable[[], Iterable[AnyEvent]]
    journal: Callable[[], Journal]


@contextmanager
def saved_trace(file: Path) -> Iterator[SavedTrace]:
    """Provide the trace of the journal in `file`. Only a pipe is read into memory. Raises `Failure`."""
    from robochoc.journal.journal import JournalError
    from robochoc.sniffer.growing_file import NoFileError
    from robochoc.sniffer.trace import Trace, TraceTooLargeError

    with ExitStack() as stack:
        try:
            stream = stack.enter_context(file.open("rb"))
            try:
                saved = _read_trace(file, stream)
            except NoFileError:
                journal = saved_journal(file, stream)  # to open a FIFO again would wait for a second writer
                saved = SavedTrace(Trace.of(journal), lambda: journal.events, lambda: journal)
        except TraceTooLargeError as large:
            raise Failure(USAGE, f"{file}: {large}") from large
        except JournalError as error:
            raise _failure(file, str(error), JOURNAL_STEP) from error
        except OSError as error:
            raise _failure(file, str(error.strerror or error), JOURNAL_STEP) from error
        yield saved


def _read_trace(file: Path, stream: BinaryIO) -> SavedTrace:
    """Return the trace of the journal in `stream`, which must stay open. Raises `JournalError`, `OSError`."""
    from robochoc.journal.journal import JournalError
    from robochoc.sniffer.growing_file import GrowingFile
    from robochoc.sniffer.live_trace import LiveTrace

    live = LiveTrace(GrowingFile(stream.fileno()), lambda: inf)
    while not live.settled:
        live.advance()
    if live.trace is None:
        raise JournalError("the journal has no header")
    return SavedTrace(live.trace, live.events, lambda: saved_journal(file))


def saved_outcome(saved: Path) -> tuple[Outcome, Team | None]:
    """Return the outcome in a JSON result or journal, and the team if a journal contains it.

    Raises `Failure`.
    """
    from robochoc.formats.result import ResultError, read_result
    from robochoc.journal.journal import JournalError, is_journal, read_journal

    content = saved_content(saved, _OUTCOME_STEP)
    try:
        if not is_journal(content):
            return read_result(content), None
        journal = read_journal(content)
    except (JournalError, ResultError) as error:
        raise Failure(INVALID, f"{saved}: {error} ({_OUTCOME_STEP})") from error
    if journal.outcome is None:
        why = journal.damage or "the run was interrupted"
        raise Failure(INVALID, f"{saved}: {why}, so the journal has no outcome ({_OUTCOME_STEP})")
    return journal.outcome, _given_team(journal)


def _given_team(journal: Journal) -> Team | None:
    """Return the team in a journal, with all robots in their initial state, or None if the journal has no team."""
    from robochoc.journal.events import Given
    from robochoc.journal.team_events import GivenProblemError, TeamReader
    from robochoc.model.problem import Team

    reader = TeamReader()
    robots: dict[str, Robot] = {}
    try:
        for event in journal.events:
            if isinstance(event, Given):
                robots = {robot.name: robot for robot in reader.team(event).robots} | robots
    except GivenProblemError:  # for example, robots on other machines do not report their problems
        return None
    return Team(journal.header.team, tuple(robots.values())) if robots else None


def saved_team(
    outcome: Outcome, given: Team | None, saved: Path, folder: Path | None
) -> tuple[Team | None, Path | None]:
    """Return the team of a saved outcome and its folder, or None for either if it is not found.

    The team is read from `folder`. Without a folder, it is the journal's team (`given`), or read from the default
    folder.

    Raises `InvalidInputError`, or `Failure` if the team does not belong to `outcome`, which was read from `saved`.
    """
    from robochoc.formats import read_team, robot_names

    if folder is None and given is not None and _is_team_of(outcome, given):
        default = _default_folder(outcome)
        is_same = default is not None and set(robot_names(default)) <= {robot.name for robot in given.robots}
        return given, default if is_same else None  # the folder may contain a map
    folder = folder or _default_folder(outcome)
    if folder is None:
        missing = Path("instances") / Path(outcome.team).name
        click.echo(
            f"{missing} does not exist: drones are named after variables, without topics (give --team DIR)", err=True
        )
    team = read_team(folder) if folder else None
    if team and not _is_team_of(outcome, team):
        why = f"the team in this folder is not {outcome.team}, the team of {saved} (give the folder with --team)"
        raise Failure(INVALID, f"{folder}: {why}")
    return team, folder


def _is_team_of(outcome: Outcome, team: Team) -> bool:
    """Return whether `team` or its scenario contains all robots and all decided values in `outcome`."""
    from robochoc.flight.mission import all_robots

    robots = all_robots(team)
    names = {robot.name for robot in robots}
    variables = {variable.name for robot in robots for variable in robot.variables}
    epochs = outcome.epochs
    mentioned = {*outcome.withdrawn, *(name for epoch in epochs for name in epoch.robots)}
    decided = {*outcome.assignment, *(name for epoch in epochs for name in epoch.assignment)}
    return mentioned <= names and decided <= variables


def _default_folder(outcome: Outcome) -> Path | None:
    """Return the folder to which `generate` writes teams with this name, or None if it does not exist."""
    name = Path(outcome.team).name
    folder = Path("instances") / name
    return folder if name not in {"", ".."} and folder.is_dir() else None


def _failure(file: Path, why: str, next_step: str) -> Failure:
    from robochoc.formats import on_one_line

    return Failure(INVALID, on_one_line(f"{file}: {why} ({next_step})"))
