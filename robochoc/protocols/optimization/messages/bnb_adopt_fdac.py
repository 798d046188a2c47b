"""The messages of BnB-ADOPT+ with soft arc consistency (see `bnb_adopt_fdac.py`).

All bounds and thresholds are on costs *after* some were moved to robots further up: a subtree that costs 7, and has
moved 5 up, says 2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.model import message
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import FINITE, NOTHING, EveryValuePays, HasOnly, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text
from robochoc.protocols import acts
from robochoc.protocols.optimization.messages import bnb_adopt
from robochoc.protocols.optimization.messages.bounding import Number, bounds_in_words, bounds_prove


class Domain(Message, frozen=True):
    """The sender's values, and a request for what can be moved to them."""

    values: list[message.Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"{words.domain(self.values)}; what can you move to each of them?"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [HasOnly(hearing.sender, tuple(self.values))]


class Moved(Message, frozen=True):
    """For each value of the receiver, a cost of the sender's subtree that the receiver counts as its own from now on.

    Infinite: no value of the sender goes with that value.
    """

    costs: list[Number]

    act = Act(Performative.INFORM, "the receiver comes to know costs that it is to count as its own")

    def in_words(self, _: Wording) -> str:
        told = ", ".join(cost_text(cost) for cost in self.costs)
        return f"count as your own, with your values one by one: {told}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver.

        Costs of robots below the sender, and of its constraints with others, may be among the moved ones. So something
        is proven only if there are no others: each of its values costs at least that much then.
        """
        values = hearing.values(hearing.receiver)
        if not hearing.is_only_neighbour() or values is None or len(values) != len(self.costs):
            return NOTHING
        pairs = zip(values, self.costs, strict=True)
        return [EveryValuePays(hearing.sender, {hearing.receiver: value}, cost) for value, cost in pairs]


class Value(bnb_adopt.Value, frozen=True):
    """The sender's value, the number of its changes (ID), and the receiver's threshold (TH) after what it moved up."""

    def in_words(self, words: Wording) -> str:
        change = f"{words.own_value(self.value)} from now on (change {self.counter})"
        if math.isinf(self.threshold):
            return change
        return f"{change}; your subtree may cost {cost_text(self.threshold)} more then than it has moved up"


class Cost(bnb_adopt.Cost, frozen=True):
    """Bounds on the cost of the sender's subtree in `context`, after what it moved up, and a threshold request."""

    def in_words(self, words: Wording) -> str:
        told = bounds_in_words(words, self.context, self.lb, self.ub)
        beyond = "" if math.isinf(self.lb) else " more than it has moved up"
        return f"{told}{beyond}{'; tell me my threshold again' if self.threshold_request else ''}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver.

        Costs were moved out of the bounds, to robots that the receiver may not know. So the lower bound still is one,
        where nobody is below the sender; of the upper bound only remains that it is finite.
        """
        return bounds_prove(self.context, self.lb, self.ub if math.isinf(self.ub) else FINITE, hearing)
