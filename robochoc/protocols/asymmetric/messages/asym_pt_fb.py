"""The messages of AsymPT-FB that PT-FB does not have (see `asym_pt_fb.py`)."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, costs_text, counted
from robochoc.protocols.optimization.messages.branching import Number


class RowRequest(Message, frozen=True):
    """A request for what the receiver's own side charges with its value for each of the sender's `values`."""

    values: list[Value]

    act = Act(Performative.QUERY_REF, "the sender asks what the receiver's own side charges with each of its values")

    def in_words(self, _: Wording) -> str:
        return f"what does your side add for each of my {counted(len(self.values), 'value')}?"


class Row(Message, frozen=True):
    """For each value of the receiver, the cost that the sender's own side adds to what the sender counts itself."""

    costs: list[Number]

    act = Act(Performative.INFORM, "the answer to `RowRequest`")

    def in_words(self, _: Wording) -> str:
        return f"for your values my side adds {costs_text(self.costs)}"
