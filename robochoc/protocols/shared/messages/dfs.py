"""The messages by which robots build a pseudo-tree (see `dfs.py`)."""

from __future__ import annotations

from typing import Annotated

import msgspec

from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.system.plain_text import counted, listed


class Wave(Message, frozen=True):
    """An election wave of `candidate`, with the number of its neighbours.

    The candidate becomes the root if its wave returns from all neighbours.
    """

    neighbours: int
    candidate: str

    act = Act(Performative.PROPOSE, "a candidate for the root, for the receiver to prefer or to drop")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"{self.candidate}, which has {counted(self.neighbours, 'neighbour')}, wants to be the root"


Visited = dict[str, Annotated[int, msgspec.Meta(ge=1)]]
"""Robots in the tree, each with the number (1 or more) of its neighbours that do not know so yet."""


class Token(Message, frozen=True):
    """The token of the depth-first search: the receiver becomes the sender's child; `visited` are in the tree."""

    visited: Visited

    act = Act(Performative.REQUEST, "the receiver must continue building the tree")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"you are my child in the tree{_unaware_in_words(self.visited)}"


class Back(Message, frozen=True):
    """The token on its way back: all robots below the sender are in the tree; `visited` are in the tree."""

    visited: Visited

    act = Act(Performative.INFORM, "the request of `Token` is done")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"all below me are in the tree{_unaware_in_words(self.visited)}"


def _unaware_in_words(visited: Visited) -> str:
    return f", where not all know of {listed(visited)} yet" if visited else ""


TreeMessage = Wave | Token | Back
"""The messages that every `TreeProtocol` receives besides its own."""
