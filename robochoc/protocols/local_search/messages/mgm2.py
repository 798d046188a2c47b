"""The messages of MGM-2 (see `mgm2.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import INFINITE, NOTHING, Hearing, Pays, Proof
from robochoc.model.wording import Wording, counted
from robochoc.protocols import acts
from robochoc.protocols.local_search.messages.mgm import saving_in_words
from robochoc.protocols.shared.messages.cycles import Domain

Gains = list[list[tuple[int, int | float]]]


class Offer(wire.Message, frozen=True):
    """An offer of a joint move: a row for each of the receiver's values, with a gain for each of the sender's.

    A gain is a pair: broken hard constraints, and costs. None: no offer (`offer`).
    """

    gains: Gains | None

    act = Act(Performative.PROPOSE, "what both would gain by moving together")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if self.gains is None:
            return "I have no offer for you"
        best = max(saving for row in self.gains for saving in row)
        many = f"{counted(len(self.gains), 'value')} of yours and {len(self.gains[0]):,} of mine"
        if best <= (0, 0):
            return f"let us move together: of {many}, no two would save me anything"
        return f"let us move together: of {many}, the best two would save me {saving_in_words(*best)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what pairs of values cost more than the cheapest pair.

        It does where no other robot's value is in it.
        """
        own = hearing.last(Domain, hearing.receiver, hearing.sender)
        told = hearing.last(Domain, hearing.sender, hearing.receiver)
        if own is None or told is None or not self.gains or not hearing.is_only_neighbour():
            return NOTHING
        most_broken = max(broken for row in self.gains for broken, _ in row)
        most = max(cost for row in self.gains for _, cost in row)
        return [
            Pays(
                hearing.sender,
                value,
                {hearing.receiver: theirs},
                INFINITE if broken < most_broken else most - cost,
                INFINITE,
            )
            for theirs, row in zip(own.values, self.gains, strict=True)
            for value, (broken, cost) in zip(told.values, row, strict=True)
        ]


class Accept(wire.Message, frozen=True):
    """The acceptance of an offer: the receiver's value at `place`, and the total gain (`accept`)."""

    place: int
    broken: int
    cost: int | float

    act = acts.ACCEPT

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        saved = saving_in_words(self.broken, self.cost)
        return f"I take your offer: you take your value number {self.place + 1}, and we save {saved} in all"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Reject(wire.Message, frozen=True):
    """The rejection of an offer (`reject`)."""

    act = Act(Performative.REJECT_PROPOSAL, "the offer that was proposed is not taken")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "I do not take your offer"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Go(wire.Message, frozen=True):
    """A committed robot's word on the joint move: whether its gain is the largest among its neighbours.

    The paper's messages are `go` and `no go`.
    """

    go: bool

    act = Act(Performative.INFORM, "the receiver comes to know whether the sender gains most")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if self.go:
            return "go: of my neighbours, nobody is to move before us"
        return "no go: one of my neighbours is to move instead"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
