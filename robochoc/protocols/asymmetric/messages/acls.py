"""The messages of ACLS (see `acls.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import INFINITE, NOTHING, Hearing, PartPays, Proof, can_take
from robochoc.model.wording import Wording
from robochoc.protocols.local_search.mgm import saving_in_words
from robochoc.protocols.shared.cycles import Value

Paid = tuple[int, int | float]
"""Broken hard constraints, and costs."""


class Proposal(wire.Message, frozen=True):
    """The value that the sender would like to take. None: it has none (`proposal`)."""

    value: wire.Value | None

    act = Act(Performative.QUERY_REF, "the sender asks what its proposal would cost the receiver")

    def in_words(self, words: Wording) -> str:
        if self.value is None:
            return "I propose no other value in this cycle"
        return f"{words.own_value(self.value)} is what I propose: what would it cost you?"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return NOTHING if self.value is None else [can_take(hearing.sender, self.value)]


class Sides(wire.Message, frozen=True):
    """The sender's own side towards the receiver: with its value now, and with what it proposes (`impact`)."""

    now: Paid
    proposed: Paid

    act = Act(Performative.INFORM, "the answer to `Proposal`")

    def in_words(self, _: Wording) -> str:
        return f"my side costs {saving_in_words(*self.now)} now, and {saving_in_words(*self.proposed)} as you propose"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender's part, with both values of the receiver."""
        wanted = hearing.last(Proposal, hearing.receiver, hearing.sender)
        own = hearing.last(Value, hearing.receiver, hearing.sender)
        told = hearing.last(Value, hearing.sender, hearing.receiver)
        if wanted is None or wanted.value is None or own is None or told is None:
            return NOTHING
        sides = ((own.value, self.now), (wanted.value, self.proposed))
        return [
            PartPays(hearing.sender, told.value, hearing.receiver, value, INFINITE if broken else cost)
            for value, (broken, cost) in sides
        ]
