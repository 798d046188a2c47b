"""The messages of counting DPOP (see `count_dpop`); others are DPOP's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording, counted
from robochoc.protocols.inference.messages.dpop import Dimensions

MOST_BITS = 1 << 20
"""Stands for all that is longer, too: it ends the run."""
Bits = Annotated[int, msgspec.Meta(ge=0, le=MOST_BITS)]


class CountDimensions(Dimensions, frozen=True):
    """DPOP's `Dimensions`; `bits` are enough for the number of all assignments of the sender's subtree."""

    bits: Bits

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{super().in_words(words)}; {counted(self.bits, 'bit')} are enough for my numbers"


class Counts(Message, frozen=True):
    """A piece of the sender's table of numbers, in the order of UTIL's cells: how many assignments attain each cost.

    `numbers` are unsigned integers of `width` bytes, little-endian, of any size.
    """

    width: Annotated[int, msgspec.Meta(ge=1, le=MOST_BITS // 8)]
    numbers: bytes

    act = Act(Performative.INFORM, "the receiver comes to know in how many ways the sender's subtree attains its costs")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        cells = counted(len(self.numbers) // self.width, "cell")
        return f"in how many ways my subtree attains the costs of my table: {cells}, of {counted(self.width, 'byte')}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
