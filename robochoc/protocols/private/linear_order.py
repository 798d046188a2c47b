"""One robot's place in the linear order of one turn of P2-DPOP: the axes of tables, and what is added to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from robochoc.model.message import Value
from robochoc.protocols.private.encrypted_costs import Costs, Sources
from robochoc.protocols.private.messages.p2_dpop import Axis
from robochoc.protocols.private.messages.p_dpop import Shape, cells_of
from robochoc.solver.compiled import LocalProblem

T = TypeVar("T", bound=np.generic)


class OwnAxis(NamedTuple):
    """The own axis in one turn: its `codename`, and for each code the place of the value among the declared ones."""

    codename: str
    order: Sequence[int]

    def codes(self, places: Mapping[int, int]) -> dict[int, int]:
        """Return the codes of own values, each with the value's place in the compiled domain."""
        return {code: places[place] for code, place in enumerate(self.order) if place in places}


class Place(NamedTuple):
    """The axes of the table that comes, and of the one that goes on; `later` are neighbours still to come."""

    incoming: Shape
    outgoing: Shape
    later: Mapping[str, Axis]

    @property
    def cells(self) -> int:
        """Return the number of cells of the table that goes on."""
        return cells_of(self.outgoing)


def place_after(problem: LocalProblem, own: OwnAxis, incoming: Shape, later: Mapping[str, Axis]) -> Place:
    """Return the place of a robot that eliminates itself. Axes are in an order that says nothing.

    Raises:
        ValueError: if a neighbour's axis has another size than the table's.
    """
    outgoing = {codename: size for codename, size in incoming.items() if codename != own.codename}
    for agents, _ in problem.scopes(later):
        for agent in agents:
            size = len(later[agent].values)
            if outgoing.setdefault(later[agent].codename, size) != size:
                raise ValueError(f"a table in which {agent} has another number of values than it says")
    return Place(incoming, dict(sorted(outgoing.items())), later)


def own_costs(problem: LocalProblem) -> Costs:
    """Return what each own value costs whatever other robots do."""
    own = np.array(problem.charges, np.float64)
    for table in problem.tables({}):
        own = own + table.charges
    return own


def own_places(problem: LocalProblem) -> dict[int, int]:
    """Return, for each place among the declared values, the place of the own value; the cheapest, of several.

    Several look alike only where no neighbour sees any variable. Declared values that the robot cannot take are left
    out.
    """
    costs = own_costs(problem)
    declared: dict[Value, int] = {value: place for place, value in enumerate(problem.declared(problem.agent))}
    found: dict[int, int] = {}
    for index, value in enumerate(problem.values):
        place = declared[value]
        if place not in found or costs[index] < costs[found[place]]:
            found[place] = index
    return found


def sources(place: Place, codename: str, codes: Sequence[int]) -> Sources:
    """Return, for each own code and each cell of the table that goes on, the cell of the table that comes."""
    cells = np.arange(cells_of(place.incoming)).reshape(list(place.incoming.values()))
    axes = list(place.incoming)
    cells = cells.take(codes, axes.index(codename)) if codename in axes else cells[..., np.newaxis]
    spread = _aligned(cells, axes if codename in axes else [*axes, codename], (codename, *place.outgoing))
    return np.broadcast_to(spread, (len(codes), *place.outgoing.values())).reshape(len(codes), -1)


def costs_to_add(problem: LocalProblem, place: Place, codename: str, indices: Sequence[int]) -> Costs:
    """Return, for the own values at `indices` and each cell of the table that goes on, what they cost there.

    That is, the private costs, and those of constraints of which all other robots are still to come.
    """
    onto = (codename, *place.outgoing)
    added = np.zeros((len(indices), *place.outgoing.values()), np.float64)
    added += _aligned(np.array(problem.charges, np.float64)[list(indices)], [codename], onto)
    for table in problem.tables({name: axis.values for name, axis in place.later.items()}):
        names = [*(place.later[agent].codename for agent in table.agents), codename]
        added += _aligned(table.charges.take(list(indices), -1), names, onto)
    return added.reshape(len(indices), -1)


def _aligned(table: NDArray[T], axes: Sequence[str], onto: Sequence[str]) -> NDArray[T]:
    """Return `table` with its axes as in `onto`, of length 1 where it has none."""
    table = table.transpose([axes.index(codename) for codename in onto if codename in axes])
    return table[tuple([slice(None) if codename in axes else np.newaxis for codename in onto])]
