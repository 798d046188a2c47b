"""The messages of listing DPOP (see `list_dpop`); others are those of DPOP and counting DPOP."""

from __future__ import annotations

from typing import Annotated

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message
from robochoc.model.wording import Wording, counted
from robochoc.protocols.inference.messages.count_dpop import MOST_BITS

Number = Annotated[str, msgspec.Meta(pattern=r"^[0-9a-f]+\Z", max_length=MOST_BITS // 4)]
"""In hexadecimal digits, as it may need more than 64 bits."""


class ListedValues(Message, frozen=True):
    """For each optimum that is listed, what DPOP's VALUE has for one, and which of several the receiver's subtree has.

    `assignments` are the places of the values of the robots in the receiver's separator. `numbers` count, from 0 on,
    the cheapest assignments of its subtree under these values.
    """

    assignments: list[list[int]]
    numbers: list[Number]

    act = Act(Performative.INFORM, "the receiver comes to know the values above it in each optimum")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        optima = "optimum" if len(self.numbers) == 1 else "optima"
        different = counted(len({*map(tuple, self.assignments)}), "combination")
        return f"{len(self.numbers):,} {optima}, with {different} of values of the robots in your separator"
