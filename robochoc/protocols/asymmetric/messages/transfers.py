"""The message of MCS-MGM and GCA-MGM that MGM does not have (see `mcs_mgm.py`)."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message
from robochoc.model.wording import Wording
from robochoc.protocols.local_search.mgm import saving_in_words


class Transfer(Message, frozen=True):
    """An entry of the sender's part, at both robots' values: from now on the receiver pays it. None: no transfer.

    A cost is a pair: broken hard constraints, and costs.
    """

    entry: tuple[int, int | float] | None

    act = Act(Performative.INFORM, "the receiver comes to know what its move has cost the sender, if that is too much")
    # The entry may contain costs that were handed over before.
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        if self.entry is None:
            return "I have no costs to hand over to you"
        return f"you pay my side of our two values from now on: {saving_in_words(*self.entry)}"
