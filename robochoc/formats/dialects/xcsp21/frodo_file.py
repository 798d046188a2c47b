"""Writes a team as one file of FRODO's XCSP 2.1."""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal

from lxml import etree

from robochoc.formats.dialects.xcsp21.document import Document, number
from robochoc.formats.dialects.xcsp21.flat import MAX_LISTED, FlatTeam, Held, Rows, plain
from robochoc.formats.global_constraints import PREFIX, write_global
from robochoc.model.constraint import INFINITE, Function, GlobalPredicate, Predicate, Relation
from robochoc.model.expression import Apply, Constant
from robochoc.model.problem import Team
from robochoc.solver.encoding import UnsupportedError

FORMAT = "XCSP 2.1_FRODO"

_TERM = r"(?:X\d+|-?\d+)"
_FORMS = {
    "allDifferent": re.compile(rf"\[ (?:{_TERM} )+\]"),
    "weightedSum": re.compile(rf"\[ (?:{{ -?\d+ {_TERM} }} )+\] <[a-z]+/> -?\d+"),
    "element": re.compile(rf"X\d+ \[ (?:{_TERM} )+\] {_TERM}"),
    "cumulative": re.compile(rf"\[ (?:{{ {_TERM} {_TERM} {_TERM} }} )+\] <le/> {_TERM}"),
}
"""How FRODO reads the parameters of each."""


def frodo_file(team: Team) -> Mapping[str, bytes]:
    """Return the file. What a robot alone knows of a constraint (PKC) becomes a constraint of its agent alone.

    Raises:
        UnsupportedError: if the team has what FRODO has not.
    """
    return {f"{team.name}.xml": _Writer(FlatTeam(team, "FRODO's XCSP 2.1")).content()}


class _Writer:
    def __init__(self, flat: FlatTeam) -> None:
        self._flat = flat
        arity = max((len(one.constraint.variables) for one in flat.held), default=1)
        self._forbidden = "-infinity" if flat.units.maximize else "infinity"
        presentation = {
            "name": flat.team.name,
            "maxConstraintArity": str(arity),
            "maximize": "true" if flat.units.maximize else "false",
            "format": FORMAT,
        }
        self._document = Document(flat, presentation)

    def content(self) -> bytes:
        flat, document = self._flat, self._document
        for robot in flat.team.robots:
            etree.SubElement(document.agents, "agent", name=robot.name)
            for variable in robot.variables:
                domain = flat.domain_of[variable.name]
                etree.SubElement(document.variables, "variable", name=variable.name, domain=domain, agent=robot.name)
        for one in flat.held:
            self._add(one)
        if flat.units.constant:
            first = next(iter(flat.team.variables))
            whole = Decimal(flat.units.constant).scaleb(-flat.units.places)
            self._listed("constant", Rows((first,), {}, whole), {})
        return document.content()

    def _add(self, one: Held) -> None:
        known_to = {"agent": one.robot.name} if one.private_part else {}
        definition = one.constraint.definition
        if isinstance(definition, GlobalPredicate) and self._as_global(one, definition, known_to):
            return
        if isinstance(definition, Relation) or not self._in_intension(one, known_to):
            rows = self._flat.rows(one)
            if rows is None:
                what = f"{one.constraint.name} is too large for a relation, and {definition.name} has no counterpart"
                raise UnsupportedError(f"{self._flat.title}: {what}")
            self._listed(one.constraint.name, rows, known_to)

    def _as_global(self, one: Held, predicate: GlobalPredicate, known_to: Mapping[str, str]) -> bool:
        """Write a global constraint that FRODO has in this form; return whether it was done."""
        if one.constraint.cost != INFINITE or not _FORMS[predicate.name.removeprefix(PREFIX)].fullmatch(predicate.form):
            return False
        scope = one.constraint.variables
        element = self._document.constraint(one.constraint.name, scope, predicate.name, **known_to)
        write_global(etree.SubElement(element, "parameters"), predicate, one.constraint.parameters)
        return True

    def _in_intension(self, one: Held, known_to: Mapping[str, str]) -> bool:
        """Write a predicate or function as such; return whether it was done."""
        definition = one.constraint.definition
        if isinstance(definition, Relation):
            return False
        body = plain(definition.body)
        if body is None:
            return False
        if isinstance(definition, Predicate) and one.constraint.cost != INFINITE:
            cost = self._flat.cost(one.robot, one.constraint.cost)
            if self._flat.rows(one, MAX_LISTED) is not None or cost != int(cost):
                return False
            body = Apply("if", (body, Constant(0), Constant(int(cost))))
            definition = Function(definition.name, definition.parameters, body)
        reference = self._document.formula(definition, body)
        element = self._document.constraint(one.constraint.name, one.constraint.variables, reference, **known_to)
        etree.SubElement(element, "parameters").text = " ".join(map(str, one.constraint.parameters))
        return True

    def _listed(self, name: str, rows: Rows, known_to: Mapping[str, str]) -> None:
        """Write a soft relation, the only kind that all of FRODO reads."""
        by_cost: dict[Decimal | float, list[str]] = {}
        for values, cost in rows.costs.items():
            by_cost.setdefault(cost, []).append(" ".join(map(str, values)))
        tuples = " | ".join(f"{self._number(cost)}: {' | '.join(listed)}" for cost, listed in by_cost.items())
        attributes = {"semantics": "soft", "defaultCost": self._number(rows.default)}
        reference = self._document.relation(rows, attributes, tuples)
        self._document.constraint(name, rows.variables, reference, **known_to)

    def _number(self, cost: Decimal | float) -> str:
        return number(cost, forbidden=self._forbidden)
