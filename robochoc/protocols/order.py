"""The total priority order that ABT and its relatives are subject to (paper, Section 5.2)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


class PriorityOrder:
    """Names of all robots, the highest priority first. Static, and the same for every robot of a run."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        self.rank = {name: rank for rank, name in enumerate(self.names)}

    def lowest(self, names: Iterable[str]) -> str:
        """The lowest-priority robot of `names`. Raises `ValueError` when there is none."""
        return max(names, key=self.rank.__getitem__)

    def depth(self, names: Iterable[str]) -> int:
        """How far down the lowest robot of `names` stands; -1 when there is none."""
        return max((self.rank[name] for name in names), default=-1)
