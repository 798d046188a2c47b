"""The message of CBBA (see `cbba.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof
from robochoc.model.wording import Wording, listed
from robochoc.protocols.auctions.messages.cbaa import Standing, standing_in_words, standings_prove


class Bundles(wire.Message, frozen=True):
    """The winning bids and agents (`y`, `z`) that are new to the receiver, and how new all that was said is (`s`).

    The winner of a task that nobody has is empty. `stamps` has the number of the last message that the sender has taken
    in of each robot that can do a task which both ends can do, in priority order; that of the sender is the number of
    this message.
    """

    standings: list[Standing]
    stamps: list[int]

    act = Act(Performative.INFORM, "the receiver comes to know who has which task as far as the sender knows")
    shareable = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return listed([standing_in_words(words, *one) for one in self.standings])

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what the sender has bid itself."""
        return standings_prove(self.standings, hearing)
