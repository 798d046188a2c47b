"""The best that is known of a search that minimises: of one that has ended, or that a limit has cut short.

Robots tell what they know (`protocols/findings.py`): an assignment of all that one of them has heard of, the values
that each has had in every cycle, or just the values that they have now. All of these are assignments whose cost
anybody who sees the files can tell; the cheapest is the answer.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from robochoc.communication.run_result import RunResult
from robochoc.outcome import Place
from robochoc.problem import INFINITE, Constraint, Predicate, Team
from robochoc.protocols.findings import Findings, Trail
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.encoding import price_on


class Found(NamedTuple):
    """An assignment of the robots that do not step aside, and what it costs: what constraints and absences charge."""

    assignment: dict[str, int]
    cost: float


class Objective:
    """What is minimised, for values that change: the costs of `team`'s constraints, and of those who step aside.

    `aside` is what it costs that a robot of weight 1 does so (None: nobody may, and without values there is no cost).
    """

    def __init__(self, team: Team, aside: float | None = None) -> None:
        self._weights = {robot.name: robot.weight for robot in team.robots}
        self._aside = aside
        self._constraints = [(c.variables, price_on(c, c.variables)) for c in team.constraints()]
        self._paid: list[float] = [0] * len(self._constraints)
        self._on: dict[str, list[int]] = {name: [] for name in team.variables}
        self._variables = {robot.name: [variable.name for variable in robot.variables] for robot in team.robots}
        for number, (names, price) in enumerate(self._constraints):
            for name in names:
                self._on[name].append(number)
            if not names:
                self._paid[number] = price(())
        self._values: dict[str, int] = {}
        self._absent = set(self._weights)

    def change(self, own: Mapping[str, Mapping[str, int]]) -> None:
        """Some robots have their `own` values from now on."""
        touched: dict[int, None] = {}
        for robot, values in own.items():
            for name in self._variables[robot]:
                self._values.pop(name, None)
                touched.update(dict.fromkeys(self._on[name]))
            self._values.update(values)
            (self._absent.discard if values else self._absent.add)(robot)
        for number in touched:
            names, price = self._constraints[number]
            known = all(name in self._values for name in names)
            self._paid[number] = price([self._values[name] for name in names]) if known else 0

    @property
    def cost(self) -> float:
        """What it comes to now."""
        if self._absent and self._aside is None:
            return INFINITE
        return sum(self._paid) + sum(self._weights[name] for name in self._absent) * (self._aside or 0)


def best_of(
    team: Team, result: RunResult, domains: Mapping[str, CompiledDomain], aside: float | None = None
) -> Found | None:
    """The cheapest assignment that `result` tells of; None when all that it tells of break hard constraints.

    `domains` are all robots' compiled domains.
    """
    best: Found | None = None
    for own in (result.assignments, *_heard_of(result.findings, domains), *_best_cycle(team, result, domains, aside)):
        objective = Objective(team, aside)
        objective.change(own)
        if objective.cost < (best.cost if best else INFINITE):
            best = Found(joined(own), objective.cost)
    return best


def course(
    team: Team, trails: Mapping[str, Trail], domains: Mapping[str, CompiledDomain], aside: float | None = None
) -> Iterator[float]:
    """The cost of the values that all robots had in cycle 0, 1, ..., as far as all have come."""
    objective = Objective(team, aside)
    for changed in _changes(trails, domains):
        objective.change(changed)
        yield objective.cost


def aside_cost(team: Team) -> float:
    """What stepping aside has to cost, for a robot of weight 1, so that nobody does so to spare others their costs."""
    return 1 + sum(_dearest(constraint) for constraint in team.constraints())


def _dearest(constraint: Constraint) -> float:
    """The most that `constraint` charges short of being broken."""
    definition = constraint.definition
    if isinstance(definition, Predicate):
        prices: tuple[float, ...] = (constraint.cost,)
    else:
        prices = (*definition.costs, definition.default_cost)
    return max((price for price in prices if price < INFINITE), default=0)


def bound_of(findings: Mapping[str, Findings]) -> float | None:
    """No assignment costs less; None when nobody can tell."""
    bounds = [found.bound for found in findings.values() if found.bound is not None]
    return sum(bounds) if bounds else None


def tree_of(findings: Mapping[str, Findings]) -> dict[str, Place]:
    """The pseudo-tree that the robots have built: those that have their place in it."""
    return {name: found.place for name, found in findings.items() if found.place is not None}


def joined(own: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """The values of all robots' variables."""
    return {name: value for values in own.values() for name, value in values.items()}


_Own = dict[str, dict[str, int]]


def _heard_of(findings: Mapping[str, Findings], domains: Mapping[str, CompiledDomain]) -> Iterator[_Own]:
    """The cheapest assignment that some robot has heard of."""
    bests = [found.best for found in findings.values() if found.best is not None]
    if bests:
        best = min(bests, key=lambda one: one.cost)
        yield {name: domains[name].behind(value) for name, value in best.values.items()}


def _best_cycle(
    team: Team, result: RunResult, domains: Mapping[str, CompiledDomain], aside: float | None
) -> Iterator[_Own]:
    """What the robots had in the cheapest cycle, the first of several."""
    trails = {name: found.trail for name, found in result.findings.items() if found.trail is not None}
    if len(trails) < len(team.robots):
        return
    costs = list(course(team, trails, domains, aside))
    if costs:
        own: _Own = {}
        for changed in itertools.islice(_changes(trails, domains), costs.index(min(costs)) + 1):
            own.update(changed)
        yield own


def _changes(trails: Mapping[str, Trail], domains: Mapping[str, CompiledDomain]) -> Iterator[_Own]:
    """For each cycle that all robots have behind them, the values of those that have changed."""
    changes: dict[int, _Own] = {}
    for name, trail in trails.items():
        for cycle, index in trail.entries:
            changes.setdefault(cycle, {})[name] = domains[name].solution(index)
    for cycle in range(min((trail.cycle for trail in trails.values()), default=-1) + 1):
        yield changes.get(cycle, {})
