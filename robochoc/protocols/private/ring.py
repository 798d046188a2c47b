"""A circle of the robots in a tree, depth first. Messages in the circle use the tree's edges: no new links are needed.

A robot that sends a message on does not know the next robot, only the neighbour on the way to it.
"""

from __future__ import annotations

from collections.abc import Sequence


class Ring:
    """One robot's position in the circle, derived from its position in the tree. The tree has at least two robots."""

    def __init__(self, parent: str | None, children: Sequence[str]) -> None:
        self._parent = parent
        self.children = tuple(children)

    @property
    def is_first(self) -> bool:
        """True if the circle begins at this robot, the root of the tree."""
        return self._parent is None

    @property
    def parent(self) -> str:
        """The neighbour above. Raises `ValueError` for the first robot."""
        if self._parent is None:
            raise ValueError("the first robot of the circle has no parent")
        return self._parent

    @property
    def neighbours(self) -> tuple[str, ...]:
        """The neighbours above and below in the tree."""
        return self.children if self._parent is None else (self._parent, *self.children)

    @property
    def onward(self) -> str:
        """The neighbour on the way to the next robot."""
        return self.children[0] if self.children else self.parent

    def on_its_way(self, sender: str) -> str | None:
        """Return the neighbour to which a message from `sender` is sent on; None if it is for this robot.

        A message from above is for this robot; a message from a child is for the next child, or on its way up, or back
        at the first robot.
        """
        if sender == self._parent:
            return None
        if sender not in self.children:
            raise ValueError(f"{sender} is not a neighbour in the tree")
        later = self.children[self.children.index(sender) + 1 :]
        return later[0] if later else self._parent
