"""The messages of Synchronous Asymmetric Branch and Bound (see `syncabb.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof, Total, can_take
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, incumbent_text
from robochoc.protocols import acts
from robochoc.protocols.optimization.messages.syncbb import BestPath, Cost, best_proves

ASK = Act(Performative.QUERY_REF, "the sender asks what the receiver's own side of constraints adds to the cost")


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots before the receiver, and their cost (`CPA`)."""

    values: list[Value]
    paid: Cost
    best: BestPath

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values, known = words.partial(self.values), incumbent_text(self.best.bound)
        return f"so far {values}, which costs {cost_text(self.paid)}; {known}; it is {words.receiver}'s turn"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        values = [can_take(*chosen) for chosen in zip(hearing.order, self.values, strict=False)]
        return [*values, *best_proves(self.best, hearing)]


class CPABack(Message, frozen=True):
    """The CPA on its way back: the new value of `robot`, for the receiver to add its own side (`CPA_BACK`).

    `left` are the robots that it has to reach after the receiver; `bound` is the cost at which it returns at once.
    """

    robot: str
    value: Value
    paid: Cost
    bound: Cost
    left: list[str]

    act = ASK

    def in_words(self, words: Wording) -> str:
        values = words.assigned([(self.robot, self.value)])
        return f"with {values} it costs {cost_text(self.paid)} so far; what does your side of it add?"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        return [can_take(self.robot, self.value)]


class FullBack(Message, frozen=True):
    """A complete CPA on its way back, for the receiver to add its own side towards all robots after it.

    `bound` is the cost at which it returns to the last robot at once.
    """

    values: list[Value]
    paid: Cost
    bound: Cost

    act = ASK

    def in_words(self, words: Wording) -> str:
        values = words.partial(self.values)
        return f"all have values: {values}, which costs {cost_text(self.paid)} so far; what does your side add?"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [can_take(*chosen) for chosen in zip(hearing.order, self.values, strict=False)]


class Priced(Message, frozen=True):
    """The cost of the CPA with the receiver's value, now that all robots before have added their own sides."""

    paid: Cost

    act = Act(Performative.INFORM, "the answer to `CPABack` or `FullBack`: what the CPA costs")

    def in_words(self, words: Wording) -> str:
        return f"with {words.receiver}'s value it costs {cost_text(self.paid)} in all"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what the CPA costs that it has sent back."""
        above = hearing.order[: hearing.order.index(hearing.receiver)]
        if not above:
            return NOTHING
        complete = hearing.last(FullBack, hearing.receiver, above[-1])
        if complete is not None:
            return [Total(dict(zip(hearing.order, complete.values, strict=False)), self.paid)]
        taken_up = hearing.last(CPA, above[-1], hearing.receiver)
        asked = next((one for name in above[::-1] if (one := hearing.last(CPABack, hearing.receiver, name))), None)
        if taken_up is None or asked is None or asked.robot != hearing.receiver:
            return NOTHING
        view = dict(zip(above, taken_up.values, strict=False))
        return [Total({**view, hearing.receiver: asked.value}, self.paid)]


class TooCostly(Message, frozen=True):
    """The CPA with the receiver's value costs the bound or more, with the own sides of robots before."""

    act = acts.REJECT_VALUE
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"with {words.receiver}'s value it costs too much"
