"""Executes one run of a study: each task results in a row, even after an error."""

from __future__ import annotations

import os
import platform
import time
from contextlib import AbstractContextManager, ExitStack
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from robochoc import __version__
from robochoc.communication.search_result import RobotsLostError
from robochoc.experiments.digests import digest_of_files, digest_of_team
from robochoc.experiments.observers import CostOverTime, RobotLoads, journal_bytes, journal_of
from robochoc.experiments.task import ASSIGNMENT, ProblemSpec, Recording, Row, Status, Task, options_of
from robochoc.formats.diagnostics import InvalidInputError, invalid_input
from robochoc.formats.problems import read_problem
from robochoc.generators.scenario import random_scenario
from robochoc.journal.events import combined
from robochoc.model.cost_units import Cost, common_units
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.compatibility.option_rules import refuse_options
from robochoc.run.defaults import CENTRAL
from robochoc.run.distributed import FOUND_NOTHING, GAVE_UP
from robochoc.run.options import Runtime
from robochoc.run.orchestrator import prepare
from robochoc.run.registry import UnknownProtocolError
from robochoc.solver.ace import AceProcess
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import RefutedError

KEPT = 4
"""The maximum number of problems in the cache. It can be small, as the runs on one problem follow each other."""
_STATUS_OF: tuple[tuple[type[Exception], Status], ...] = (
    (InvalidInputError, Status.INVALID),
    (UnsupportedError, Status.REFUSED),
    (UnknownProtocolError, Status.REFUSED),
    (RobotsLostError, Status.LOST),
    (RefutedError, Status.REFUTED),
    (MemoryError, Status.MEMORY),
)


class TaskRunner(AbstractContextManager["TaskRunner"]):
    """Runs tasks one by one, with a cache of problems and a single process of the constraint solver."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        self._solver = self._stack.enter_context(AceProcess())
        self._teams: dict[str, tuple[Team, str]] = {}

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the solver's process."""
        self._stack.__exit__(kind, error, trace)

    def __enter__(self) -> Self:
        """Return self."""
        return self

    def run(self, task: Task) -> Row:
        """Run `task` and return its row. After an error, the row contains the reason."""
        began = time.perf_counter()
        row = Row(status=Status.ERROR, machine=machine(), version=__version__)
        try:
            team, digest = self._team(task.problem)
        except Exception as error:  # noqa: BLE001 - the study continues after any error
            row.status, row.reason = _status(error, Status.INVALID), _error_text(error)
            return row
        _describe(row, team, digest)
        try:
            self._solve(task, team, row)
        except Exception as error:  # noqa: BLE001 - also errors of a user's protocol
            row.status, row.reason = _status(error, Status.ERROR), _error_text(error)
        row.total_s = time.perf_counter() - began
        return row

    def _solve(self, task: Task, team: Team, row: Row) -> None:
        cpu = time.process_time()
        options = options_of(task.setup, task.limits, task.seed)
        refuse_options(options)
        run = prepare(team, options)
        options = run.choice.options
        is_recorded = Recording.COST_OVER_TIME in task.record and not (run.combined and run.combined.is_packed)
        curve = CostOverTime(run.team, options) if is_recorded else None
        loads = RobotLoads() if Recording.ROBOTS in task.record else None
        journal = journal_of(run.team, options) if Recording.JOURNAL in task.record else None
        sent = curve.note_sent if curve and options.runtime == Runtime.ARRAYS else None
        outcome = run.solve(observer=combined(curve, loads, journal), progress=sent, solver=self._solver)
        row.cpu_s = None if task.is_timed else time.process_time() - cpu
        _fill(row, outcome, team)
        row.cost_over_time = curve.points() if curve else []
        row.loads = loads.loads() if loads else []
        if ASSIGNMENT in task.record and outcome.events == len(team.scenario):
            row.assignment = dict(outcome.assignment)
        row.journal = journal_bytes(journal, outcome) if journal else b""

    def _team(self, problem: ProblemSpec) -> tuple[Team, str]:
        """Return the team for a problem, and the digest of its robots' files. Raises the exceptions of `team_of`."""
        identity = problem.identity
        if identity not in self._teams:
            while len(self._teams) >= KEPT:
                del self._teams[next(iter(self._teams))]
            team = team_of(problem)
            if problem.digest and digest_of_files(Path(problem.path)) != problem.digest:
                raise invalid_input(problem.path, "has changed since the start of the study", "run the study again")
            self._teams[identity] = team, digest_of_team(team)
        return self._teams[identity]


def team_of(problem: ProblemSpec) -> Team:
    """Return the team that solves a problem.

    Raises:
        InvalidInputError: if the problem's files are invalid.
        ValueError: if the family has no problem with these parameters.
    """
    if problem.family:
        from robochoc.generators.families import FAMILIES  # noqa: PLC0415 - start-up: the application's pages

        team = FAMILIES[problem.family](**problem.parameters)
    else:
        options: dict[str, Any] = {key: one for key, one in problem.parameters.items() if key != "instance"}
        team = read_problem(Path(problem.path), **options).team
    if problem.scenario:
        scenario = dict(problem.scenario)
        if "kinds" in scenario:
            scenario["kinds"] = scenario["kinds"].split()
        team = random_scenario(team, **scenario)
    return team


@cache
def machine() -> str:
    """Return a description of this machine: its name, its processors, and its Python version."""
    return f"{platform.node()}, {os.cpu_count()} x {platform.machine()}, Python {platform.python_version()}"


def _status(error: Exception, otherwise: Status) -> Status:
    if isinstance(error, RobotsLostError) and MemoryError.__name__ in str(error):
        return Status.MEMORY
    return next((status for kind, status in _STATUS_OF if isinstance(error, kind)), otherwise)


def _error_text(error: Exception) -> str:
    text = str(error)
    foreseen = isinstance(error, (ValueError, *(kind for kind, _ in _STATUS_OF)))
    return text if text and foreseen else f"{type(error).__name__}: {text}".rstrip(": ")


def _describe(row: Row, team: Team, digest: str) -> None:
    row.team, row.digest = team.name, digest
    row.robots, row.variables = len(team.robots), len(team.variables)
    row.constraints = sum(1 for _ in team.constraints())
    row.maximises = common_units(robot.costs for robot in team.robots).maximize


def _fill(row: Row, outcome: Outcome, team: Team) -> None:
    """Copy an outcome into a row."""
    metrics = outcome.metrics
    row.status = Status.DONE
    if outcome.verdict == Verdict.UNKNOWN:
        by_itself = any(why in (outcome.reason or "") for why in (GAVE_UP, FOUND_NOTHING))
        row.status = Status.ENDED if by_itself else Status.LIMIT
    row.reason, row.verdict = outcome.reason, str(outcome.verdict)
    if outcome.events == len(team.scenario):  # otherwise a limit ended the run before the last problem
        row.cost, row.bound = _exact(outcome.cost if team.kind == ProblemKind.DISWCSP else None), _exact(outcome.bound)
    row.withdrawn, row.verified, row.confirmed = len(outcome.withdrawn), outcome.verified, outcome.confirmed
    row.wall_s, row.compile_s, row.memory = metrics.wall_s, metrics.compile_s, metrics.memory or None
    if outcome.protocol == CENTRAL:  # the central solver sends no messages, so its counts are not comparable
        return
    row.messages_by_type = dict(sorted(metrics.messages.items()))
    row.messages, row.bytes, row.largest = sum(metrics.messages.values()), metrics.bytes, metrics.largest
    row.ncccs, row.checks = metrics.ncccs, metrics.checks
    row.simulated_s, row.cycles = metrics.simulated_s or None, metrics.cycles or None
    if outcome.preprocessing:
        spent = outcome.preprocessing.metrics
        row.removed = outcome.preprocessing.removed
        row.removing_messages, row.removing_ncccs = sum(spent.messages.values()), spent.ncccs


def _exact(cost: Cost | None) -> str | None:
    return None if cost is None else str(cost)
