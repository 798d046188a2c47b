"""The messages of CoCoA (see `cocoa.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    HasOnly,
    Hearing,
    PartPays,
    Proof,
    SomeValuePays,
    StandsAt,
    can_take,
)
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

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, tuple(self.values)), *(can_take(*known) for known in self.known.items())]


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

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what values cost the sender, given others' final values.

        Where it shares constraints with the receiver alone, and has no final value, all its values cost that much.
        """
        asked = hearing.last(Inquiry, hearing.receiver, hearing.sender)
        if asked is None:
            return NOTHING
        alone = hearing.is_only_neighbour() and hearing.last(SetValue, hearing.sender, hearing.receiver) is None
        found: list[Proof] = []
        for value, (broken, cost) in zip(asked.values, self.burdens, strict=False):
            view = {hearing.receiver: value}
            if not broken:
                found.append(SomeValuePays(hearing.sender, view, cost))
            if alone:
                found.append(EveryValuePays(hearing.sender, view, INFINITE if broken else cost))
        return found


class CostsAt(Costs, frozen=True):
    """The answer where both sides of a constraint have costs of their own (ADCOP): the sender's side only.

    `values` are the sender's own values with which it costs the sender least, one for each value that was asked for.
    """

    values: list[wire.Value]

    act = Act(Performative.INFORM, "the receiver comes to know what its values would cost the sender, and with which")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        told = super().in_words(words)
        if not self.burdens or len(self.values) != len(self.burdens):
            return told
        return f"{told}, with {words.own_value(self.values[self.burdens.index(min(self.burdens))])}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [*super().proves(hearing), *(can_take(hearing.sender, value) for value in dict.fromkeys(self.values))]


class FinalSide(wire.Message, frozen=True):
    """The answer of a robot that has its value (ADCOP): what its parts charge for each value that was asked for."""

    burdens: list[Burden]

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's parts charge for its values")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if not self.burdens:
            return "you have asked for no value"
        place = self.burdens.index(min(self.burdens))
        price = saving_in_words(*self.burdens[place])
        return f"of your {counted(len(self.burdens), 'value')}, number {place + 1} costs my side least: {price}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender's parts, for its value and all that were asked."""
        asked = hearing.last(Inquiry, hearing.receiver, hearing.sender)
        stands = hearing.last(SetValue, hearing.sender, hearing.receiver)
        if asked is None or stands is None:
            return NOTHING
        return [
            PartPays(hearing.sender, stands.value, hearing.receiver, value, INFINITE if broken else cost)
            for value, (broken, cost) in zip(asked.values, self.burdens, strict=False)
        ]


class Hold(wire.Message, frozen=True):
    """The sender waits: too many of its values are equally good."""

    act = Act(Performative.INFORM, "the receiver comes to know that it may choose before the sender")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "I wait: too many of my values are equally good"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class SetValue(wire.Message, frozen=True):
    """The sender's value, which is final."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} for good"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [StandsAt(hearing.sender, self.value)]
