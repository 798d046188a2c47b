"""The messages of AFB, under the paper's names (see `afb`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    NOTHING,
    EveryValuePays,
    Hearing,
    Proof,
    SomeValuePays,
    StandsAt,
    Total,
    partial_assignment,
)
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, costs_text, counted, incumbent_text
from robochoc.protocols import acts
from robochoc.protocols.optimization.afb_bounds import Assignment, Cost, stamp_of


class CPA(Message, frozen=True):
    """The current partial assignment, of the robots from the first one on (`CPA_MSG`).

    If its last value is the receiver's own, it was sent back: no extension of it costs less than `bound` (B). On the
    way down, `least` holds a lower bound for each of its prefixes, the empty one first.
    """

    assignments: list[Assignment]
    bound: Cost
    least: list[Cost]

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        if self.least:
            known = incumbent_text(self.bound)
            turn = f"it is {words.receiver}'s turn"
            return f"so far {values}, which costs at least {cost_text(self.least[-1])}; {known}; {turn}"
        if math.isinf(self.bound):
            return f"no solution has {values}: take another value"
        return f"no solution with {values} costs less than {cost_text(self.bound)}: take another value"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the cost of the CPA; sent back, what the last robot pays."""
        values = [value for value, _ in self.assignments]
        found = partial_assignment(hearing.order, values)
        view = dict(zip(hearing.order, values, strict=False))
        if self.least:
            return [*found, Total(view, self.least[-1])]
        sent = hearing.last(CPA, hearing.receiver, hearing.sender)
        if sent and sent.least and sent.assignments == self.assignments and hearing.is_lowest(hearing.sender):
            found.append(EveryValuePays(hearing.sender, view, self.bound - sent.least[-1]))
        return found


class FBCPA(Message, frozen=True):
    """A copy of the CPA down to the sender, which requests the receiver's estimate (`FB_CPA`)."""

    assignments: list[Assignment]

    act = Act(Performative.QUERY_REF, "the sender asks which costs the receiver adds to the CPA")

    def in_words(self, words: Wording) -> str:
        values = words.partial([value for value, _ in self.assignments])
        return f"so far {values}; what does a value of yours add to it at least?"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return partial_assignment(hearing.order, [value for value, _ in self.assignments])


class FBEstimate(Message, frozen=True):
    """Lower bounds on the cost of adding a value of the sender to each prefix of the CPA (`FB_ESTIMATE`).

    The empty prefix is first; the last estimate holds for all longer ones. `stamp` is the CPA's time-stamp.
    """

    stamp: Sequence[int]
    estimates: Sequence[Cost]

    act = Act(Performative.INFORM, "the answer to `FBCPA`")

    def in_words(self, _: Wording) -> str:
        length = counted(len(self.stamp), "value")
        last = f"a value of mine adds at least {cost_text(self.estimates[-1])} to a CPA of {length}"
        shorter = self.estimates[:-1]
        if not shorter:
            return last
        return f"{last}; to its beginnings, the empty one first, at least {costs_text(shorter)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver. The last robot's estimates have nothing of robots below."""
        asked = [
            hearing.last(CPA, hearing.receiver, hearing.sender),
            hearing.last(FBCPA, hearing.receiver, hearing.sender),
        ]
        for_these = [one.assignments for one in asked if one and stamp_of(one.assignments) == [*self.stamp]]
        if not for_these:
            return NOTHING
        found: list[Proof] = []
        values = [value for value, _ in for_these[0]]
        for length, estimate in enumerate(self.estimates):
            view = dict(zip(hearing.order, values[:length], strict=False))
            found.append(SomeValuePays(hearing.sender, view, estimate))
            if hearing.is_lowest(hearing.sender):
                found.append(EveryValuePays(hearing.sender, view, estimate))
        return found


class NewSolution(Message, frozen=True):
    """The best solution so far: the values of all robots in priority order, and their cost B (`NEW_SOLUTION`)."""

    values: list[Value]
    cost: Cost

    act = Act(Performative.INFORM, "the receiver comes to know the best solution so far")

    def in_words(self, words: Wording) -> str:
        return f"the best solution so far costs {cost_text(self.cost)}: {words.partial(self.values)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: a robot takes these values unless it hears of better ones."""
        view = dict(zip(hearing.order, self.values, strict=False))
        return [Total(view, self.cost), *(StandsAt(robot, value) for robot, value in view.items())]


class Terminate(Message, frozen=True):
    """The end of the search: no solution is better than the best one (`TERMINATE`)."""

    act = acts.TERMINATE

    def in_words(self, _: Wording) -> str:
        return "the search is over: no solution is better than the best one so far"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: to the last robot, that its last solution is taken."""
        best = hearing.last(NewSolution, hearing.receiver, hearing.sender)
        if best is None:
            return NOTHING
        return [StandsAt(robot, value) for robot, value in zip(hearing.order, best.values, strict=False)]
