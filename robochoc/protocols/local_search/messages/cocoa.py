"""The messages of CoCoA (see `cocoa.py`)."""

from __future__ import annotations

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.wording import Wording, counted
from robochoc.protocols import acts
from robochoc.protocols.local_search.messages.mgm import saving_in_words

Burden = tuple[int, int | float]
"""Broken hard constraints, and the cost of all others."""


class Inquiry(wire.Message, frozen=True):
    """A question: what would each of the sender's `values` cost the receiver at least?

    `known` are the final values of other robots that the sender knows. The sender is active from now on.
    """

    values: list[wire.Value]
    known: dict[str, wire.Value]

    act = Act(Performative.QUERY_REF, "the sender asks what its values would cost the receiver")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        so_far = f"; so far {words.assigned(self.known.items())}" if self.known else ""
        return f"what would each of my {counted(len(self.values), 'value')} cost you at least?{so_far}"


class Costs(wire.Message, frozen=True):
    """The answer to an inquiry: for each value that was asked for, the least that it would cost the sender."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver comes to know what its values would cost the sender")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} would cost me least: {price}"


class Hold(wire.Message, frozen=True):
    """The sender waits: too many of its values are equally good."""

    act = Act(Performative.INFORM, "the receiver comes to know that it may choose before the sender")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "I wait: too many of my values are equally good"


class SetValue(wire.Message, frozen=True):
    """The sender's value, which is final."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} for good"
