"""The message of LAMDLS that is not common to all local search (see `lamdls.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import Hearing, Proof, can_take
from robochoc.model.wording import Wording


class Colour(wire.Message, frozen=True):
    """The sender's first value, and its colour: a number that no neighbour has."""

    value: wire.Value
    colour: Annotated[int, msgspec.Meta(ge=0)]

    act = Act(Performative.INFORM, "the receiver comes to know when the sender will move")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} at first, and my colour is number {self.colour + 1}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [can_take(hearing.sender, self.value)]
