"""Teams with several objectives as ordinary teams with a single cost (`model/objectives.py`).

A weighted sum multiplies each cost by the weight of its objective. A lexicographic order is a weighted sum, too: the
weight of an objective exceeds the largest possible sum of all less important costs. With these weights the single cost
is also a packed vector, from which the cost in each objective can be read.

All of this is integer arithmetic on the costs in files, so the single-cost team has exactly the same solutions.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from robochoc.model.constraint import INFINITE, Constraint, Function, Predicate, Relation
from robochoc.model.costs import normalized
from robochoc.model.expression import Apply, Constant
from robochoc.model.objectives import place_values
from robochoc.model.problem import AddAgent, AddConstraint, Change, Robot, Team
from robochoc.solver.encoding import max_cost
from robochoc.solver.errors import UnsupportedError
from robochoc.system.plain_text import listed

LARGEST = 10**17
"""The largest sum of a team's combined costs. Costs have at most 18 digits, and messages contain 64-bit integers."""


def combined(team: Team, weights: Mapping[str, int]) -> Team:
    """Return `team` with a single cost: the sum of the costs in all objectives, each multiplied by its weight."""
    combination = _Combination(weights)
    events = tuple(replace(event, changes=tuple(map(combination.change, event.changes))) for event in team.scenario)
    return replace(team, robots=tuple(map(combination.robot, team.robots)), scenario=events)


def refuse_excess(team: Team, weights: Mapping[str, int]) -> None:
    """Raise `UnsupportedError` if the combined costs of `team` could add up to more than `LARGEST`."""
    sums = largest_sums(team)
    total = sum(weight * sums[name] for name, weight in weights.items())
    if total > LARGEST:
        each = listed([f"{name} up to {most:,}" for name, most in sums.items()])
        raise UnsupportedError(
            f"the combined costs of {team.name} could add up to {total:,} ({each}, in units of the last decimal place),"
            f" more than {LARGEST:,}: use smaller costs, or fewer decimal places"
        )


def largest_sums(team: Team) -> dict[str, int]:
    """Return an upper bound on the range of the sum of costs in each objective, including those that events add."""
    found = {}
    for objective in team.objectives:
        alone = normalized(combined(team, {name: int(name == objective) for name in team.objectives}))
        found[objective] = sum(int(max_cost(one)) for one in _all_constraints(alone))
    return found


def lexicographic_bases(team: Team, order: Sequence[str]) -> tuple[int, ...]:
    """Return the bases of packed vectors whose components are the objectives in this `order`."""
    sums = largest_sums(team)
    return tuple(sums[name] + 1 for name in order[1:])


def lexicographic_weights(order: Sequence[str], bases: Sequence[int]) -> dict[str, int]:
    """Return the weights with which the weighted sum is a packed vector."""
    return dict(zip(order, place_values(bases), strict=True))


def with_all_solutions(team: Team) -> Team:
    """Return `team` with all variables visible of robots that may trade private costs against each other.

    Of the local solutions that look alike to all neighbours, a robot only keeps the cheapest one, and with several
    objectives each may be the cheapest.
    """
    return replace(team, robots=tuple(map(_with_all_solutions, team.robots)))


def _with_all_solutions(robot: Robot) -> Robot:
    names = tuple(variable.name for variable in robot.variables)
    trades = any(constraint.has_costs for constraint in robot.private)
    return replace(robot, shown=names) if trades and robot.interface != names else robot


def _all_constraints(team: Team) -> Iterator[Constraint]:
    """Yield all constraints, also those that events add."""
    yield from team.constraints()
    for event in team.scenario:
        for change in event.changes:
            if isinstance(change, AddAgent):
                yield from change.robot.constraints()
            elif isinstance(change, AddConstraint):
                yield change.constraint


class _Combination:
    """Multiplies costs by the weights of their objectives. Equal relations stay one object."""

    def __init__(self, weights: Mapping[str, int]) -> None:
        self._weights = weights
        self._known: dict[tuple[int, int], tuple[Relation, Relation]] = {}

    def robot(self, robot: Robot) -> Robot:
        return replace(robot.with_constraints(self.constraint), objectives=())

    def change(self, change: Change) -> Change:
        match change:
            case AddAgent(robot):
                return replace(change, robot=self.robot(robot))
            case AddConstraint(constraint=constraint):
                return replace(change, constraint=self.constraint(constraint))
            case _:
                return change

    def constraint(self, constraint: Constraint) -> Constraint:
        if not constraint.has_costs:
            return constraint
        weight = self._weights[constraint.objective]
        plain = replace(constraint, objective="")
        match constraint.definition:
            case Relation() as relation:
                return replace(plain, definition=self._relation(relation, weight))
            case Predicate():
                return replace(plain, cost=int(constraint.cost) * weight)
            case Function() as function:
                body = function.body if weight == 1 else Apply("mul", (Constant(weight), function.body))
                return replace(plain, definition=replace(function, body=body))

    def _relation(self, relation: Relation, weight: int) -> Relation:
        key = id(relation), weight
        if key not in self._known:
            costs = tuple(_times(cost, weight) for cost in relation.costs)
            weighted = replace(relation, costs=costs, default_cost=_times(relation.default_cost, weight))
            self._known[key] = relation, weighted
        return self._known[key][1]


def _times(cost: float, weight: int) -> float:
    return INFINITE if cost == INFINITE else int(cost) * weight
