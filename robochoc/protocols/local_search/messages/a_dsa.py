"""The message of A-DSA (see `a_dsa.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.disclosure import Hearing, Proof, can_take
from robochoc.model.wording import Wording
from robochoc.protocols import acts


class Tick(wire.Message, frozen=True):
    """The sender's value after a tick, changed or not; `last`: it makes no more ticks."""

    value: wire.Value
    last: bool

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} {'for good' if self.last else 'at present'}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [can_take(hearing.sender, self.value)]
