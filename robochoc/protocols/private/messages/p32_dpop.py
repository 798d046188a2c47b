"""The messages of P3/2-DPOP (see `p32_dpop`), besides P-DPOP's."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, EveryValuePays, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording
from robochoc.protocols.private.messages.p_dpop import UTIL


class Stage(IntEnum):
    """The rounds of a vector."""

    TO_FIRST = 0
    """From its owner to the first robot of the ring."""
    MIXING = 1
    """A whole round from there: each robot shuffles it."""
    HOME = 2
    """From the first robot to its owner."""
    OPENING = 3
    """A whole round from its owner: each other robot takes its share of the key off."""


class Join(Message, frozen=True):
    """Takes a robot into the ring: its `number`, and the sum of the public keys of the robots before it."""

    number: int
    key: bytes

    act = Act(Performative.REQUEST, "the receiver is to take the number, and to add its public key")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"take the next number in the ring, and add your key to {self.key[:2].hex()}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Setup(Message, frozen=True):
    """The team's public `key`; there are `turns`, and the number of each robot counts from `offset`."""

    key: bytes
    offset: int
    turns: int

    act = Act(Performative.INFORM, "the receiver comes to know the team's key")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"our key begins with {self.key[:2].hex()}, and there are {self.turns} turns"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Vector(Message, frozen=True):
    """One robot's encrypted bits, a bit for each turn: 0 where it is the root. Nobody but its owner knows the `tag`."""

    stage: Stage
    tag: bytes
    ciphers: bytes

    act = Act(Performative.REQUEST, "the receiver is to shuffle it, to open it, or to pass it on")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        to_do = {
            Stage.TO_FIRST: "pass it on to the first of the ring",
            Stage.MIXING: "shuffle it",
            Stage.HOME: "pass it on to its owner",
            Stage.OPENING: "take your share of the key off",
        }
        return f"somebody's turns, encrypted ({self.tag[:2].hex()}): {to_do[self.stage]}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Table(UTIL, frozen=True):
    """A table of P-DPOP in the turn of one root; robots that have had theirs have their values."""

    turn: int

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{super().in_words(words)}, for turn {self.turn + 1}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: after the first turn nothing about every value of the sender.

        The sender may have had its turn since, and then the table is about one value.
        """
        found = super().proves(hearing)
        return found if self.turn == 0 else [one for one in found if not isinstance(one, EveryValuePays)]


class Next(Message, frozen=True):
    """The root has its value: the next turn begins."""

    act = Act(Performative.INFORM, "the turn is over")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "the next turn begins"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


RerootingMessage = Join | Setup | Vector | Next
"""The messages by which roots take turns."""
