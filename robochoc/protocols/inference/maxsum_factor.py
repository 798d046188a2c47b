"""Function nodes of a factor graph (Max-Sum)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import add
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from robochoc.solver.cost_table import Array, CostTable

Row = list[float]
"""An entry for each value of a robot."""

SMALL = 400
"""Up to so many entries a table over two robots is faster as lists than in numpy."""


class Factor:
    """A function node: the sum of all constraints over the same robots (`agents` and the one that holds it)."""

    def __init__(self, agents: Sequence[str], charges: Array) -> None:
        self.agents = agents
        self.charges = charges
        small = len(agents) == 1 and charges.size <= SMALL
        self._lines: tuple[list[Row], list[Row]] | None = (charges.tolist(), charges.T.tolist()) if small else None

    @classmethod
    def joined(cls, tables: Iterable[CostTable]) -> list[Self]:
        """Return one function for each set of robots in `tables`; tables of a single robot are left out."""
        sums: dict[tuple[str, ...], Array] = {}
        for table in tables:
            if table.agents:
                before = sums.get(table.agents)
                sums[table.agents] = table.charges if before is None else before + table.charges
        return [cls(agents, charges) for agents, charges in sums.items()]

    def split(self, shares: Array) -> tuple[Factor, Factor]:
        """Return two functions whose sum is this one: of each entry its share, between 0 and 1, and the rest.

        What is forbidden is so in both.
        """
        return Factor(self.agents, self.charges * shares), Factor(self.agents, self.charges * (1 - shares))

    def r(self, told: Sequence[Row]) -> list[Row]:
        """Return the minimum cost of each robot's values, given the others' Q in `told`; in the order of the axes."""
        if self._lines:
            (other, own), (lines, columns) = told, self._lines
            return [[min(map(add, line, own)) for line in lines], [min(map(add, line, other)) for line in columns]]
        return [self._least(place, told) for place in range(len(told))]

    def _least(self, place: int, told: Sequence[Row]) -> Row:
        """Return the minimum cost for each value on the axis at `place`."""
        import numpy as np  # noqa: PLC0415 - for large tables only

        axes = tuple([axis for axis in range(len(told)) if axis != place])
        total = self.charges
        for axis in axes:
            row = np.asarray(told[axis], np.float64)
            total = total + np.expand_dims(row, tuple([other for other in range(len(told)) if other != axis]))
        least: Row = total.min(axis=axes).tolist()
        return least
