"""Random teams with two or three objectives, and their optima by brute force."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from random import Random

from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Predicate, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import ProblemKind, Team

NAMES = ("energy", "risk", "time")
NEAR = Predicate("near", ("X", "Y"), Apply("lt", (Apply("dist", (Name("X"), Name("Y"))), Constant(2))))
GAP = Function("gap", ("X", "Y"), Apply("sub", (Apply("dist", (Name("X"), Name("Y"))), Constant(1))))
Vector = tuple[Fraction, ...]


def random_team(chance: Random, *, most_cost: int = 9) -> Team:
    """Return a small random team with all kinds of costs: negative, decimal, maximised, private, n-ary, hard ones."""
    objectives = NAMES[: chance.choice((2, 2, 3))]
    units = CostUnits(chance.random() < 0.3, chance.choice((0, 0, 1)))
    variables: dict[str, list[Variable]] = {}
    for robot in range(chance.randint(1, 4)):
        domain = Domain(f"D{robot}", (range(chance.randint(1, 3)),))
        owned = range(chance.choice((1, 1, 2)))
        variables[f"r{robot}"] = [Variable(f"v{robot}.{number}", domain) for number in owned]
    everything = [one for own in variables.values() for one in own]
    constraints = [
        _constraint(chance, f"C{number}", everything, objectives, most_cost) for number in range(chance.randint(2, 8))
    ]
    for variable in everything if chance.random() < 0.7 else ():  # cheap in one objective, expensive in another
        first, second = chance.sample(objectives, 2)
        constraints += [_ramp(chance, variable, first, 1), _ramp(chance, variable, second, -1)]
    extras = Extras(objectives=objectives)
    return assemble("random", variables, constraints, kind=ProblemKind.DISWCSP, costs=units, extras=extras)


def _ramp(chance: Random, variable: Variable, objective: str, sign: int) -> Constraint:
    """Return costs that ascend or descend with the values."""
    rows = tuple((value,) for value in variable.domain)
    costs = sorted(chance.sample(range(20), len(rows)), reverse=sign < 0)
    name = f"{objective}.{variable.name}"
    return Constraint(
        name,
        Relation(name, 1, Semantics.SOFT, rows, tuple(costs)),
        (variable.name,),
        (variable.name,),
        objective=objective,
    )


def _constraint(
    chance: Random, name: str, everything: list[Variable], objectives: tuple[str, ...], most_cost: int
) -> Constraint:
    chosen = chance.sample(everything, min(len(everything), chance.choice((1, 1, 2, 2, 2, 3))))
    scope = tuple(one.name for one in chosen)
    objective = chance.choice(objectives)
    if len(scope) == 2 and chance.random() < 0.4:
        if chance.random() < 0.5:
            return Constraint(name, GAP, scope, scope, objective=objective)
        cost = chance.choice((INFINITE, chance.randint(-most_cost, most_cost)))
        return Constraint(name, NEAR, scope, scope, cost=cost, objective="" if cost == INFINITE else objective)
    rows = [*itertools.product(*(one.domain for one in chosen))]
    listed = tuple(sorted(chance.sample(rows, chance.randint(1, len(rows)))))
    costs = tuple(INFINITE if chance.random() < 0.1 else chance.randint(-2, most_cost) for _ in listed)
    relation = Relation(f"R{name}", len(scope), Semantics.SOFT, listed, costs, chance.randint(0, most_cost))
    return Constraint(name, relation, scope, scope, objective=objective)


def solutions(team: Team) -> Iterator[tuple[Vector, dict[str, int]]]:
    """Yield each solution with its cost in each objective, in the user's units; utilities have the opposite sign."""
    places = max(robot.costs.places for robot in team.robots)
    sign = -1 if team.robots[0].costs.maximize else 1
    names = [*team.variables]
    constraints = [*team.constraints()]
    for values in itertools.product(*(one.domain for one in team.variables.values())):
        assignment = dict(zip(names, values, strict=True))
        paid = [one.price(assignment) for one in constraints]
        if math.inf in paid:
            continue
        totals = dict.fromkeys(team.objectives, Fraction(0))
        for constraint, cost in zip(constraints, paid, strict=True):
            if constraint.objective:
                unit = Fraction(1) if isinstance(constraint.definition, Function) else Fraction(1, 10**places)
                totals[constraint.objective] += sign * int(cost) * unit
        yield tuple(totals.values()), assignment


def brute_front(team: Team) -> set[Vector]:
    """Return the vectors of the Pareto front, utilities with the opposite sign."""
    found = {vector for vector, _ in solutions(team)}
    return {
        one
        for one in found
        if not any(other != one and all(a <= b for a, b in zip(other, one, strict=True)) for other in found)
    }


def as_vector(team: Team, costs: dict[str, int | Decimal]) -> Vector:
    """Return the costs in an outcome as `solutions` does."""
    sign = -1 if team.robots[0].costs.maximize else 1
    return tuple(sign * Fraction(costs[name]) for name in team.objectives)
