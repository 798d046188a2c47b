"""A conflict between the constraints of an imported team, in words."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robochoc.app.conflicts.by_cpmpy import UntranslatedError, minimal_of_team
from robochoc.app.conflicts.found import Conflict, Finder
from robochoc.app.conflicts.rules import minimal
from robochoc.app.conflicts.time_left import OutOfTimeError, is_satisfiable
from robochoc.app.conflicts.undefined import can_be_undefined, limits_of
from robochoc.app.foreign.sentences import sentence
from robochoc.app.log import log_error
from robochoc.app.texts import say
from robochoc.formats import read_team
from robochoc.model.change import team_after_events
from robochoc.model.constraint import INFINITE, Constraint, Function, Relation, Semantics
from robochoc.model.expression.bounds import Interval
from robochoc.model.problem import Robot, Team


def found_in_files(folder: Path, events: int, seconds: float, *, use_cpmpy: bool = True) -> Conflict:
    """Return the conflict in the team with files in `folder`, after a number of `events` of its scenario.

    CPMpy is used if it is installed, else robochoc's central solver. Raises `InvalidInputError`.
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
        rules = minimal(forbidding, lambda some: is_satisfiable(with_only(team, {*map(int, some)}), until))
        return conflict_of(rules, Finder.OWN)
    except OutOfTimeError:
        return Conflict(None, Finder.OWN, late=True)


def with_only(team: Team, kept: Collection[int]) -> Team:
    """Return a team with only the constraints of these numbers, in the order of `Team.constraints`."""
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
    return say("foreign.undefined", says=says) if isinstance(constraint.definition, Function) else says


def _forbids(constraint: Constraint, limits: Mapping[str, Interval]) -> bool:
    """Return whether a constraint can be part of a conflict: it forbids values, or is undefined for some values."""
    definition = constraint.definition
    if isinstance(definition, Relation) and definition.semantics == Semantics.SOFT:
        return INFINITE in (*definition.costs, definition.default_cost)
    if isinstance(definition, Function):
        return can_be_undefined(constraint, limits)
    return isinstance(definition, Relation) or constraint.cost == INFINITE
