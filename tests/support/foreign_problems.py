"""Problems with costs that people have, as plain tables, and as teams; and their optima in fractions."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.formats import InvalidInputError, check_team
from robochoc.formats.dialects.dialect import ExportOptions, ImportOptions, ImportResult
from robochoc.formats.dialects.registry import find_dialect, read_foreign
from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Predicate, Relation, Semantics, Variable
from robochoc.model.cost_units import CostUnits, common_units
from robochoc.model.expression import Type, parse
from robochoc.model.problem import ProblemKind, Team

Table = Mapping[tuple[int, ...], Fraction | None]
"""The cost of each tuple; None: it is forbidden."""


@dataclass
class Tables:
    """A problem, independent of what robochoc makes of it: domains, and tables over their values."""

    maximize: bool
    domains: dict[str, list[int]]
    factors: list[tuple[tuple[str, ...], Table]] = field(default_factory=list)
    constant: Fraction = Fraction(0)

    def optimum(self) -> Fraction | None:
        """The best sum, by trying everything; None: everything is forbidden."""
        names = [*self.domains]
        best = None
        for values in itertools.product(*self.domains.values()):
            chosen = dict(zip(names, values, strict=True))
            costs = [table[tuple(chosen[name] for name in scope)] for scope, table in self.factors]
            known = [cost for cost in costs if cost is not None]
            if len(known) == len(costs):
                total = sum(known, self.constant)
                best = total if best is None else (max if self.maximize else min)(best, total)
        return best


def optimum(team: Team) -> Fraction | None:
    """The best sum of a team that is not normalised, in its user's numbers, by trying everything."""
    units = common_units(robot.costs for robot in team.robots)
    names = [*team.variables]
    held = [(robot, one) for robot in team.robots for one in (*robot.private, *robot.shared)]
    held += [(robot, one) for robot in team.robots for child in robot.children for one in child.constraints]
    best = None
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        chosen = dict(zip(names, values, strict=True))
        total = Fraction(units.constant, 10**units.places)
        for robot, constraint in held:
            price = constraint.price(chosen)
            if price == INFINITE:
                break
            whole = isinstance(constraint.definition, Function)
            total += Fraction(int(price), 1 if whole else 10**robot.costs.places)
        else:
            best = total if best is None else (max if units.maximize else min)(best, total)
    return best


def imported(text: str, folder: Path, name: str = "problem.xml", **options: Any) -> ImportResult:  # noqa: ANN401
    """What is imported of a file with this text."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_foreign([path], ImportOptions(**options))


def refused(text: str, folder: Path, name: str = "problem.xml", **options: Any) -> str:  # noqa: ANN401
    """Return the one message about a file with this text, from its line on."""
    with pytest.raises(InvalidInputError) as refusal:
        check_team(imported(text, folder, name, **options).team)
    assert len(refusal.value.diagnostics) == 1, refusal.value
    return str(refusal.value).partition(name)[2]


def written(name: str, team: Team, *, intension: bool = False) -> Mapping[str, bytes]:
    """The files of `team` in the format `name`."""
    dialect = find_dialect(name)
    assert dialect
    assert dialect.write
    return dialect.write(team, ExportOptions(intension=intension)).files


_FORMULAS: Sequence[tuple[str, Callable[..., int]]] = (
    ("abs(sub(X,Y))", lambda x, y: abs(x - y)),
    ("add(mul(2,X),neg(Y))", lambda x, y: 2 * x - y),
    ("if(eq(X,Y),7,sub(X,3))", lambda x, y: 7 if x == y else x - 3),
    ("max(X,Y,2)", lambda x, y: max(x, y, 2)),
    ("mul(dist(X,Y),min(X,Y))", lambda x, y: abs(x - y) * min(x, y)),
)
_TESTS: Sequence[tuple[str, Callable[..., bool]]] = (
    ("ne(X,Y)", lambda x, y: x != y),
    ("or(lt(X,Y),gt(add(X,Y),3))", lambda x, y: x < y or x + y > 3),
    ("not(and(eq(X,1),eq(Y,1)))", lambda x, y: not (x == y == 1)),
    ("iff(le(X,1),ge(Y,1))", lambda x, y: (x <= 1) == (y >= 1)),
)


def random_problem(
    chance: Random, *, plain: bool = False, parts: bool = True, simple: bool = False
) -> tuple[Tables, Team]:
    """A problem of 2 to 4 robots, as tables and as a team.

    `plain`: costs are integers of 0 or more that are minimised. `parts`: some constraints are partially known.
    `simple`: each robot has one variable, and each constraint at most two.
    """
    places = 0 if plain else chance.choice((0, 0, 1, 3))
    maximize = not plain and chance.random() < 0.5
    sizes = [1 if simple else chance.choice((1, 1, 2)) for _ in range(chance.randint(2, 4))]
    owned = {f"a{robot}": [f"v{robot}.{place}" for place in range(size)] for robot, size in enumerate(sizes)}
    names = [name for own in owned.values() for name in own]
    values = {name: _random_values(chance) for name in names}
    constant = 0 if chance.random() < 0.5 else chance.randint(0 if plain else -50, 50)
    problem = Tables(maximize, values, constant=Fraction(constant, 10**places))
    owner = {name: robot for robot, own in owned.items() for name in own}
    constraints: list[Constraint] = []
    held: dict[str, list[Constraint]] = {}
    for number in range(chance.randint(2, 6)):
        scope = tuple(chance.sample(names, min(len(names), chance.choice((1, 2, 2, 2, 2 if simple else 3)))))
        table, constraint = _random_constraint(chance, f"c{number}", scope, values, places, plain=plain)
        problem.factors.append((scope, table))
        if parts and len(scope) == 2 and owner[scope[0]] != owner[scope[1]] and chance.random() < 0.3:
            held.setdefault(owner[scope[0]], []).append(constraint)
            anything = Relation("anything", 2, Semantics.CONFLICTS, ())
            held.setdefault(owner[scope[1]], []).append(Constraint(constraint.name, anything, scope, scope))
        else:
            constraints.append(constraint)
    variables = {
        robot: [Variable(name, Domain(f"d{name}", _ranges(values[name]))) for name in own]
        for robot, own in owned.items()
    }
    units = CostUnits(maximize, places, constant)
    team = assemble("random", variables, constraints, kind=ProblemKind.DISWCSP, costs=units, extras=Extras(parts=held))
    return problem, team


def _random_values(chance: Random) -> list[int]:
    size = chance.choice((1, 2, 2, 2, 3, 3, 3))
    first = chance.randint(-2, 2)
    return [*range(first, first + size)] if chance.random() < 0.5 else sorted(chance.sample(range(-2, 5), size))


def _ranges(values: Sequence[int]) -> tuple[range, ...]:
    """The ranges of ascending values, neighbouring values in one."""
    starts = [value for value in values if value - 1 not in values]
    ends = [value + 1 for value in values if value + 1 not in values]
    return tuple(map(range, starts, ends))


def _random_constraint(
    chance: Random, name: str, scope: tuple[str, ...], values: Mapping[str, Sequence[int]], places: int, *, plain: bool
) -> tuple[Table, Constraint]:
    rows = list(itertools.product(*(values[one] for one in scope)))
    if len(scope) == 2 and chance.random() < 0.5:
        formals = ("X", "Y")
        if chance.random() < 0.4 and not plain:
            text, meaning = chance.choice(_FORMULAS)
            function = Function(f"f{name}", formals, parse(text, formals, Type.INTEGER))
            return {row: Fraction(meaning(*row)) for row in rows}, Constraint(name, function, scope, scope)
        text, test = chance.choice(_TESTS)
        cost: float = INFINITE if chance.random() < 0.4 else chance.randint(1 if plain else -9, 9)
        broken = None if cost == INFINITE else Fraction(int(cost), 10**places)
        predicate = Predicate(f"p{name}", formals, parse(text, formals, Type.BOOLEAN))
        told = {row: Fraction(0) if test(*row) else broken for row in rows}
        return told, Constraint(name, predicate, scope, scope, cost=cost)
    listed = [row for row in rows if chance.random() < 0.7]
    if chance.random() < 0.2:
        semantics = chance.choice((Semantics.SUPPORTS, Semantics.CONFLICTS))
        good = semantics is Semantics.SUPPORTS
        relation = Relation(f"r{name}", len(scope), semantics, tuple(listed))
        return {row: Fraction(0) if (row in listed) is good else None for row in rows}, Constraint(
            name, relation, scope, scope
        )
    costs = [INFINITE if chance.random() < 0.15 else chance.randint(0 if plain else -99, 99) for _ in rows]
    default: float = INFINITE if chance.random() < 0.2 else chance.randint(0 if plain else -99, 99)
    chosen = {row: cost for row, cost in zip(rows, costs, strict=True) if row in listed}
    relation = Relation(f"r{name}", len(scope), Semantics.SOFT, tuple(chosen), tuple(chosen.values()), default)
    paid = {row: chosen.get(row, default) for row in rows}
    exact = {row: None if cost == INFINITE else Fraction(int(cost), 10**places) for row, cost in paid.items()}
    return exact, Constraint(name, relation, scope, scope)
