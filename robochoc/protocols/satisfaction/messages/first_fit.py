"""The message of first fit (see `first_fit.py`)."""

from __future__ import annotations

from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording


class Placed(Message, frozen=True):
    """The sender's value; None if it has withdrawn."""

    value: Value | None

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        if self.value is None:
            return "I withdraw"
        return f"I fly, with {words.own_value(self.value, 'a value')}"
