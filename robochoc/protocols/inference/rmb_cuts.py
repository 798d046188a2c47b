"""Candidates for a cut, and tables that go with the values of cut robots, for RMB-DPOP (see `rmb_dpop`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.inference.dpop_tables import PIECE, Codes, Table, Width, packed_costs, place_type
from robochoc.protocols.inference.messages.rmb_dpop import Candidate

Places = NDArray[np.unsignedinteger[Any]]
SCRATCH = 16
"""Bytes for each cell while results are compared: an index, a mask, and the part of a table that is better."""


def added_up(all_candidates: Iterable[Mapping[str, Candidate]]) -> dict[str, Candidate]:
    """Return the candidates of several robots or branches together."""
    found = dict[str, Candidate]()
    for candidates in all_candidates:
        for name, one in candidates.items():
            other = found.get(name)
            found[name] = one if other is None else msgspec.structs.replace(
                one, relieved=one.relieved + other.relieved, lowest=max(one.lowest, other.lowest)
            )  # fmt: skip
    return found


def best(candidates: Mapping[str, Candidate]) -> str:
    """Return the candidate that relieves the most robots; of several the one nearest to its lowest, then deepest."""

    def merit(name: str) -> tuple[int, int, int, str]:
        one = candidates[name]
        return -one.relieved, one.lowest - one.depth, -one.depth, name

    return min(candidates, key=merit)


def thinned(candidates: Mapping[str, Candidate], above: Mapping[str, int]) -> dict[str, Candidate]:
    """Return the candidates `above`, and the best of the others: their numbers do not grow any more."""
    kept = {name: one for name, one in candidates.items() if name in above}
    others = {name: one for name, one in candidates.items() if name not in above}
    if others:
        kept[best(others)] = others[best(others)]
    return kept


class BestTables:
    """The best of several tables, cell by cell: costs, the own value, and the values of `cut` robots, as places."""

    def __init__(self, shape: Sequence[int], costs: np.dtype[Any], own: int, cut: Sequence[int]) -> None:
        self.costs: Codes = np.full(shape, np.iinfo(costs).max, costs)
        self.choices: Codes = np.zeros(shape, place_type([own]))
        self.places: Places = np.zeros((len(cut), *shape), place_type(cut or [own]))

    def improve(
        self, at: Sequence[slice | int], costs: Codes, choices: Codes | int, places: Sequence[Table | int]
    ) -> None:
        """Take over, in the part `at` these axes, what is cheaper."""
        part = (*at, ...)
        better = costs < self.costs[part]
        np.copyto(self.costs[part], costs, where=better)
        np.copyto(self.choices[part], choices, where=better, casting="unsafe")
        for number, row in enumerate(places):
            np.copyto(self.places[number, *part], row, where=better, casting="unsafe")

    def packed(self) -> Iterator[tuple[Width, bytes, bytes]]:
        """Yield the costs in pieces for the wire, each with the places that belong to it."""
        rows, start = self.places.reshape(len(self.places), -1), 0
        for width, piece in packed_costs(self.costs):
            cells = len(piece) // width
            yield width, piece, rows[:, start : start + cells].tobytes()
            start += cells


def bytes_of_best(shape: Sequence[int], width: int, own: int, cut: Sequence[int]) -> int:
    """Return the peak size of `BestTables` and of what is sent of them."""
    row = place_type(cut or [own]).itemsize * len(cut)
    cells = math.prod(shape)
    return cells * (width + place_type([own]).itemsize + row + SCRATCH) + min(cells, PIECE) * row


class IncomingPlaces:
    """The places of the values of cut robots, of so many values (`cut`), that come with a table of this `shape`."""

    def __init__(self, shape: Sequence[int], cut: Sequence[int]) -> None:
        self._limits = np.array(cut).reshape(-1, 1)
        self._start = 0
        self.table: Places = np.empty((len(cut), *shape), place_type(cut))

    def add(self, cells: int, piece: bytes) -> None:
        """Append the next piece, of so many cells. Raises `ValueError` for bytes that do not fit."""
        rows = self.table.reshape(len(self.table), -1)
        if len(piece) != cells * len(rows) * rows.itemsize or cells > rows.shape[1] - self._start:
            raise ValueError(f"{len(piece)} bytes are not the places of {len(rows)} robots for {cells} cells")
        places = np.frombuffer(piece, rows.dtype).reshape(len(rows), cells)
        if (places >= self._limits).any():
            raise ValueError("a robot has not so many values")
        rows[:, self._start : self._start + cells] = places
        self._start += cells


def picked(table: Table, choices: Codes) -> Table:
    """Return the part of `table` at the own values in `choices`; the own axis is the table's first."""
    if len(table) == 1:
        return np.broadcast_to(table[0], choices.shape)
    whole = np.broadcast_to(table, (len(table), *choices.shape))
    found: Table = np.take_along_axis(whole, choices[np.newaxis].astype(np.intp), 0)[0]
    return found
