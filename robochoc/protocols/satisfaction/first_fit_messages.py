"""The message of first fit, separate from `first_fit.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols.disclosure import NOTHING, HasValue, Proof, Reception
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording


class Placed(Message, frozen=True):
    """The sender's value; None if it has withdrawn."""

    value: Value | None

    def in_words(self, words: Wording) -> str:
        if self.value is None:
            return "I withdraw"
        return f"I fly, with {words.own_value(self.value, 'a value')}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return NOTHING if self.value is None else [HasValue(reception.sender, self.value)]
