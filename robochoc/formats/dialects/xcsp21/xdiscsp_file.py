"""Writes a team as a file of XDisCSP 1.0, for DisChoco and DCOPSolver."""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Mapping
from decimal import Decimal

from lxml import etree

from robochoc.formats.dialects.xcsp21.document import Document, number
from robochoc.formats.dialects.xcsp21.flat import FlatTeam, Held, Rows, plain
from robochoc.model.constraint import INFINITE, Predicate, Relation, Semantics
from robochoc.model.problem import Team
from robochoc.solver.encoding import UnsupportedError

FORMAT = "XDisCSP 1.0"


def xdiscsp_file(team: Team) -> Mapping[str, bytes]:
    """Return the file: a DisCSP, a DCOP, or an ADCOP where two robots have costs of their own for one constraint.

    Raises:
        UnsupportedError: if the team has what XDisCSP has not: utilities, decimal or negative costs, a scenario.
    """
    return {f"{team.name}.xml": _Writer(FlatTeam(team, FORMAT)).content()}


class _Writer:
    def __init__(self, flat: FlatTeam) -> None:
        self._flat = flat
        if flat.units.maximize:
            raise UnsupportedError(f"{FORMAT} has no utilities: costs are minimised")
        self._asymmetric = flat.weighted and any(one.private_part for one in flat.held)
        kind = "ADCOP" if self._asymmetric else "DCOP" if flat.weighted else "DisCSP"
        partly = any(one.private_part for one in flat.held)
        presentation = {
            "name": flat.team.name,
            "type": kind,
            "benchmark": "RandomDCOP",  # DCOPSolver fails without a name here, and takes this one for any problem
            "model": "Complex" if any(len(robot.variables) > 1 for robot in flat.team.robots) else "Simple",
            "constraintModel": "PKC" if partly else "TKC",
            "maxConstraintArity": str(max((len(one.constraint.variables) for one in flat.held), default=1)),
            "format": FORMAT,
        }
        self._document = Document(flat, presentation)
        self._ids = {robot.name: str(place) for place, robot in enumerate(flat.team.robots, 1)}

    def content(self) -> bytes:
        flat, document = self._flat, self._document
        for robot in flat.team.robots:
            number_of = self._ids[robot.name]
            etree.SubElement(document.agents, "agent", name=robot.name, id=number_of, description=robot.name)
            for place, variable in enumerate(robot.variables, 1):
                domain = flat.domain_of[variable.name]
                element = etree.SubElement(document.variables, "variable", agent=robot.name, name=variable.name)
                element.attrib.update({"id": str(place), "domain": domain, "description": variable.name})
        for one in flat.held:
            if not (one.private_part and self._asymmetric):
                self._add(one)
        if self._asymmetric:
            self._add_sides()
        if flat.units.constant:
            constant = self._cost(Decimal(flat.units.constant).scaleb(-flat.units.places), "the constant")
            document.constraints.set("initialCost", constant)
        return document.content()

    def _add(self, one: Held) -> None:
        constraint, definition = one.constraint, one.constraint.definition
        model = {"model": "TKC"}
        if one.private_part:
            model = {"model": "PKC", "ownerId": self._ids[one.robot.name]}
        hard = isinstance(definition, Predicate) and constraint.cost == INFINITE
        body = plain(definition.body) if hard and isinstance(definition, Predicate) else None
        if body is not None and isinstance(definition, Predicate):
            reference = self._document.formula(definition, body)
            element = self._document.constraint(constraint.name, constraint.variables, reference, **model)
            etree.SubElement(element, "parameters").text = " ".join(map(str, constraint.parameters))
            return
        rows = self._rows(one)
        self._document.constraint(constraint.name, rows.variables, self._relation(rows, one), **model)

    def _rows(self, one: Held) -> Rows:
        rows = self._flat.rows(one)
        if rows is None:
            raise UnsupportedError(f"{FORMAT}: {one.constraint.name} is too large for a relation, as costs are there")
        return rows

    def _relation(self, rows: Rows, one: Held) -> str:
        definition = one.constraint.definition
        soft = self._flat.weighted or not isinstance(definition, Relation)
        listed = [" ".join(map(str, values)) for values in rows.costs]
        if not soft and isinstance(definition, Relation) and definition.semantics != Semantics.SOFT:
            return self._document.relation(rows, {"semantics": definition.semantics}, "|".join(listed))
        if not self._flat.weighted:  # a predicate without a counterpart
            allowed = {values: cost for values, cost in rows.costs.items() if cost != INFINITE}
            tuples = "|".join(" ".join(map(str, values)) for values in allowed)
            return self._document.relation(rows._replace(costs=allowed), {"semantics": "supports"}, tuples)
        name = one.constraint.name
        costs = [self._cost(cost, name) for cost in rows.costs.values()]
        attributes = {"semantics": "soft", "defaultCost": self._cost(rows.default, name)}
        tuples = "|".join(f"{cost}:{values}" for cost, values in zip(costs, listed, strict=True))
        return self._document.relation(rows, attributes, tuples)

    def _add_sides(self) -> None:
        """Write both sides of each pair of variables as one relation with two costs a tuple."""
        sides: dict[tuple[str, ...], dict[str, list[Rows]]] = defaultdict(lambda: defaultdict(list))
        for one in self._flat.held:
            if one.private_part:
                rows = self._rows(one)
                sides[tuple(sorted(rows.variables))][one.robot.name].append(rows)
        for pair, by_robot in sides.items():
            owners = [self._flat.team.owner[name] for name in pair]
            domains = [self._flat.team.variables[name].domain for name in pair]
            costs: dict[tuple[int, ...], Decimal | float] = {}
            written = []
            for values in itertools.product(*domains):
                both = [_total(by_robot[owner], dict(zip(pair, values, strict=True))) for owner in owners]
                costs[values] = INFINITE
                words = " ".join(self._cost(cost, " ".join(pair)) for cost in both)
                written.append(f"{words}:{' '.join(map(str, values))}")
            rows = Rows(pair, costs, INFINITE)
            attributes = {"semantics": "soft", "defaultCost": "infinity"}
            reference = self._document.relation(rows, attributes, "|".join(written))
            self._document.constraint("_".join(pair), pair, reference, model="TKC")

    def _cost(self, cost: Decimal | float, name: str) -> str:
        if cost < 0 or (cost != INFINITE and cost != int(cost)):
            raise UnsupportedError(f"{FORMAT} has integer costs of 0 or more, and {name} has {number(cost)}")
        return number(cost if isinstance(cost, float) else Decimal(int(cost)))


def _total(parts: list[Rows], assignment: Mapping[str, int]) -> Decimal | float:
    found = [part.costs.get(tuple(assignment[name] for name in part.variables), part.default) for part in parts]
    if INFINITE in found:
        return INFINITE
    return sum((cost for cost in found if isinstance(cost, Decimal)), Decimal(0))
