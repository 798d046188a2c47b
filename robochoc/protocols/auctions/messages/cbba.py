"""The message of CBBA (see `cbba.py`)."""

from __future__ import annotations

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.cbaa import Standing, standing_in_words


class Bundles(wire.Message, frozen=True):
    """The winning bids and agents (`y`, `z`) of all tasks that both ends can do, and how new they are (`s`).

    The winner of a task that nobody has is empty. `stamps` has the number of the last message of each robot that the
    sender has taken in, as far as the receiver may use it; that of the sender is the number of this message.
    """

    standings: list[Standing]
    stamps: dict[str, int]

    act = Act(Performative.INFORM, "the receiver comes to know who has which task as far as the sender knows")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return listed([standing_in_words(words, *one) for one in self.standings])
