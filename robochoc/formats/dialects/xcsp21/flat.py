"""A team without its links, as writers of other formats need it: whose variable, and who knows which constraint."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

from robochoc.formats.dialects.exported import (
    Exported,
    HeldConstraint,
    Tabulator,
    constant_of,
    held_constraints,
    maximises,
    too_large,
)
from robochoc.model.constraint import Domain, Function, Predicate
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.encoding import UnsupportedError

MAX_LISTED = 10_000
"""The maximum number of tuples of a predicate or function that is written as a relation although it need not be."""


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
        self.maximize = maximises(team)
        self.weighted = team.kind == ProblemKind.DISWCSP
        self.constant = constant_of(team)
        self.domains, self.domain_of = _domains(team)
        self.held = list(held_constraints(team))
        self._tabulator = Tabulator(team)

    def table(self, one: HeldConstraint, hint: str = "") -> Exported:
        """Return a constraint as a table.

        Raises:
            UnsupportedError: if it is too large for one; the message ends in `hint`.
        """
        table = self._tabulator.table(one)
        if table is None:
            raise UnsupportedError(f"{self.title}: {too_large(self.team, one.constraint)}{hint}")
        return table

    def small_table(self, one: HeldConstraint) -> Exported | None:
        """Return a constraint as a table. None: it is so large that a predicate or function should be kept."""
        return self._tabulator.table(one, most=MAX_LISTED)


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
