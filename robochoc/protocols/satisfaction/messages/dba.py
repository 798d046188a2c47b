"""The message of DBA that is not common to all local search (see `dba.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import FINITE, INFINITE, NOTHING, Hearing, Pays, Proof
from robochoc.model.wording import Wording, counted
from robochoc.protocols.shared.cycles import Value

Count = Annotated[int, msgspec.Meta(ge=0)]


class Improve(wire.Message, frozen=True):
    """By how much the sender's best move reduces the weight of what it violates (`improve`).

    `weight` is the weight of what it violates now, `counter` its termination counter.
    """

    reduction: Count
    weight: Count
    counter: Count

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's move would save")

    def in_words(self, _: Wording) -> str:
        if not self.weight:
            return f"I violate nothing; for {counted(self.counter, 'cycle')} nobody near me has"
        return f"what I violate weighs {self.weight:,}, and my move would make that {self.reduction:,} less"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: whether the sender's present value goes with the own one.

        That it does not, only where no other robot's value is in it.
        """
        own = hearing.last(Value, hearing.receiver, hearing.sender)
        told = hearing.last(Value, hearing.sender, hearing.receiver)
        if own is None or told is None:
            return NOTHING
        view = {hearing.receiver: own.value}
        if not self.weight:
            return [Pays(hearing.sender, told.value, view, 0, FINITE)]
        return [Pays(hearing.sender, told.value, view, INFINITE, INFINITE)] if hearing.is_only_neighbour() else NOTHING
