"""XDisCSP 1.0, the files of DisChoco 2 and of DCOPSolver: DisCSP, DCOP, MaxDisCSP, and ADCOP with two costs a tuple.

Facts: the names in DisChoco's parser, and the files that come with DCOPSolver. The variant with one file for each agent
is this platform's own format.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.dialect import Dialect, Imported, ImportOptions, Note
from robochoc.formats.dialects.xcsp21.instance import ForeignConstraint, Formula, Instance, Table, refuse
from robochoc.formats.dialects.xcsp21.reader import read_instance
from robochoc.formats.dialects.xcsp21.recognition import Beginning
from robochoc.formats.dialects.xcsp21.team import as_team
from robochoc.formats.dialects.xcsp21.xdiscsp_file import xdiscsp_file
from robochoc.formats.element_view import ElementView
from robochoc.model.constraint import INFINITE, Predicate

NAME = "xdiscsp"
MAX_DISCSP = "MaxDisCSP"

_ONE = Decimal(1)


def _recognises(_path: Path, beginning: bytes) -> bool:
    found = Beginning(beginning)
    return found.is_instance and found.has_agents and "XDisCSP" in found.format


def _read(paths: Sequence[Path], options: ImportOptions) -> Imported:
    if len(paths) > 1:
        refuse(paths[1], 0, "is a whole problem by itself", "import one such file at a time, or their folder")
    instance = read_instance(paths[0], options, _knower)
    instance.name = paths[0].stem
    if instance.type == MAX_DISCSP:
        _cost_one(instance)
        instance.notes.append(Note("MaxDisCSP", "each violated constraint costs 1"))
    return as_team(instance, NAME, options)


def _knower(element: ElementView, instance: Instance) -> str:
    """Return the agent that alone knows a constraint. Raises `MistakeError` where a partially known one names none."""
    model = element.attribute("model") or instance.constraint_model
    owner = element.attribute("ownerId")
    if model != "PKC":
        return ""
    if not owner:
        what = f"a partially known constraint (PKC) '{shortened(element.attribute('name'))}' without ownerId"
        raise MistakeError(what, 'write ownerId="1", the id of the agent that knows it, or model="TKC"')
    return instance.ids.get(owner, owner)


def _cost_one(instance: Instance) -> None:
    """Let every hard constraint cost 1 where it is violated."""
    tables: dict[int, Table] = {}

    def costing_one(one: ForeignConstraint) -> ForeignConstraint:
        match one.content:
            case Formula(definition=Predicate()) as formula:
                return replace(one, content=replace(formula, cost=_ONE))
            case Table() as table:
                return replace(one, content=tables.setdefault(id(table), _with_ones(table)))
            case _:
                return one

    instance.constraints = list(map(costing_one, instance.constraints))


def _with_ones(table: Table) -> Table:
    costs = {values: _ONE if cost == INFINITE else cost for values, cost in table.costs.items()}
    return replace(table, costs=costs, default=_ONE if table.default == INFINITE else table.default)


DIALECT = Dialect(NAME, "XDisCSP 1.0", _recognises, _read, xdiscsp_file)
