"""The message of CBAA (see `cbaa.py`)."""

from __future__ import annotations

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.lots import Lot, lot_in_words

Standing = tuple[Lot, str, int]
"""A task as the sender names it, who has it as far as the sender knows, and for how much."""


class WinningBids(wire.Message, frozen=True):
    """The highest bids that the sender knows, and the receiver may not (`y`, with the winners)."""

    bids: list[Standing]

    act = Act(Performative.INFORM, "the receiver comes to know the highest bids that the sender knows")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return listed([standing_in_words(words, *bid) for bid in self.bids])


def standing_in_words(words: Wording, lot: Lot, winner: str, amount: int) -> str:
    """Return who has a task: `task V1 = 3 is mine for 7`, `task V1 = 3 is Robot2's for 7`."""
    task = lot_in_words(words, words.sender, lot)
    if not winner:
        return f"{task} is nobody's"
    whose = {words.sender: "mine", words.receiver: "yours"}.get(winner, f"{winner}'s")
    return f"{task} is {whose} for {amount:,}"
