"""The messages by which robots build a pseudo-tree without names (see `anonymous_dfs.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording


class Wave(Message, frozen=True):
    """An election wave of the candidate with this random `score`; it becomes the root if its wave returns."""

    score: bytes

    act = Act(Performative.PROPOSE, "a candidate for the root, for the receiver to prefer or to drop")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"somebody whose score begins with {self.score[:2].hex()} wants to be the root"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Token(Message, frozen=True):
    """The token of the depth-first search; a receiver that it has not visited becomes the sender's child."""

    act = Act(Performative.REQUEST, "the receiver is to go on with the tree")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "if you are not in the tree yet, you are my child"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Bounce(Message, frozen=True):
    """The token comes back at once: the sender is in the tree already, above the receiver."""

    act = Act(Performative.REFUSE, "the sender is in the tree already")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "I am in the tree, above you"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Back(Message, frozen=True):
    """The token on its way back: all robots below the sender are in the tree."""

    act = Act(Performative.INFORM, "what `Token` asked for is done")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "all below me are in the tree"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


AnonymousTreeMessage = Wave | Token | Bounce | Back
"""The messages that every `AnonymousTreeProtocol` receives besides its own."""
