"""A team's costs as tables in the user's numbers: what formats of other tools can say."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

from robochoc.formats.definitions import MAX_TUPLES
from robochoc.formats.dialects.tables import Amount, CostTable
from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Relation, Semantics
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import Robot, Team
from robochoc.solver.encoding import UnsupportedError


@dataclass(frozen=True)
class Exported:
    """The costs of some variables.

    Attributes:
        scope: The variables.
        table: The costs of tuples of their values.
    """

    scope: tuple[str, ...]
    table: CostTable


def exported(team: Team) -> tuple[list[Exported], Fraction]:
    """Return the costs of a team that has not been normalised, and the constant among them.

    Raises:
        UnsupportedError: if a constraint is too large for a table.
    """
    domains = {name: variable.domain for name, variable in team.variables.items()}
    names: dict[str, int] = {}
    found = []
    for robot in team.robots:
        for constraint in _held(robot):
            names[constraint.name] = number = names.get(constraint.name, 0) + 1
            name = constraint.name if number == 1 else f"{constraint.name}_{number}"
            found.append(_table(constraint, name, robot.costs, domains))
    constant = sum((Fraction(one.costs.constant, 10**one.costs.places) for one in team.robots), Fraction(0))
    return found, constant


def maximises(team: Team) -> bool:
    """Return whether the costs of `team` are maximised."""
    return any(robot.costs.maximize for robot in team.robots)


def magnitude(tables: list[Exported], constant: Fraction) -> int:
    """Return an integer that no sum of finite costs reaches, nor its negative."""
    most = abs(constant)
    for one in tables:
        most += max((abs(Fraction(cost)) for cost in one.table.amounts() if cost != INFINITE), default=Fraction(0))
    return math.floor(most) + 1


def decimal(amount: Amount, places: int | None = None) -> str:
    """Return a finite cost as a decimal without an exponent; with `places`, with so many of them."""
    whole = Fraction(amount)
    width = places or 0
    while places is None and (whole * 10**width).denominator != 1:
        width += 1
    digits = str(abs(round(whole * 10**width))).rjust(width + 1, "0")
    sign = "-" if whole < 0 else ""
    return f"{sign}{digits[:-width]}.{digits[-width:]}" if width else f"{sign}{digits}"


def _held(robot: Robot) -> Iterator[Constraint]:
    yield from robot.private
    yield from robot.shared
    for child in robot.children:
        yield from child.constraints


def _table(constraint: Constraint, name: str, units: CostUnits, domains: Mapping[str, Domain]) -> Exported:
    scope = constraint.variables
    size = math.prod(len(domains[one]) for one in scope)
    definition = constraint.definition
    if isinstance(definition, Relation) and constraint.parameters == scope:
        return Exported(scope, _listed(definition, name, units, size, [domains[one] for one in scope]))
    if size > MAX_TUPLES:
        what = f"the constraint {constraint.name} over {' '.join(scope)} has {size} combinations of values"
        raise UnsupportedError(f"{what}; a table has at most {MAX_TUPLES}")
    rows: dict[tuple[int, ...], Amount] = {}
    for values in itertools.product(*[domains[one] for one in scope]):
        cost = constraint.price(dict(zip(scope, values, strict=True)))
        rows[values] = _amount(cost, 0 if isinstance(definition, Function) else units.places)
    return Exported(scope, CostTable(name, rows, 0, size))


def _listed(relation: Relation, name: str, units: CostUnits, size: int, domains: list[Domain]) -> CostTable:
    """Return a relation's table; tuples with values that no variable has are left out."""
    default = {Semantics.SUPPORTS: INFINITE, Semantics.CONFLICTS: 0, Semantics.SOFT: relation.default_cost}
    known = [set(domain) for domain in domains]
    rows = {
        values: _amount(relation.cost(values), units.places)
        for values in relation.tuples
        if all(value in domain for value, domain in zip(values, known, strict=True))
    }
    return CostTable(name, rows, _amount(default[relation.semantics], units.places), size)


def _amount(cost: float, places: int) -> Amount:
    return INFINITE if cost == INFINITE else Fraction(int(cost), 10**places)
