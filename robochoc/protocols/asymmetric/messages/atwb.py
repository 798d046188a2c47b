"""The messages of ATWB that AFB does not have (see `atwb.py`)."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text
from robochoc.protocols.optimization.afb_bounds import Cost


class SideRequest(Message, frozen=True):
    """A request for what the receiver's own side of constraints with the sender adds to the CPA (backward bounding).

    The sender has taken `value`, the `counter`-th one; the receiver's value in the CPA is its `yours`-th.
    """

    value: Value
    counter: int
    yours: int

    act = Act(Performative.QUERY_REF, "the sender asks what the receiver's own side of constraints adds to the cost")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for now; what does your side of it add?"


class Side(Message, frozen=True):
    """The cost that the sender's own side adds, beyond what it counts, to the CPA with the `counter`-th value asked."""

    counter: int
    cost: Cost

    act = Act(Performative.INFORM, "the answer to `SideRequest`")

    def in_words(self, _: Wording) -> str:
        return f"my side of it adds {cost_text(self.cost)}"
