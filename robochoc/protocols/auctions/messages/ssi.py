"""The messages of sequential single-item auctions (see `ssi.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.lots import Lot, does_proves, lot_in_words, next_proves


def _next_in_words(amount: int) -> str:
    return f"I bid {amount:,} for the next task that I want" if amount else "I bid for nothing more"


class Bid(wire.Message, frozen=True):
    """The sender's highest bid, for a task that is not told; 0: it bids for nothing more."""

    amount: int

    act = Act(Performative.PROPOSE, "the highest bid is to win")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return _next_in_words(self.amount)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return next_proves(hearing.sender, self.amount, hearing)


class Won(wire.Message, frozen=True):
    """The sender has won the tasks that it calls `lots`; its highest bid for what is left is `amount`."""

    lots: list[Lot]
    amount: int

    act = Act(Performative.INFORM, "the receiver comes to know that a task is the sender's")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        lots = listed([lot_in_words(words, words.sender, lot) for lot in self.lots])
        return f"{lots} {'is' if len(self.lots) == 1 else 'are'} mine, and {_next_in_words(self.amount)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender can do the tasks. What it bid may not be told."""
        won = [proof for lot in self.lots for proof in does_proves(hearing.sender, lot, hearing)]
        return [*won, *next_proves(hearing.sender, self.amount, hearing)]
