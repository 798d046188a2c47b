"""The robots of a tree in a circle, depth first. What goes round it takes the tree's edges: nobody is written to anew.

A robot that hands something on does not know who comes next, only through which neighbour.
"""

from __future__ import annotations

from collections.abc import Sequence


class Ring:
    """One robot's place in the circle, from its place in the tree. The tree has two robots at least."""

    def __init__(self, parent: str | None, children: Sequence[str]) -> None:
        self._parent = parent
        self.children = tuple(children)

    @property
    def is_first(self) -> bool:
        """Return whether the circle begins here: the tree's root."""
        return self._parent is None

    @property
    def parent(self) -> str:
        """The neighbour above. Raises `ValueError` for the first robot."""
        if self._parent is None:
            raise ValueError("nobody is above the first robot")
        return self._parent

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The neighbours above and below in the tree."""
        return self.children if self._parent is None else (self._parent, *self.children)

    @property
    def onward(self) -> str:
        """The neighbour through which the next robot is reached."""
        return self.children[0] if self.children else self.parent

    def on_its_way(self, sender: str) -> str | None:
        """Return the neighbour that a message from `sender` goes on to; None: it is for this robot.

        From above it is; from a child it is for the next child, or on its way up, or back at the first robot.
        """
        if sender == self._parent:
            return None
        if sender not in self.children:
            raise ValueError(f"{sender} is not in the tree here")
        later = self.children[self.children.index(sender) + 1 :]
        return later[0] if later else self._parent
