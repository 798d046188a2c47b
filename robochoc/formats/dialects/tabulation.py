"""Convert a team's constraints to tables of costs in the user's units, as required by other tools."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.definitions import MAX_TUPLES
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Domain,
    Function,
    Predicate,
    Relation,
)
from robochoc.model.problem import Robot, Team
from robochoc.solver.errors import UnsupportedError
from robochoc.system.lazy_dataclass import dataclass

CONSTANT = "constant"
"""The name of the constraint that contains the constant cost."""

LEAST_FORBIDDEN_COST = 10_000
"""The minimum cost of a forbidden tuple for tools without hard constraints: pyDCOP's convention."""


class OwnedConstraint(NamedTuple):
    """A constraint, the robot whose file contains it, and whether only this robot knows it."""

    constraint: Constraint
    robot: Robot
    private_part: bool


@dataclass(frozen=True)
class TabulatedConstraint:
    """A constraint as a table of costs.

    Attributes:
        name: The name of the constraint.
        scope: Its variables.
        table: The costs of their values. Constraints that differ only in variables have the same table object.
    """

    name: str
    scope: tuple[str, ...]
    table: ExactCostTable


def owned_constraints(team: Team) -> Iterator[OwnedConstraint]:
    """Yield the constraints of `team`. For a partially known constraint (PKC), each of its parts is yielded."""
    for robot in team.robots:
        for constraint in (*robot.private, *robot.shared):
            yield OwnedConstraint(constraint, robot, constraint.model == ConstraintModel.PKC)
        for child in robot.children:
            for constraint in child.constraints:
                yield OwnedConstraint(constraint, robot, private_part=True)


class Tabulator:
    """Tabulates the constraints of a team. Constraints that differ only in their variables are tabulated once."""

    def __init__(self, team: Team) -> None:
        self._domains = {name: variable.domain for name, variable in team.variables.items()}
        self._known: dict[object, ExactCostTable] = {}

    def table(self, one: OwnedConstraint, name: str = "", most: int = MAX_TUPLES) -> TabulatedConstraint | None:
        """Return a constraint as a table, or None if the table would have more than `most` tuples."""
        constraint = one.constraint
        scope, definition = constraint.variables, constraint.definition
        domains = [self._domains[variable] for variable in scope]
        size = math.prod(map(len, domains))
        if size > most and not isinstance(definition, Relation):
            return None
        pattern = tuple(scope.index(term) if isinstance(term, str) else (term,) for term in constraint.parameters)
        places = one.robot.costs.places
        same = id(definition) if isinstance(definition, Relation) else definition
        key = same, pattern, tuple(domain.ranges for domain in domains), constraint.cost, places
        if key not in self._known:
            if isinstance(definition, Relation):
                self._known[key] = _relation_table(definition, pattern, domains, places, size)
            else:
                self._known[key] = _evaluated_table(_price(definition, constraint.cost, places), pattern, domains, size)
        return TabulatedConstraint(name or constraint.name, scope, self._known[key])


def tabulate(team: Team) -> tuple[list[TabulatedConstraint], Fraction]:
    """Return the tables of all constraints, and the constant cost. The `team` must not be normalised.

    Raises:
        UnsupportedError: if a constraint is too large for a table.
    """
    tabulator = Tabulator(team)
    taken = {*team.variables, CONSTANT}  # in pyDCOP, variables and constraints share one set of names
    found = []
    for one in owned_constraints(team):
        table = tabulator.table(one, unique_name(one.constraint.name, taken))
        if table is None:
            raise UnsupportedError(too_large_message(team, one.constraint))
        found.append(table)
    return found, constant_cost(team)


def unique_name(name: str, taken: set[str]) -> str:
    """Return `name`, with a number appended if it is in `taken`, and add the result to `taken`."""
    free, number = name, 1
    while free in taken:
        number += 1
        free = f"{name}_{number}"
    taken.add(free)
    return free


def constant_cost(team: Team) -> Fraction:
    """Return the constant cost of a team, which must not be normalised."""
    return sum((Fraction(one.costs.constant, 10**one.costs.places) for one in team.robots), Fraction(0))


def constant_table(team: Team, constant: Fraction) -> TabulatedConstraint:
    """Return a constraint on the first variable in which every value has the constant cost."""
    variable = next(iter(team.variables.values()))
    return TabulatedConstraint(CONSTANT, (variable.name,), ExactCostTable(CONSTANT, {}, constant, len(variable.domain)))


def too_large_message(team: Team, constraint: Constraint) -> str:
    """Return the error message for a constraint that is too large for a table."""
    size = math.prod(len(team.variables[name].domain) for name in constraint.variables)
    what = f"the constraint {constraint.name} over {' '.join(constraint.variables)} has {size:,} combinations of values"
    return f"{what}; a table has at most {MAX_TUPLES:,}"


def is_maximised(team: Team) -> bool:
    """Return whether the costs of `team` are maximised."""
    return any(robot.costs.maximize for robot in team.robots)


def finite_cost_bound(tables: Sequence[TabulatedConstraint], constant: Fraction) -> int:
    """Return an integer that is greater than the absolute value of every sum of finite costs."""
    distinct = {id(one.table): one.table for one in tables}
    most = {
        key: max((abs(Fraction(cost)) for cost in table.amounts() if cost != INFINITE), default=Fraction(0))
        for key, table in distinct.items()
    }
    return math.floor(sum((most[id(one.table)] for one in tables), abs(constant))) + 1


def forbidden_cost(tables: Sequence[TabulatedConstraint], constant: Fraction) -> int:
    """Return the cost of a forbidden tuple for tools without hard constraints: it exceeds every sum of finite costs."""
    return max(LEAST_FORBIDDEN_COST, 10 * finite_cost_bound(tables, constant))


def amounts(tables: Sequence[TabulatedConstraint]) -> set[Amount]:
    """Return the different costs in `tables`."""
    return set().union(*(table.amounts() for table in {id(one.table): one.table for one in tables}.values()))


def decimal(amount: Amount, places: int | None = None) -> str:
    """Return a finite cost as a decimal without an exponent, with `places` decimal places if specified."""
    if isinstance(amount, int) and not places:
        return str(amount)
    exact = Fraction(amount)
    width = places or 0
    while places is None and (exact * 10**width).denominator != 1:
        width += 1
    digits = str(abs(round(exact * 10**width))).rjust(width + 1, "0")
    sign = "-" if exact < 0 else ""
    return f"{sign}{digits[:-width]}.{digits[-width:]}" if width else f"{sign}{digits}"


_Pattern = tuple[int | tuple[int], ...]
"""The terms of a scope: the index of a variable among the distinct variables, or a constant in a tuple of one."""


def _price(definition: Predicate | Function, cost: float, places: int) -> Callable[[Sequence[int]], Amount]:
    if isinstance(definition, Function):
        return lambda values: _amount(definition.cost(values), definition.places)
    broken = _amount(cost, places)
    return lambda values: 0 if definition.holds(values) else broken


def _evaluated_table(
    price: Callable[[Sequence[int]], Amount], pattern: _Pattern, domains: Sequence[Domain], size: int
) -> ExactCostTable:
    """Return the table of a predicate or function. Its most frequent cost is the default."""
    costs = {
        values: price([values[term] if isinstance(term, int) else term[0] for term in pattern])
        for values in itertools.product(*domains)
    }
    ((default, _),) = Counter(costs.values()).most_common(1)
    return ExactCostTable("", {values: cost for values, cost in costs.items() if cost != default}, default, size)


def _relation_table(
    relation: Relation, pattern: _Pattern, domains: Sequence[Domain], places: int, size: int
) -> ExactCostTable:
    """Return the table of a relation over its distinct variables, without tuples with values outside the domains."""
    listed, other = relation.prices
    known = [frozenset(domain) for domain in domains]
    rows: dict[tuple[int, ...], Amount] = {}
    for values, cost in listed.items():
        if cost == other:
            continue
        found: dict[int, int] = {}
        for term, value in zip(pattern, values, strict=True):
            if (found.setdefault(term, value) if isinstance(term, int) else term[0]) != value:
                break
        else:
            row = tuple(found[place] for place in range(len(domains)))
            if all(value in domain for value, domain in zip(row, known, strict=True)):
                rows[row] = _amount(cost, places)
    return ExactCostTable("", rows, _amount(other, places), size)


def _amount(cost: float, places: int) -> Amount:
    if cost == INFINITE:
        return INFINITE
    return Fraction(int(cost), 10**places) if places else int(cost)
