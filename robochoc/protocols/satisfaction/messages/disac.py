"""The messages of distributed arc consistency (see `disac.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, HasOnly, Hearing, Proof
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, counted
from robochoc.protocols import acts


class Domain(Message, frozen=True):
    """The sender's values."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.domain(self.values)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, self.values)]


class Del(Message, frozen=True):
    """Values that the sender has removed, as places in its domain (`del`)."""

    places: tuple[int, ...]

    act = Act(Performative.INFORM, "the receiver comes to know which of the sender's values are in no solution")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{counted(len(self.places), 'value')} of {words.variables(words.sender)} can be in no solution"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself.

        It may follow from any robot's constraints.
        """
        return NOTHING
