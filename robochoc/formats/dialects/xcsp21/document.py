"""Write XCSP 2.1: a team as one problem, its expressions in XCSP 2.1's operators, and the common XML elements."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence

from lxml import etree

from robochoc.formats.dialects.exact_costs import Amount
from robochoc.formats.dialects.tabulation import (
    OwnedConstraint,
    TabulatedConstraint,
    Tabulator,
    constant_cost,
    decimal,
    is_maximised,
    owned_constraints,
    too_large_message,
    unique_name,
)
from robochoc.model.constraint import INFINITE, Domain, Function, Predicate
from robochoc.model.expression import Apply, Constant, Expression, Name, text
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.errors import UnsupportedError

MAX_LISTED = 10_000
"""The maximum number of tuples of a predicate that is written as a relation although it could be a function."""


class FlatTeam:
    """A team as one problem, without the links between robots' files.

    Raises:
        UnsupportedError: if the team changes over time.
    """

    def __init__(self, team: Team, title: str) -> None:
        if team.dynamic:
            raise UnsupportedError(f"{title} does not support problems that change over time: remove scenario.xml")
        self.team = team
        self.title = title
        self.maximize = is_maximised(team)
        self.is_weighted = team.kind == ProblemKind.DISWCSP
        self.constant = constant_cost(team)
        self.domains, self.domain_of = _domains(team)
        self.owned = list(owned_constraints(team))
        self._tabulator = Tabulator(team)

    def table(self, one: OwnedConstraint, hint: str = "") -> TabulatedConstraint:
        """Return a constraint as a table.

        Raises:
            UnsupportedError: if the constraint is too large for a table; the message ends in `hint`.
        """
        table = self._tabulator.table(one)
        if table is None:
            raise UnsupportedError(f"{self.title}: {too_large_message(self.team, one.constraint)}{hint}")
        return table

    def small_table(self, one: OwnedConstraint) -> TabulatedConstraint | None:
        """Return a constraint as a table. None: it would have more than `MAX_LISTED` tuples."""
        return self._tabulator.table(one, most=MAX_LISTED)


def _domains(team: Team) -> tuple[dict[str, Domain], dict[str, str]]:
    """Return the domains by names that are unique in the team, and the name of each variable's domain."""
    known: dict[str, Domain] = {}
    name_of = {}
    for variable in team.variables.values():
        name, number = variable.domain.name, 1
        while known.setdefault(name, variable.domain).ranges != variable.domain.ranges:
            number += 1
            name = f"{variable.domain.name}_{number}"
        name_of[variable.name] = name
    return known, name_of


def in_xcsp21_operators(expression: Expression) -> Expression | None:
    """Return `expression` in XCSP 2.1's operators, each with its number of arguments there.

    Returns:
        The expression. None: an operator has no counterpart.
    """
    if not isinstance(expression, Apply):
        return expression
    found = [in_xcsp21_operators(one) for one in expression.arguments]
    arguments = tuple(one for one in found if one is not None)
    if len(arguments) < len(found):
        return None
    rule = _RULES.get(expression.operator)
    return rule(expression.operator, arguments) if rule else None


def _folded(operator: str, arguments: Sequence[Expression]) -> Expression:
    """Return the arguments as a balanced binary tree, which has the least depth."""
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
"""The translation of each operator to XCSP 2.1's operators."""


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


class Document:
    """An XML document under construction. Equal relations, predicates and functions are written once.

    Args:
        team: The team.
        presentation: The attributes of `presentation`.
    """

    def __init__(self, team: FlatTeam, presentation: Mapping[str, str]) -> None:
        self._team = team
        self.root = etree.Element("instance")
        stated = {name: value for name, value in presentation.items() if value}
        self.presentation = etree.SubElement(self.root, "presentation", stated)
        self.agents = self._section("agents")
        self._domains()
        self.variables = self._section("variables")
        self._definitions = {kind: self._section(f"{kind}s") for kind in ("relation", "predicate", "function")}
        self.constraints = self._section("constraints")
        self._known: dict[object, str] = {}
        self._names: set[str] = set()

    def content(self) -> bytes:
        """Return the document, with the number of elements of each section."""
        for section in list(self.root):
            if section.tag == "presentation":
                continue
            if not len(section) and section.tag in {"relations", "predicates", "functions"}:
                self.root.remove(section)
            else:
                number_of = sum(1 for _ in section.iterchildren(tag=etree.Element))
                section.set(f"nb{str(section.tag).capitalize()}", str(number_of))
        body = etree.tostring(self.root, pretty_print=True, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()

    def relation(self, table: TabulatedConstraint, attributes: Mapping[str, str], tuples: str) -> str:
        """Return the name of a relation with these tuples; add it if it is new."""
        key = "relation", tuple(attributes.items()), tuples, len(table.scope)
        if key not in self._known:
            sizes = {"arity": str(len(table.scope)), "nbTuples": str(len(table.table.rows))}
            element = self._new("relation", key, {**sizes, **attributes})
            element.text = tuples
        return self._known[key]

    def formula(self, definition: Predicate | Function, body: Expression) -> str:
        """Return the name of a predicate or function with this body; add it if it is new."""
        formals, renamed = with_formals(definition, body)
        kind = "function" if isinstance(definition, Function) else "predicate"
        key = kind, formals, renamed
        if key not in self._known:
            element = self._new(kind, key, {"return": "int"} if kind == "function" else {})
            etree.SubElement(element, "parameters").text = " ".join(f"int {name}" for name in formals)
            etree.SubElement(etree.SubElement(element, "expression"), "functional").text = text(renamed)
        return self._known[key]

    def constraint(self, name: str, scope: Iterable[str], reference: str, **others: str) -> etree._Element:
        """Add a constraint. Its name is made unique."""
        variables = tuple(scope)
        stated = {
            "name": unique_name(name, self._names),
            "arity": str(len(variables)),
            "scope": " ".join(variables),
            "reference": reference,
        }
        return etree.SubElement(self.constraints, "constraint", {**stated, **others})

    def _new(self, kind: str, key: object, attributes: Mapping[str, str]) -> etree._Element:
        section = self._definitions[kind]
        self._known[key] = f"{kind[0].upper()}{len(section)}"
        return etree.SubElement(section, kind, {"name": self._known[key], **attributes})

    def _section(self, tag: str) -> etree._Element:
        return etree.SubElement(self.root, tag)

    def _domains(self) -> None:
        section = self._section("domains")
        for name, domain in self._team.domains.items():
            if domain.symbols:
                labels = ", ".join(f"{value} is {domain.label(value)}" for value in domain)
                section.append(etree.Comment(f" {name}: {labels} ".replace("--", "- -")))
            element = etree.SubElement(section, "domain", name=name, nbValues=str(len(domain)))
            element.text = " ".join(map(_range, domain.ranges))


def _range(part: range) -> str:
    return f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0])


def cost_text(cost: Amount, *, forbidden: str = "infinity") -> str:
    """Return a cost as text."""
    return forbidden if cost == INFINITE else decimal(cost)
