"""Messages of ADOPT, separate from `adopt.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts, message
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import HasValue, Proof, Reception
from robochoc.protocols.message import Message
from robochoc.protocols.optimization.bounding_messages import Context, Number, bounds_in_words, bounds_prove
from robochoc.protocols.wording import Wording, cost_text


class Value(Message, frozen=True):
    """The sender's value and the number of its changes so far (VALUE)."""

    value: message.Value
    counter: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on (change {self.counter})"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return [HasValue(reception.sender, self.value)]


class Cost(Message, frozen=True):
    """Bounds on the cost of the sender's subtree in `context`: lower bound `lb`, upper bound `ub` (COST)."""

    context: Context
    lb: Number
    ub: Number

    act = acts.TELL_BOUNDS

    def in_words(self, words: Wording) -> str:
        return bounds_in_words(words, self.context, self.lb, self.ub)

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return bounds_prove(self.context, self.lb, self.ub, reception)


class Threshold(Message, frozen=True):
    """The cost up to which the receiver keeps its value, in `context` (THRESHOLD)."""

    threshold: Number
    context: dict[str, message.Value]

    act = Act(Performative.REQUEST, "the receiver must keep its value while it costs no more")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        values = {robot: (value, 0) for robot, value in self.context.items()}
        allowed = cost_text(self.threshold)
        return f"{words.context(values)}your subtree may cost {allowed} before you try other values"
