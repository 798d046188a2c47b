"""XDisCSP 1.0, the format of DisChoco 2 and DCOPSolver: DisCSP, DCOP, MaxDisCSP, and ADCOP with two costs per tuple.

Sources: the names in DisChoco's parser, and the files shipped with DCOPSolver. The variant with one file per agent is
robochoc's own format.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.dialect import (
    ConversionNote,
    Dialect,
    ExportOptions,
    ExportResult,
    ImportOptions,
    ImportResult,
)
from robochoc.formats.dialects.exact_costs import Amount, ExactCostTable
from robochoc.formats.dialects.tabulation import OwnedConstraint, TabulatedConstraint
from robochoc.formats.dialects.xcsp21.document import Document, FlatTeam, cost_text, in_xcsp21_operators
from robochoc.formats.dialects.xcsp21.instance import ForeignConstraint, ForeignTable, Formula, Instance, refuse
from robochoc.formats.dialects.xcsp21.reader import FileHead, read_instance
from robochoc.formats.dialects.xcsp21.team import to_team
from robochoc.formats.element_view import ElementView
from robochoc.model.constraint import INFINITE, Predicate, Semantics
from robochoc.model.problem import Team
from robochoc.solver.errors import UnsupportedError

NAME = "xdiscsp"
FORMAT = "XDisCSP 1.0"
MAX_DISCSP = "MaxDisCSP"

_ONE = Decimal(1)


def _recognises(_path: Path, beginning: bytes) -> bool:
    found = FileHead(beginning)
    return found.is_instance and found.has_agents and "XDisCSP" in found.format


def _read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    if len(paths) > 1:
        refuse(paths[1], 0, "is a second problem", "import one XDisCSP file at a time")
    instance = read_instance(paths[0], options, _private_agent)
    instance.name = paths[0].stem
    if instance.type == MAX_DISCSP:
        _cost_one(instance)
        instance.notes.append(ConversionNote("MaxDisCSP", "each violated constraint costs 1"))
    return to_team(instance, NAME, options)


def _private_agent(element: ElementView, instance: Instance) -> str:
    """Return the only agent that knows a constraint. Raises `MistakeError` if a PKC constraint has no `ownerId`."""
    model = element.attribute("model") or instance.constraint_model
    owner = element.attribute("ownerId")
    if model != "PKC":
        return ""
    if not owner:
        what = f"a partially known constraint (PKC) '{shortened(element.attribute('name'))}' without ownerId"
        raise MistakeError(what, 'write ownerId="1", the id of the agent that knows it, or model="TKC"')
    return instance.ids.get(owner, owner)


def _cost_one(instance: Instance) -> None:
    """Replace hard constraints by soft constraints with the cost 1 for a violation."""
    tables: dict[int, ForeignTable] = {}

    def with_cost_one(one: ForeignConstraint) -> ForeignConstraint:
        match one.content:
            case Formula(definition=Predicate()) as formula:
                return replace(one, content=replace(formula, cost=_ONE))
            case ForeignTable() as table:
                return replace(one, content=tables.setdefault(id(table), _with_ones(table)))
            case _:
                return one

    instance.constraints = list(map(with_cost_one, instance.constraints))


def _with_ones(table: ForeignTable) -> ForeignTable:
    costs = {values: _ONE if cost == INFINITE else cost for values, cost in table.costs.items()}
    return replace(table, costs=costs, default=_ONE if table.default == INFINITE else table.default)


def _write(team: Team, options: ExportOptions) -> ExportResult:
    """Return the file: a DisCSP, a DCOP, or an ADCOP if two robots have different costs for one constraint.

    Raises:
        UnsupportedError: if the team has utilities, decimal or negative costs, or a scenario, which XDisCSP lacks.
    """
    del options
    return ExportResult({f"{team.name}.xml": _XdiscspWriter(FlatTeam(team, FORMAT)).content()})


class _XdiscspWriter:
    def __init__(self, flat: FlatTeam) -> None:
        self._flat = flat
        if flat.maximize:
            raise UnsupportedError(f"{FORMAT} does not support utilities: costs are minimised")
        self._asymmetric = flat.is_weighted and any(one.private_part for one in flat.owned)
        kind = "ADCOP" if self._asymmetric else "DCOP" if flat.is_weighted else "DisCSP"
        partly = any(one.private_part for one in flat.owned)
        presentation = {
            "name": flat.team.name,
            "type": kind,
            "benchmark": "RandomDCOP",  # DCOPSolver requires a name here, and accepts this name for any problem
            "model": "Complex" if any(len(robot.variables) > 1 for robot in flat.team.robots) else "Simple",
            "constraintModel": "PKC" if partly else "TKC",
            "maxConstraintArity": str(max((len(one.constraint.variables) for one in flat.owned), default=1)),
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
        for one in flat.owned:
            if not self._is_side(one):
                self._add(one)
        if self._asymmetric:
            self._add_sides()
        if flat.constant:
            constant = self._cost(flat.constant, "the constant")
            document.constraints.set("initialCost", constant)
        return document.content()

    def _add(self, one: OwnedConstraint) -> None:
        constraint, definition = one.constraint, one.constraint.definition
        model = {"model": "TKC"}
        if one.private_part:
            model = {"model": "PKC", "ownerId": self._ids[one.robot.name]}
        hard = isinstance(definition, Predicate) and constraint.cost == INFINITE
        body = in_xcsp21_operators(definition.body) if hard and isinstance(definition, Predicate) else None
        if body is not None and isinstance(definition, Predicate):
            reference = self._document.formula(definition, body)
            element = self._document.constraint(constraint.name, constraint.variables, reference, **model)
            etree.SubElement(element, "parameters").text = " ".join(map(str, constraint.parameters))
            return
        table = self._flat.table(one)
        self._document.constraint(constraint.name, table.scope, self._relation(table, one), **model)

    def _relation(self, tabulated: TabulatedConstraint, one: OwnedConstraint) -> str:
        table, name = tabulated.table, one.constraint.name
        listed = {" ".join(map(str, values)): cost for values, cost in table.rows.items()}
        if not self._flat.is_weighted:
            semantics = Semantics.CONFLICTS if table.default == 0 else Semantics.SUPPORTS
            return self._document.relation(tabulated, {"semantics": semantics}, "|".join(listed))
        attributes = {"semantics": "soft", "defaultCost": self._cost(table.default, name)}
        tuples = "|".join(f"{self._cost(cost, name)}:{values}" for values, cost in listed.items())
        return self._document.relation(tabulated, attributes, tuples)

    def _is_side(self, one: OwnedConstraint) -> bool:
        """Return whether a constraint becomes one side of an asymmetric constraint. Raises `UnsupportedError`."""
        scope = one.constraint.variables
        if not self._asymmetric or not one.private_part or len({self._flat.team.owner[name] for name in scope}) == 1:
            return False
        if len(scope) != 2:  # noqa: PLR2004 - a cost for each of two variables
            what = f"the partially known constraint {one.constraint.name} has {len(scope)} variables"
            raise UnsupportedError(f"{FORMAT} allows asymmetric costs of two variables only, but {what}")
        return True

    def _add_sides(self) -> None:
        """Write both sides of each pair of variables as one relation with two costs per tuple."""
        sides: dict[tuple[str, ...], dict[str, list[TabulatedConstraint]]] = defaultdict(lambda: defaultdict(list))
        for one in self._flat.owned:
            if self._is_side(one):
                table = self._flat.table(one)
                sides[tuple(sorted(table.scope))][one.robot.name].append(table)
        for pair, by_robot in sides.items():
            owners = [self._flat.team.owner[name] for name in pair]
            domains = [self._flat.team.variables[name].domain for name in pair]
            costs: dict[tuple[int, ...], Amount] = {}
            written = []
            for values in itertools.product(*domains):
                both = [_total(by_robot[owner], dict(zip(pair, values, strict=True))) for owner in owners]
                costs[values] = INFINITE
                words = " ".join(self._cost(cost, " ".join(pair)) for cost in both)
                written.append(f"{words}:{' '.join(map(str, values))}")
            table = TabulatedConstraint(
                "_".join(pair), pair, ExactCostTable("_".join(pair), costs, INFINITE, len(costs))
            )
            attributes = {"semantics": "soft", "defaultCost": "infinity"}
            reference = self._document.relation(table, attributes, "|".join(written))
            self._document.constraint("_".join(pair), pair, reference, model="TKC")

    def _cost(self, cost: Amount, name: str) -> str:
        if cost < 0 or (cost != INFINITE and Fraction(cost) % 1):
            raise UnsupportedError(f"{FORMAT} requires integer costs of 0 or more, but {name} has {cost_text(cost)}")
        return cost_text(cost)


def _total(parts: list[TabulatedConstraint], assignment: Mapping[str, int]) -> Amount:
    total: Amount = 0
    for part in parts:
        total += part.table.rows.get(tuple(assignment[name] for name in part.scope), part.table.default)
    return total


DIALECT = Dialect(NAME, "XDisCSP 1.0", _recognises, _read, _write)
