"""Orders of the robots: the total priority order, and the pseudo-trees that it induces (paper, Section 5.2)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from typing import Self

from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class PriorityOrder:
    """The names of all robots, the highest priority first. The order is static and the same for every robot in a run.

    `tree` is the pseudo-tree that the order induces; None unless the protocol requires it (`Traits.tree`). `rank` maps
    each robot to its position; if it is passed (by `TeamKnowledge`), all robots share the mapping.
    """

    def __init__(
        self,
        names: Sequence[str],
        links: Mapping[str, Iterable[str]] | None = None,
        rank: Mapping[str, int] | None = None,
    ) -> None:
        self.names = tuple(names)
        self.rank = {name: place for place, name in enumerate(self.names)} if rank is None else rank
        self.tree = None if links is None else PseudoTree.induced(self.names, links)

    def __deepcopy__(self, _: object) -> Self:
        return copy(self)  # names and ranks never change

    def lowest(self, names: Iterable[str]) -> str:
        """Return the lowest-priority robot in `names`. Raises `ValueError` if `names` is empty."""
        return max(names, key=self.rank.__getitem__)

    def depth(self, names: Iterable[str]) -> int:
        """Return the position of the lowest-priority robot in `names`; -1 if `names` is empty."""
        deepest = -1
        for name in names:  # usually there are one or two names, and then a loop is faster than `max` of an iterator
            place = self.rank[name]
            if place > deepest:  # noqa: PLR1730 - faster
                deepest = place
        return deepest


class PseudoTree:
    """A forest in which robots that share a constraint are on one branch.

    It is the tree that a total order induces (the elimination tree; Dechter, "Constraint Processing", 2003, Section
    4.5). The tree parent of a robot is the lowest robot above it that shares a constraint with it or with a robot below
    it in the tree. Priority decreases from the roots to the leaves. `parents` maps each robot to its tree parent (None
    for a root).
    """

    def __init__(self, order: Sequence[str], parents: Mapping[str, str | None]) -> None:
        self.parents = dict(parents)
        self.children: dict[str, list[str]] = {name: [] for name in order}
        for name in order:
            parent = self.parents[name]
            if parent is not None:
                self.children[parent].append(name)

    @classmethod
    def induced(cls, order: Sequence[str], links: Mapping[str, Iterable[str]]) -> PseudoTree:
        """Return the tree induced by `order`; `links` maps each robot to its neighbours with higher priority."""
        rank = {name: place for place, name in enumerate(order)}
        above = {name: set(links[name]) for name in order}
        parents: dict[str, str | None] = {}
        for name in reversed(order):
            parent = max(above[name], key=rank.__getitem__, default=None)
            parents[name] = parent
            if parent is not None:
                above[parent] |= above[name] - {parent}
        return cls(order, parents)

    @property
    def roots(self) -> list[str]:
        """The roots, one for each connected component."""
        return [name for name, parent in self.parents.items() if parent is None]

    def ancestors(self, name: str) -> list[str]:
        """Return the robots above `name`, from its parent to its root."""
        above = []
        parent = self.parents[name]
        while parent is not None:
            above.append(parent)
            parent = self.parents[parent]
        return above

    def descendants(self, name: str) -> list[str]:
        """Return the robots below `name`, each after its tree parent."""
        below = list(self.children[name])
        for child in below:
            below.extend(self.children[child])
        return below
