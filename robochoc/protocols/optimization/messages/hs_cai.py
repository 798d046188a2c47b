"""The messages of HS-CAI, besides those of all searches in branches (see `hs_cai.py`)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from robochoc.model import message
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import HasOnly, Hearing, Proof, table_proves
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, listed
from robochoc.protocols import acts
from robochoc.protocols.optimization.messages.branching import Number, allowance

Axis = tuple[str, int, int]
"""A robot, its depth in the tree, and the number of its values."""


class Domain(Message, frozen=True):
    """The sender's values, and its depth in the tree."""

    values: list[message.Value]
    level: int

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return f"{words.domain(self.values)}; my depth in the tree is {self.level}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [HasOnly(hearing.sender, tuple(self.values))]


class PreUtil(Message, frozen=True):
    """A lower bound on the cost of the sender's subtree for all values of the robots of `axes` (PREUTIL).

    `dropped`: other robots above that matter to the subtree; the bound holds whatever their values are. `dearest`: no
    solution of the subtree costs more.
    """

    axes: list[Axis]
    dropped: list[Axis]
    dearest: int
    costs: list[Number]

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        names = listed(name for name, _, _ in self.axes)
        told = f"my subtree costs {span_in_words(self.costs)}, by the values of {names or 'nobody'}"
        return f"{told}; left out: {listed(name for name, _, _ in self.dropped)}" if self.dropped else told

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return bounds_prove(self.axes, self.costs, hearing)


class CPA(Message, frozen=True):
    """A request to search the receiver's subtree for less than `bound` (CPA).

    `places`: of the robots above that matter to it, the places of their values in their domains.
    """

    bound: Number
    places: dict[str, int]

    act = acts.PROPOSE_CPA
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"search your subtree {allowance(self.bound)}, with {places_in_words(self.places)}"


class InferCtxt(Message, frozen=True):
    """A request for a tighter table, with the values at these places (INFERCTXT)."""

    places: dict[str, int]

    act = Act(Performative.REQUEST, "the receiver is to infer a tighter lower bound")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return f"what does your subtree cost at least with {places_in_words(self.places)}?"


class CtxtUtil(Message, frozen=True):
    """A lower bound as in PREUTIL, with the values that the receiver's request named (CTXTUTIL)."""

    axes: list[Axis]
    costs: list[Number]

    act = acts.TELL_BOUNDS

    def in_words(self, _: Wording) -> str:
        names = listed(name for name, _, _ in self.axes)
        return f"with these values my subtree costs {span_in_words(self.costs)}, by the values of {names or 'nobody'}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver, whichever request it answers."""
        return bounds_prove(self.axes, self.costs, hearing)


def places_in_words(places: dict[str, int]) -> str:
    """Return values, by their places."""
    return listed([f"{name}'s value number {place + 1}" for name, place in places.items()]) or "any values"


def span_in_words(costs: list[Number]) -> str:
    """Return between what and what lower bounds are: `at least 3 to 9`."""
    finite = [cost for cost in costs if not math.isinf(cost)]
    if not finite:
        return "infinity"
    least, most = min(finite), max(finite)
    return f"at least {cost_text(least)}{'' if least == most else f' to {cost_text(most)}'}"


def bounds_prove(axes: Sequence[Axis], costs: Sequence[Number], hearing: Hearing) -> Sequence[Proof]:
    """Return what lower bounds over `axes` prove: as much as a table of DPOP, as they hold whatever is left out."""
    places = itertools.product(*[range(size) for _, _, size in axes])
    return table_proves([name for name, _, _ in axes], zip(places, costs, strict=True), hearing)
