"""A team without its links, as writers of other formats need it: whose variable, and who knows which constraint."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import NamedTuple

from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Domain,
    Function,
    Predicate,
    Relation,
    Semantics,
)
from robochoc.model.cost_units import common_units
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import ProblemKind, Robot, Team
from robochoc.solver.encoding import UnsupportedError

MAX_LISTED = 10_000
"""The maximum number of tuples of a predicate or function that is written as a relation although it need not be."""
MAX_TABULATED = 1_000_000
"""The maximum number of tuples of one that must be."""


class Held(NamedTuple):
    """A constraint, the robot in whose file it stands, and whether that robot alone knows it."""

    constraint: Constraint
    robot: Robot
    private_part: bool


class Rows(NamedTuple):
    """A relation over distinct variables: costs in the user's numbers."""

    variables: tuple[str, ...]
    costs: Mapping[tuple[int, ...], Decimal | float]
    default: Decimal | float


class FlatTeam:
    """A team, seen as one problem.

    Raises:
        UnsupportedError: if it changes over time.
    """

    def __init__(self, team: Team, title: str) -> None:
        if team.dynamic:
            raise UnsupportedError(f"{title} has no problems that change over time: leave scenario.xml out")
        self.team = team
        self.title = title
        self.units = common_units(robot.costs for robot in team.robots)
        self.weighted = team.kind == ProblemKind.DISWCSP
        self.domains, self.domain_of = _domains(team)
        self.held = list(_held(team))

    def cost(self, robot: Robot, cost: float) -> Decimal | float:
        """Return a cost of `robot` in the user's numbers."""
        return INFINITE if cost == INFINITE else Decimal(int(cost)).scaleb(-robot.costs.places)

    def rows(self, one: Held, most: int = MAX_TABULATED) -> Rows | None:
        """Return a constraint as a relation over distinct variables. None: it would have more than `most` tuples."""
        if isinstance(one.constraint.definition, Relation):
            return self._projected(one, one.constraint.definition)
        variables = one.constraint.variables
        domains = [self.team.variables[name].domain for name in variables]
        if math.prod(map(len, domains)) > most:
            return None
        costs = {}
        for values in itertools.product(*domains):
            price = one.constraint.price(dict(zip(variables, values, strict=True)))
            whole = isinstance(one.constraint.definition, Function) and price != INFINITE
            costs[values] = Decimal(int(price)) if whole else self.cost(one.robot, price)
        return Rows(variables, costs, INFINITE)

    def _projected(self, one: Held, relation: Relation) -> Rows:
        terms = one.constraint.parameters
        variables = tuple(dict.fromkeys(term for term in terms if isinstance(term, str)))
        soft = relation.semantics == Semantics.SOFT
        listed = relation.costs or [0 if relation.semantics == Semantics.SUPPORTS else INFINITE] * len(relation.tuples)
        costs = {}
        for values, cost in zip(relation.tuples, listed, strict=True):
            found: dict[str, int] = {}
            for term, value in zip(terms, values, strict=True):
                if (found.setdefault(term, value) if isinstance(term, str) else term) != value:
                    break
            else:
                costs[tuple(found[name] for name in variables)] = self.cost(one.robot, cost)
        other = relation.default_cost if soft else INFINITE if relation.semantics == Semantics.SUPPORTS else 0
        return Rows(variables, costs, self.cost(one.robot, other))


def _held(team: Team) -> Iterator[Held]:
    for robot in team.robots:
        for constraint in (*robot.private, *robot.shared):
            yield Held(constraint, robot, constraint.model == ConstraintModel.PKC)
        for child in robot.children:
            for constraint in child.constraints:
                yield Held(constraint, robot, private_part=True)


def _domains(team: Team) -> tuple[dict[str, Domain], dict[str, str]]:
    """Return domains by names that are unique in the team, and the name of each variable's."""
    known: dict[str, Domain] = {}
    name_of = {}
    for variable in team.variables.values():
        name, number = variable.domain.name, 1
        while known.setdefault(name, variable.domain).ranges != variable.domain.ranges:
            number += 1
            name = f"{variable.domain.name}_{number}"
        name_of[variable.name] = name
    return known, name_of


def plain(expression: Expression) -> Expression | None:
    """Return `expression` by XCSP 2.1's operators alone, each with the arguments that it has there.

    None: an operator has no counterpart.
    """
    if not isinstance(expression, Apply):
        return expression
    found = [plain(one) for one in expression.arguments]
    arguments = tuple(one for one in found if one is not None)
    if len(arguments) < len(found):
        return None
    rule = _RULES.get(expression.operator)
    return rule(expression.operator, arguments) if rule else None


def _folded(operator: str, arguments: Sequence[Expression]) -> Expression:
    """Return the arguments, two by two: a balanced tree, which is as flat as can be."""
    if len(arguments) == 1:
        return arguments[0]
    half = len(arguments) // 2
    return Apply(operator, (_folded(operator, arguments[:half]), _folded(operator, arguments[half:])))


def _all_same(operator: str, arguments: Sequence[Expression]) -> Expression:
    return _folded("and", [Apply(operator, pair) for pair in itertools.pairwise(arguments)])


_RULES: dict[str, Callable[[str, tuple[Expression, ...]], Expression]] = {
    **dict.fromkeys(("neg", "abs", "sub", "div", "mod", "pow", "not", "if", "ne", "gt", "ge", "lt", "le"), Apply),
    **dict.fromkeys(("add", "mul", "min", "max", "and", "or", "xor"), _folded),
    **dict.fromkeys(("eq", "iff"), _all_same),
    "dist": lambda _, two: Apply("abs", (Apply("sub", two),)),
    "imp": lambda _, two: Apply("or", (Apply("not", two[:1]), two[1])),
    "sqr": lambda _, one: Apply("mul", one * 2),
}
"""XCSP 2.1's forms of operators."""


def with_formals(definition: Predicate | Function, body: Expression) -> tuple[tuple[str, ...], Expression]:
    """Return the formal parameters of `definition` as X0, X1, ..., and `body` with them."""
    named = {name: f"X{place}" for place, name in enumerate(definition.parameters)}

    def renamed(expression: Expression) -> Expression:
        match expression:
            case Name(name):
                return Name(named[name])
            case Apply(operator, arguments):
                return Apply(operator, tuple(map(renamed, arguments)))
            case Constant():
                return expression

    return tuple(named.values()), renamed(body)
