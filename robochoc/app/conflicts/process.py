"""The process that searches for a conflict: it reads a sketch from standard input, and writes the conflict as JSON.

python -m robochoc.app.conflicts.process SECONDS < sketch.json
python -m robochoc.app.conflicts.process SECONDS FOLDER EVENTS      for an imported team, after a number of events
"""

from __future__ import annotations

import signal
import sys
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from robochoc.app.conflicts.by_cpmpy import (
    UntranslatedError,
    can_be_undefined,
    limits_of,
    minimal_by_cpmpy,
    minimal_of_team,
)
from robochoc.app.conflicts.rules import candidates, minimal, with_only
from robochoc.app.conflicts.search import Conflict, Finder
from robochoc.app.imported.robot_file import sentence
from robochoc.app.log import log_error
from robochoc.app.sketch.building import model_of
from robochoc.app.sketch.sketch import Sketch
from robochoc.app.texts import say
from robochoc.formats import read_team
from robochoc.model.change import team_after_events
from robochoc.model.constraint import INFINITE, Constraint, Function, Relation, Semantics
from robochoc.model.expression.bounds import Interval
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Robot, Team
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import Options
from robochoc.run.orchestrator import solve
from robochoc.system.errors import RobochocError
from robochoc.system.signals import signal_when_orphaned


class OutOfTimeError(RobochocError):
    """The time limit was reached."""


def is_satisfiable(team: Team, until: float) -> bool:
    """Return whether a team has a solution. Raises `OutOfTimeError` if the time is `until` (monotonic clock)."""
    left = until - time.monotonic()
    if left <= 0:
        raise OutOfTimeError
    verdict = solve(team, Options(protocol=CENTRAL, timeout=left, cache=False)).verdict
    if verdict == Verdict.UNKNOWN:
        raise OutOfTimeError
    return verdict != Verdict.NO_SOLUTION


def conflict_in_files(folder: Path, events: int, seconds: float, *, use_cpmpy: bool = True) -> Conflict:
    """Return the conflict in the team with files in `folder`, after a number of `events` in its scenario.

    CPMpy is used if it is installed, otherwise robochoc's central solver. Raises `InvalidInputError`.
    """
    team = team_after_events(read_team(folder), events)
    owned = [*_owned_constraints(team)]
    limits = limits_of(team)
    forbidding = [str(number) for number, (_, constraint) in enumerate(owned) if _forbids(constraint, limits)]
    until = time.monotonic() + seconds

    def conflict_of(rules: Sequence[str] | None, finder: Finder) -> Conflict:
        found = [owned[int(rule)] for rule in rules or ()]
        words = tuple(f"{robot.name}: {_words(robot, constraint)}" for robot, constraint in found)
        return Conflict(None if rules is None else tuple(rules), finder, words=words)

    if use_cpmpy:
        try:
            return conflict_of(minimal_of_team(team, {rule: owned[int(rule)][1] for rule in forbidding}), Finder.CPMPY)
        except (ImportError, UntranslatedError):
            pass
        except Exception as fault:  # noqa: BLE001 - logged; for example, numbers that are too large for the solver
            log_error(fault, "a conflict by CPMpy")
    try:
        rules = minimal(forbidding, lambda some: is_satisfiable(team_with_only(team, {*map(int, some)}), until))
        return conflict_of(rules, Finder.OWN)
    except OutOfTimeError:
        return Conflict(None, Finder.OWN, late=True)


def team_with_only(team: Team, kept: Collection[int]) -> Team:
    """Return a team with only the constraints with these indices in `Team.constraints`."""
    numbers = iter(range(sum(1 for _ in team.constraints())))

    def some(constraints: Sequence[Constraint]) -> tuple[Constraint, ...]:
        return tuple(one for one in constraints if next(numbers) in kept)

    robots = []
    for robot in team.robots:  # in the order of `Robot.constraints`
        private = some(robot.private)
        parents = tuple(replace(one, constraints=some(one.constraints)) for one in robot.parents)
        children = tuple(replace(one, constraints=some(one.constraints), copies=()) for one in robot.children)
        robots.append(replace(robot, private=private, parents=parents, children=children))
    return replace(team, robots=tuple(robots))


def _owned_constraints(team: Team) -> Iterator[tuple[Robot, Constraint]]:
    for robot in team.robots:
        for constraint in robot.constraints():
            yield robot, constraint


def _words(robot: Robot, constraint: Constraint) -> str:
    says = sentence(constraint, robot.symbol_table, robot.costs)
    return say("imported.undefined", says=says) if isinstance(constraint.definition, Function) else says


def _forbids(constraint: Constraint, limits: Mapping[str, Interval]) -> bool:
    """Return whether a constraint can be part of a conflict: it forbids values, or may be undefined."""
    definition = constraint.definition
    if isinstance(definition, Relation) and definition.semantics == Semantics.SOFT:
        return INFINITE in (*definition.costs, definition.default_cost)
    if isinstance(definition, Function):
        return can_be_undefined(constraint, limits)
    return isinstance(definition, Relation) or constraint.cost == INFINITE


def main() -> None:
    """Search, and write the result."""
    seconds = float(sys.argv[1])
    signal_when_orphaned(signal.SIGKILL)  # solvers may ignore other signals
    if len(sys.argv) > 2:  # noqa: PLR2004 - files
        found = conflict_in_files(Path(sys.argv[2]), int(sys.argv[3]), seconds)
    else:
        found = conflict_in(msgspec.json.decode(sys.stdin.buffer.read(), type=Sketch), seconds)
    sys.stdout.buffer.write(msgspec.json.encode(found))


def conflict_in(sketch: Sketch, seconds: float, *, use_cpmpy: bool = True) -> Conflict:
    """Return the conflict in a sketch, using CPMpy if it is installed, otherwise robochoc's central solver."""
    rules = [rule.id for rule in candidates(sketch)]
    if use_cpmpy:
        try:
            return Conflict(minimal_by_cpmpy(sketch, rules), Finder.CPMPY)
        except (ImportError, UntranslatedError):
            pass
        except Exception as fault:  # noqa: BLE001 - logged; for example, numbers that are too large for the solver
            log_error(fault, "a conflict by CPMpy")
    until = time.monotonic() + seconds
    try:
        return Conflict(
            minimal(rules, lambda some: is_satisfiable(model_of(with_only(sketch, some)).team, until)), Finder.OWN
        )
    except OutOfTimeError:
        return Conflict(None, Finder.OWN, late=True)


if __name__ == "__main__":
    main()
