"""Tables of costs that no robot can read: each cell has a cipher for each cost, which hides whether the cost suffices.

A cost is in unary code: bit c shows whether a cost of at most c is possible, so an infinite cost is all zeros. A known
cost is added by moving bits up. The smaller of two costs has the bits of both: its ciphers are the sums of their
ciphers, because a sum of bits is 0 only if all bits are 0. Two encrypted costs cannot be added.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from robochoc.model.problem import INFINITE
from robochoc.protocols.private.elgamal import TeamKey

Pair = tuple[bytes, bytes]
Sources = NDArray[np.intp]
"""For each of this robot's values and each cell of the new table, a cell in the old table."""
Costs = NDArray[np.float64]


class CostCipher:
    """Encrypts costs from 0 to `levels` - 1, and computes with them."""

    def __init__(self, key: TeamKey, levels: int) -> None:
        self._key = key
        self.levels = levels

    @property
    def size(self) -> int:
        """The number of bytes of a cipher."""
        return self._key.size

    def encrypted(self, costs: Costs) -> bytes:
        """Return the encrypted table of known costs."""
        bits = np.arange(self.levels) >= costs.reshape(-1, 1)
        return b"".join([self._key.encrypt(bit=bool(bit)) for bit in bits.reshape(-1)])

    def cells(self, ciphers: bytes) -> list[list[Pair]]:
        """Return the bits in each cell of a table."""
        pairs = self._key.pairs(ciphers)
        return [pairs[at : at + self.levels] for at in range(0, len(pairs), self.levels)]

    def eliminated(self, cells: list[list[Pair]], sources: Sources, costs: Costs) -> bytes:
        """Return the table of minimum costs over all of this robot's values, encrypted again.

        Args:
            cells: the old table.
            sources: for each of this robot's values and each cell of the new table, the cell of the old one.
            costs: the costs to be added, in the same shape.
        """
        return b"".join(
            [
                self._key.renewed(bit)
                for column, added in zip(sources.T.tolist(), costs.T.tolist(), strict=True)
                for bit in self._least(cells, column, added)
            ]
        )

    def _least(self, cells: list[list[Pair]], column: list[int], added: list[float]) -> list[Pair]:
        """Return the bits of the smallest cost in `column`, after the known costs in `added` are added."""
        least: list[Pair | None] = [None] * self.levels
        for cell, cost in zip(column, added, strict=True):
            if cost == INFINITE:
                continue
            for place, bit in enumerate(cells[cell][: max(0, self.levels - int(cost))], int(cost)):
                known = least[place]
                least[place] = bit if known is None else self._key.added(known, bit)
        return [self._key.nothing if bit is None else bit for bit in least]

    def any_of(self, cells: list[list[Pair]]) -> list[Pair]:
        """Return the bits of the smallest of all costs."""
        return self._least(cells, list(range(len(cells))), [0.0] * len(cells))

    def prefixes(self, cells: list[list[Pair]], cost: int) -> list[Pair]:
        """Return, for each cell, whether `cost` suffices in this cell or in a previous one."""
        return list(self._sums(cells, cost))

    def _sums(self, cells: list[list[Pair]], cost: int) -> Iterator[Pair]:
        known = self._key.nothing
        for bits in cells:
            known = self._key.added(known, bits[cost])
            yield known
