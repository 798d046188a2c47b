"""The border between blocks of a team that are computed in different processes. This base class is for a whole team."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from numpy.typing import NDArray

from robochoc.communication.arrays.array_types import Integers

Item = TypeVar("Item")


class Shared(NamedTuple):
    """An array of which blocks exchange entries: the indices to send to, and to receive from, each other block.

    Blocks match arrays by `key`. A block may lack an array if it shares no entries of it.
    """

    key: int
    array: NDArray[Any]
    outgoing: Mapping[int, Integers]
    incoming: Mapping[int, Integers]


class Border:
    """The border of a block of robots.

    Attributes:
        active: True if robots in other blocks have neighbours.
        number: The index of the block.
        blocks: The block of the robot in each row; None if there is one block.
        robots: The index, in the whole team, of the robot in each row.
    """

    active = False
    number = 0
    blocks: Integers | None = None
    robots: Integers

    def exchange(self, *arrays: NDArray[Any] | None) -> None:
        """Copy the entries of other blocks' robots into `arrays`, which have one entry per row."""

    def swap(self, shared: Sequence[Shared]) -> None:
        """Exchange entries of arrays with the other blocks."""

    def gather(self, item: Item) -> list[Item]:
        """Return the `item` of each block. Items consist of numbers, flags, texts and lists."""
        return [item]


WHOLE_TEAM = Border()
