"""The messages that NCBB, PT-FB and HS-CAI share (see `branching.py` and `forward_bounding.py`)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    AT_THE_END,
    NOTHING,
    EveryValuePays,
    Hearing,
    Pays,
    Proof,
    SomeValuePays,
    StandsAt,
    can_take,
)
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, listed
from robochoc.protocols import acts

Number = int | float
"""Infinite where something hard is broken, or nothing is known yet; integers stay integers on the wire."""


class Members(Message, frozen=True):
    """For each robot above, the robots of the sender's subtree that share a constraint with it."""

    linked: dict[str, list[str]]

    act = Act(Performative.INFORM, "the receiver comes to know who below it is linked with whom above")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        told = [f"{listed(names)} with {robot}" for robot, names in self.linked.items()]
        return f"in my subtree constraints are shared by {listed(told)}"


class Request(Message, frozen=True):
    """A request for a lower bound on the receiver's cost with this value of the sender."""

    value: Value

    act = Act(Performative.QUERY_REF, "the sender asks for a lower bound on the receiver's cost")

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} for now; what will you cost at least?"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [can_take(hearing.sender, self.value)]


class Report(Message, frozen=True):
    """A lower bound on the sender's own cost, with the values of the receiver and of robots above it."""

    bound: Number

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        if math.isinf(self.bound):
            return "no value of mine is allowed with your value and those above you"
        return f"with your value and those above you, I cost at least {cost_text(self.bound)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver, which may not know the values above it."""
        asked = hearing.last(Request, hearing.receiver, hearing.sender)
        return (
            NOTHING if asked is None else [SomeValuePays(hearing.sender, {hearing.receiver: asked.value}, self.bound)]
        )


class Result(Message, frozen=True):
    """The cost of the sender's subtree and its `values`; infinite, and no values: nothing is below the bound."""

    cost: Number
    values: dict[str, Value]

    act = acts.TELL_BOUNDS

    def in_words(self, words: Wording) -> str:
        if math.isinf(self.cost):
            return "my subtree has nothing that costs less than you allow"
        return f"my subtree costs {cost_text(self.cost)}, with {words.assigned(self.values.items())}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nobody in the subtree pays more than all of them together.

        A sender that shares constraints with the receiver alone answers with the least that it can pay.
        """
        found: list[Proof] = []
        asked = hearing.last(Request, hearing.receiver, hearing.sender)
        view = {} if asked is None else {hearing.receiver: asked.value}
        for robot, value in self.values.items():
            found.append(Pays(robot, value, {**view, **_without(robot, self.values)}, 0, self.cost))
        if asked is not None and hearing.is_only_neighbour():
            found.append(EveryValuePays(hearing.sender, view, self.cost))
        return found


class Terminate(Message, frozen=True):
    """The end of the search: the final values of the receiver's subtree."""

    values: dict[str, Value]

    act = acts.TERMINATE

    def in_words(self, words: Wording) -> str:
        return f"the search is over, with {words.assigned(self.values.items())}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        return [StandsAt(robot, value, AT_THE_END) for robot, value in self.values.items()]


def allowance(bound: Number) -> str:
    """Return what a subtree may cost, in words."""
    return "whatever it costs" if math.isinf(bound) else f"for less than {cost_text(bound)}"


def _without(robot: str, values: dict[str, Value]) -> dict[str, Value]:
    return {other: value for other, value in values.items() if other != robot}
