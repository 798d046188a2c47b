"""Writes a team as one file of FRODO's XCSP 2.1.

As it is shipped, FRODO ignores constraints in intension (only its JaCoP parser reads them) and has costs of 32 bits.
So constraints become relations, and decimal costs integers of a smaller unit, which the file names. FRODO's default
parser ignores the `agent` of a constraint, or charges only that agent, so the attribute is not written.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

from lxml import etree

from robochoc.formats.dialects.dialect import ExportOptions, Note, Written
from robochoc.formats.dialects.exported import Exported, HeldConstraint, amounts, constant_table, decimal, magnitude
from robochoc.formats.dialects.tables import Amount, Scale
from robochoc.formats.dialects.xcsp21.document import Document, cost_text
from robochoc.formats.dialects.xcsp21.flat import FlatTeam, plain
from robochoc.formats.dialects.xcsp21.instance import UNIT
from robochoc.formats.global_constraints import PREFIX, write_global
from robochoc.model.constraint import INFINITE, Function, GlobalPredicate, Predicate, Relation
from robochoc.model.expression import Apply, Constant, Expression
from robochoc.model.problem import Team
from robochoc.solver.encoding import UnsupportedError
from robochoc.system.plain_text import counted

FORMAT = "XCSP 2.1_FRODO"
TITLE = "FRODO's XCSP 2.1"
KEEPS_FORMULAS = "--intension keeps predicates and functions, for FRODO's JaCoP parser"
LIMIT = 2**31 - 1
"""The integer that counts as infinity in FRODO's 32 bits."""

_TERM = r"(?:X\d+|-?\d+)"
_FORMS = {
    "allDifferent": re.compile(rf"\[ (?:{_TERM} )+\]"),
    "weightedSum": re.compile(rf"\[ (?:{{ -?\d+ {_TERM} }} )+\] <[a-z]+/> -?\d+"),
    "element": re.compile(rf"X\d+ \[ (?:{_TERM} )+\] {_TERM}"),
    "cumulative": re.compile(rf"\[ (?:{{ {_TERM} {_TERM} {_TERM} }} )+\] <le/> {_TERM}"),
}
"""How FRODO reads the parameters of each."""


def frodo_file(team: Team, options: ExportOptions) -> Written:
    """Return the file, in which all agents of a constraint's variables know it.

    Raises:
        UnsupportedError: if the team has what FRODO has not.
    """
    writer = _Writer(FlatTeam(team, TITLE), intension=options.intension)
    return Written({f"{team.name}.xml": writer.content()}, tuple(writer.notes()))


class _Writer:
    def __init__(self, flat: FlatTeam, *, intension: bool) -> None:
        self._flat = flat
        hint = "" if intension else f" ({KEEPS_FORMULAS})"
        self._contents = [(intension and self._in_intension(one)) or flat.table(one, hint) for one in flat.held]
        tables = [content for content in self._contents if isinstance(content, Exported)]
        if flat.constant:
            tables.append(constant_table(flat.team, flat.constant))
        self._places = Scale(amounts(tables)).places
        self._check_sizes(magnitude(tables, Fraction(0)) * 10**self._places)
        self._forbidden = "-infinity" if flat.maximize else "infinity"
        presentation = {
            "name": flat.team.name,
            "maxConstraintArity": str(max((len(one.constraint.variables) for one in flat.held), default=1)),
            "maximize": "true" if flat.maximize else "false",
            "format": FORMAT,
        }
        self._document = Document(flat, presentation)
        self._references: dict[int, str] = {}

    def content(self) -> bytes:
        flat, document = self._flat, self._document
        if self._places:
            etree.SubElement(document.presentation, "stats", name=UNIT).text = self._unit
        for robot in flat.team.robots:
            etree.SubElement(document.agents, "agent", name=robot.name)
            for variable in robot.variables:
                domain = flat.domain_of[variable.name]
                etree.SubElement(document.variables, "variable", name=variable.name, domain=domain, agent=robot.name)
        for one, content in zip(flat.held, self._contents, strict=True):
            if isinstance(content, Exported):
                self._add(content)
            else:
                self._add_formula(one, content)
        if flat.constant:
            self._add(constant_table(flat.team, flat.constant))
        return document.content()

    def notes(self) -> Iterator[Note]:
        """Yield the differences from the team."""
        if self._places:
            yield Note("scale", f"costs are integers, in units of {self._unit}: FRODO's costs are integers of 32 bits")
        if any(one.private_part for one in self._flat.held):
            text = "all agents of a constraint know it: FRODO cannot keep partially known (PKC) constraints apart"
            yield Note("known to more", text)
        if kept := sum(not isinstance(content, Exported) for content in self._contents):
            text = f"{counted(kept, 'constraint')} in intension, which only FRODO's JaCoP parser reads"
            yield Note("intension", text)

    @property
    def _unit(self) -> str:
        return decimal(Fraction(1, 10**self._places))

    def _check_sizes(self, most: int) -> None:
        if most >= LIMIT:
            unit = f" in units of {self._unit}" if self._places else ""
            what = f"costs may add up to {most:,}{unit}"
            raise UnsupportedError(f"{TITLE}: {what}, but FRODO's integers end at {LIMIT:,}: use smaller costs")
        for name, variable in self._flat.team.variables.items():
            far = max(variable.domain, key=abs)
            if abs(far) >= LIMIT:
                what = f"the value {far:,} of {name} is beyond FRODO's integers, which end at {LIMIT:,}"
                raise UnsupportedError(f"{TITLE}: {what}")

    def _in_intension(self, one: HeldConstraint) -> Predicate | Function | None:
        """Return the definition of a constraint by FRODO's operators. None: it should be a relation."""
        definition, cost = one.constraint.definition, one.constraint.cost
        if isinstance(definition, Relation):
            return None
        if isinstance(definition, GlobalPredicate) and cost == INFINITE and _is_known_form(definition):
            return definition
        body = plain(definition.body)
        if body is None:
            return None
        if isinstance(definition, Predicate) and cost == INFINITE:
            return Predicate(definition.name, definition.parameters, body)
        return self._as_function(one, definition, body)

    def _as_function(self, one: HeldConstraint, definition: Predicate | Function, body: Expression) -> Function | None:
        """Return a definition whose costs are finite as a function. None: it should be a relation."""
        if any(robot.costs.places for robot in self._flat.team.robots):  # the costs of a function have no unit
            return None
        if isinstance(definition, Predicate):
            if self._flat.small_table(one) is not None:
                return None
            body = Apply("if", (body, Constant(0), Constant(int(one.constraint.cost))))
        return Function(definition.name, definition.parameters, body)

    def _add_formula(self, one: HeldConstraint, definition: Predicate | Function) -> None:
        constraint = one.constraint
        if isinstance(definition, GlobalPredicate):
            element = self._document.constraint(constraint.name, constraint.variables, definition.name)
            write_global(etree.SubElement(element, "parameters"), definition, constraint.parameters)
            return
        reference = self._document.formula(definition, definition.body)
        element = self._document.constraint(constraint.name, constraint.variables, reference)
        etree.SubElement(element, "parameters").text = " ".join(map(str, constraint.parameters))

    def _add(self, table: Exported) -> None:
        """Write a soft relation, the only kind that all of FRODO reads."""
        key = id(table.table)
        if key not in self._references:
            self._references[key] = self._relation(table)
        self._document.constraint(table.name, table.scope, self._references[key])

    def _relation(self, table: Exported) -> str:
        by_cost: dict[Amount, list[str]] = {}
        for values, cost in table.table.rows.items():
            by_cost.setdefault(cost, []).append(" ".join(map(str, values)))
        tuples = " | ".join(f"{self._number(cost)}: {' | '.join(listed)}" for cost, listed in by_cost.items())
        attributes = {"semantics": "soft", "defaultCost": self._number(table.table.default)}
        return self._document.relation(table, attributes, tuples)

    def _number(self, cost: Amount) -> str:
        whole = cost if cost == INFINITE else cost * 10**self._places
        return cost_text(whole, forbidden=self._forbidden)


def _is_known_form(predicate: GlobalPredicate) -> bool:
    """Return whether FRODO reads the parameters of a global constraint."""
    return _FORMS[predicate.name.removeprefix(PREFIX)].fullmatch(predicate.form) is not None
