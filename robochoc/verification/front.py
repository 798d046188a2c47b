"""The Pareto front of a small team by enumeration: an independent check of the fronts that robots find.

It shares no code with the protocols, the solver, and packed costs: each assignment is evaluated by the checker, and
vectors are compared component by component.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping

from robochoc.model.cost_units import Cost
from robochoc.model.problem import Team
from robochoc.verification.checker import RefutedError, objective_costs, violations
from robochoc.verification.repeated_check import RepeatedCheck

MOST_ASSIGNMENTS = 100_000
"""The maximum number of assignments that are enumerated."""

Vector = tuple[Cost, ...]


def assignments_of(team: Team) -> int:
    """Return the number of assignments of all variables of `team`, valid or not."""
    return math.prod(len(variable.domain) for variable in team.variables.values())


def enumerated_front(team: Team) -> dict[Vector, dict[str, int]]:
    """Return the Pareto front of `team`, which has several objectives: its vectors, each with an assignment.

    The vectors are in ascending order if costs are minimised, in descending order if they are maximised.
    """
    checks = RepeatedCheck(team)
    names = [*team.variables]
    found: dict[Vector, dict[str, int]] = {}
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        assignment = dict(zip(names, values, strict=True))
        if checks.cost(assignment) < math.inf:
            found.setdefault(tuple(objective_costs(team, assignment).values()), assignment)
    maximize = team.robots[0].costs.maximize
    best: list[Vector] = []
    steps: list[Vector] = []  # the best vectors so far without the first objective
    for one in sorted(found, reverse=maximize):  # a vector follows those that dominate it
        rest = one[1:]
        if not any(step == rest or dominates(step, rest, maximize=maximize) for step in steps):
            best.append(one)
            steps = [step for step in steps if not dominates(rest, step, maximize=maximize)] + [rest]
    return {one: found[one] for one in best}


def dominates(one: Vector, other: Vector, *, maximize: bool = False) -> bool:
    """Return whether `one` is better than `other` in some objective and worse in none."""
    if maximize:
        one, other = other, one
    return one != other and all(mine <= theirs for mine, theirs in zip(one, other, strict=True))


def check_front(team: Team, front: Iterable[tuple[Mapping[str, Cost], Mapping[str, int]]]) -> None:
    """Check the points of a front against the files: assignments, costs, and that no point dominates another one.

    Raises:
        RefutedError: if a point is invalid or dominated.
    """
    maximize = team.robots[0].costs.maximize
    points = [(tuple(costs.values()), assignment) for costs, assignment in front]
    for vector, assignment in points:
        if faults := [*violations(team, assignment)]:
            raise RefutedError(f"the checker refutes a point of the front of {team.name}: {faults[0]}")
        if tuple(objective_costs(team, assignment).values()) != vector:
            raise RefutedError(f"a point of the front of {team.name} does not have the costs that are claimed")
    vectors = [vector for vector, _ in points]
    if len({*vectors}) < len(vectors):
        raise RefutedError(f"two points of the front of {team.name} have equal costs")
    if len(vectors) <= MOST_COMPARED and any(
        dominates(one, other, maximize=maximize) for one in vectors for other in vectors
    ):
        raise RefutedError(f"a point of the front of {team.name} dominates another one")


MOST_COMPARED = 1_000
"""The largest front whose points are all compared with each other."""


def confirm_front(team: Team, front: Iterable[Mapping[str, Cost]]) -> bool:
    """Return whether enumeration confirms the costs of a front; False if there are too many assignments.

    Raises:
        RefutedError: if the front differs.
    """
    if assignments_of(team) > MOST_ASSIGNMENTS:
        return False
    claimed = {tuple(costs.values()) for costs in front}
    found = {*enumerated_front(team)}
    if claimed != found:
        more, fewer = len(claimed - found), len(found - claimed)
        raise RefutedError(
            f"enumeration refutes the front of {team.name}: {more} of its points are wrong, {fewer} are missing"
        )
    return True
