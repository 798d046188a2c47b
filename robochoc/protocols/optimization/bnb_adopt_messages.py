"""Messages and settings of BnB-ADOPT, separate from `bnb_adopt.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from robochoc.model.problem import INFINITE
from robochoc.protocols import acts, message
from robochoc.protocols.disclosure import HasOnly, HasValue, Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bounding_messages import Context, Number, bounds_in_words, bounds_prove
from robochoc.protocols.settings import Settings
from robochoc.protocols.wording import Wording, cost_text


class BnBADOPTSettings(Settings, frozen=True):
    """`heuristic`: the initial lower bounds: 0 (`none`), or bounds that children send before the search (`dp`)."""

    heuristic: Literal["none", "dp"] = "none"


class Value(Message, frozen=True):
    """The sender's value, the number of its changes (ID), and the receiver's threshold (TH)."""

    value: message.Value
    counter: int
    threshold: Number = INFINITE

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        change = f"{words.own_value(self.value)} from now on (change {self.counter})"
        if math.isinf(self.threshold):
            return change
        return f"{change}; your subtree may cost {cost_text(self.threshold)} then"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value)]


class Cost(Message, frozen=True):
    """Bounds `lb` and `ub` on the cost of the sender's subtree in `context`, and a threshold request (ThReq)."""

    context: Context
    lb: Number
    ub: Number
    threshold_request: bool = False

    act = acts.TELL_BOUNDS

    def in_words(self, words: Wording) -> str:
        asked = "; tell me my threshold again" if self.threshold_request else ""
        return f"{bounds_in_words(words, self.context, self.lb, self.ub)}{asked}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return bounds_prove(self.context, self.lb, self.ub, reception)


class Domain(Message, frozen=True):
    """The sender's values, and a request for the receiver's floor."""

    values: list[message.Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"{words.domain(self.values)}; what do you cost at least with each of them?"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasOnly(reception.sender, tuple(self.values))]


class Floor(Message, frozen=True):
    """For each value of the receiver, the least cost of the sender's subtree, over all values of the others (h)."""

    costs: list[Number]

    act = acts.TELL_BOUNDS
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        told = ", ".join(cost_text(cost) for cost in self.costs)
        return f"with your values, one by one, my subtree costs at least {told}"
