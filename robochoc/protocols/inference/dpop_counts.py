"""Tables of numbers that go with DPOP's tables of costs: how many assignments attain each cost (see `count_dpop`).

Numbers are exact. Where 64 bits are enough for all, a table is one of numpy's integers, otherwise one of Python's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robochoc.protocols.inference.dpop_tables import PIECE, Codes, Table, costs_for

Numbers = NDArray[Any]
WORD = 64
_OBJECT = 40
"""Bytes of Python's for an integer, besides its digits: its header, and the table's pointer to it."""
_SCRATCH = 24
"""Bytes for each cell while costs are compared: two sums, and what they have in common."""


def bytes_of_numbers(cells: int, bits: int) -> int:
    """Return the size of a table of numbers below 2^`bits`."""
    return cells * (8 if bits <= WORD else _OBJECT + bits // 7)


def bytes_to_count(cells: int, bits: int, below: int) -> int:
    """Return the peak size of all that counting needs: the children's tables, `below` bytes, and the own ones.

    The own table is there four times: a product, the sum, what is between, and the piece that is sent.
    """
    return 4 * bytes_of_numbers(cells, bits) + cells * _SCRATCH + 2 * below


def count_attaining(
    least: Codes, charges: Sequence[float], tables: Sequence[Table], own: Numbers, below: Sequence[Numbers]
) -> Numbers:
    """Return how many assignments attain each cost of `least`: none where it is infinite.

    Args:
        least: The least costs, of `tables` joined.
        charges: What the own values cost.
        tables: Tables of costs: the own axis first, then the axes of `least` (see `aligned`).
        own: How many local solutions stand behind each own value.
        below: The children's tables of numbers, with the same axes.
    """
    wanted = costs_for(least[np.newaxis, ...], 0)
    found = np.zeros(least.shape, own.dtype)
    for value, charge in enumerate(charges):
        joined = np.full(least.shape, charge, np.float64)
        for table in tables:
            joined += costs_for(table, value)
        product = np.full(least.shape, own[value], own.dtype)
        for numbers in below:
            product *= numbers[value if len(numbers) > 1 else 0]
        product *= (joined == wanted) & (joined < math.inf)
        found += product
    return found


def numbers_of(values: Sequence[int], bits: int) -> Numbers:
    """Return a table of these values, with room for numbers below 2^`bits`."""
    return np.array(values, np.uint64 if bits <= WORD else np.object_)


def packed_numbers(table: Numbers) -> Iterator[tuple[int, bytes]]:
    """Yield `table` in pieces for the wire, with as few bytes per number as the largest one needs."""
    flat = table.reshape(-1)
    width = max(1, -(-int(flat.max()).bit_length() // 8))
    step = max(1, PIECE // width)
    for start in range(0, flat.size, step):
        yield width, b"".join([int(one).to_bytes(width, "little") for one in flat[start : start + step]])


class IncomingNumbers:
    """A table of numbers below 2^`bits` that arrives in pieces, to go with `costs`, which are there already."""

    def __init__(self, costs: Codes, bits: int, own_bits: int) -> None:
        self._costs = costs
        self._bits = bits
        self._numbers: list[int] = []
        self._own_bits = own_bits

    @property
    def complete(self) -> bool:
        """Whether the whole table has arrived."""
        return len(self._numbers) == self._costs.size

    @property
    def table(self) -> Numbers:
        """The numbers, in a table with the shape of the costs."""
        return numbers_of(self._numbers, self._own_bits).reshape(self._costs.shape)

    def add(self, width: int, piece: bytes) -> None:
        """Append the next piece. Raises `ValueError` for bytes that do not fit."""
        cells, odd = divmod(len(piece), width)
        start, left = len(self._numbers), self._costs.size - len(self._numbers)
        if odd or not 0 < cells <= left or width > max(1, -(-self._bits // 8)):
            raise ValueError(f"{len(piece)} bytes, {width} a number, are no piece of a table that lacks {left}")
        numbers = [int.from_bytes(piece[at : at + width], "little") for at in range(0, len(piece), width)]
        if max(numbers).bit_length() > self._bits:
            raise ValueError(f"a number is larger than 2^{self._bits}")
        finite = costs_for(self._costs.reshape(1, -1)[:, start : start + cells], 0) < math.inf
        if not np.array_equal(finite, [number > 0 for number in numbers]):
            raise ValueError("a cost without an assignment, or assignments that cost infinitely much")
        self._numbers += numbers
