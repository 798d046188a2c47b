"""The border between blocks of a team that are computed in different processes. This base class is for a whole team."""

from __future__ import annotations

from typing import Any, TypeVar

from numpy.typing import NDArray

Item = TypeVar("Item")


class Border:
    """The border of a block of robots.

    Attributes:
        active: True if robots in other blocks have neighbours.
    """

    active = False

    def exchange(self, *arrays: NDArray[Any] | None) -> None:
        """Copy the entries of other blocks' robots into `arrays`, which have one entry per row."""

    def gather(self, item: Item) -> list[Item]:
        """Return the `item` of each block. Items consist of numbers, flags, texts and lists."""
        return [item]


WHOLE_TEAM = Border()
