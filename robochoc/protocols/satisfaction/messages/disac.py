"""The messages of distributed arc consistency (see `disac.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import HasOnly, Hearing, Proof
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, counted
from robochoc.protocols import acts


class Domain(Message, frozen=True):
    """The sender's values."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [HasOnly(hearing.sender, self.values)]


class Del(Message, frozen=True):
    """Values that the sender has removed, as places in its domain (`del`)."""

    places: tuple[int, ...]

    act = Act(Performative.INFORM, "the receiver comes to know which of the sender's values are in no solution")
    # The removal may follow from any robot's constraints.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"{counted(len(self.places), 'value')} of {words.variables(words.sender)} can be in no solution"
