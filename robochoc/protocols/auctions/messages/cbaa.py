"""The message of CBAA (see `cbaa.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.lots import Lot, bid_proves, lot_in_words

Standing = tuple[Lot, str, int]
"""A task as the sender names it, who has it as far as the sender knows, and for how much."""


class WinningBids(wire.Message, frozen=True):
    """The highest bids that the sender knows, and the receiver may not (`y`, with the winners)."""

    bids: list[Standing]

    act = Act(Performative.INFORM, "the receiver comes to know the highest bids that the sender knows")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return listed([standing_in_words(words, *bid) for bid in self.bids])

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what the sender has bid itself."""
        return standings_prove(self.bids, hearing)


def standing_in_words(words: Wording, lot: Lot, winner: str, amount: int) -> str:
    """Return who has a task: `task V1 = 3 is mine for 7`, `task V1 = 3 is Robot2's for 7`."""
    task = lot_in_words(words, words.sender, lot)
    if not winner:
        return f"{task} is nobody's"
    whose = {words.sender: "mine", words.receiver: "yours"}.get(winner, f"{winner}'s")
    return f"{task} is {whose} for {amount:,}"


def standings_prove(standings: Sequence[Standing], hearing: Hearing) -> list[Proof]:
    """Return what the bids of the sender in `standings` prove.

    Who else has won is told by the sender's name for the task, which is not the winner's.
    """
    own = [(lot, amount) for lot, winner, amount in standings if winner == hearing.sender]
    return [proof for lot, amount in own for proof in bid_proves(hearing.sender, lot, amount, hearing)]
