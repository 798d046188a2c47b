"""Writing XCSP 2.1: elements that FRODO's and DisChoco's files share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from lxml import etree

from robochoc.formats.dialects.exported import Exported, decimal, free_name
from robochoc.formats.dialects.tables import Amount
from robochoc.formats.dialects.xcsp21.flat import FlatTeam, with_formals
from robochoc.model.constraint import INFINITE, Function, Predicate
from robochoc.model.expression import Expression, text


class Document:
    """An XML document that fills up. Equal relations, predicates and functions stand once.

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
        """Return the document, with the counts that its sections lack."""
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

    def relation(self, table: Exported, attributes: Mapping[str, str], tuples: str) -> str:
        """Return the name of a relation with these tuples, which is added if there is none."""
        key = "relation", tuple(attributes.items()), tuples, len(table.scope)
        if key not in self._known:
            sizes = {"arity": str(len(table.scope)), "nbTuples": str(len(table.table.rows))}
            element = self._new("relation", key, {**sizes, **attributes})
            element.text = tuples
        return self._known[key]

    def formula(self, definition: Predicate | Function, body: Expression) -> str:
        """Return the name of a predicate or function with this body, which is added if there is none."""
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
            "name": free_name(name, self._names),
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
                told = ", ".join(f"{value} is {domain.label(value)}" for value in domain)
                section.append(etree.Comment(f" {name}: {told} ".replace("--", "- -")))
            element = etree.SubElement(section, "domain", name=name, nbValues=str(len(domain)))
            element.text = " ".join(map(_range, domain.ranges))


def _range(part: range) -> str:
    return f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0])


def cost_text(cost: Amount, *, forbidden: str = "infinity") -> str:
    """Return a cost as it is written."""
    return forbidden if cost == INFINITE else decimal(cost)
