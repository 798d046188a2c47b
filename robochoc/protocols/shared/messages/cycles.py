"""The messages of all synchronous local search (see `cycles.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.disclosure import HasOnly, Hearing, Proof, can_take
from robochoc.model.wording import Wording
from robochoc.protocols import acts


class Value(wire.Message, frozen=True):
    """The sender's value (`value`)."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} in this cycle"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        # It may move after the last cycle without a word.
        return [can_take(hearing.sender, self.value)]


class Domain(wire.Message, frozen=True):
    """The sender's domain, sent first; later messages refer to places in it."""

    values: list[wire.Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.domain(self.values)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, tuple(self.values))]
