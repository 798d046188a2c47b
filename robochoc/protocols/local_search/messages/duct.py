"""The messages of DUCT (see `duct.py`)."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    Hearing,
    Proof,
    SomeValuePays,
    StandsAt,
    can_take,
)
from robochoc.model.wording import Wording, cost_text, counted, listed


class Separator(wire.Message, frozen=True):
    """The robots above the sender that matter to its subtree, and the most that the subtree can cost.

    That is, without broken hard constraints.
    """

    robots: list[str]
    dearest: int

    act = Act(Performative.INFORM, "the receiver comes to know whose values the sender has to be told")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"my subtree depends on {listed(self.robots)}, and costs {cost_text(self.dearest)} at most"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class SampleContext(wire.Message, frozen=True):
    """The values of the receiver's separator in this sample (CONTEXT)."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver is to take a sample of its subtree for these values")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"sample your subtree with {words.assigned(self.values.items())}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [can_take(*chosen) for chosen in self.values.items()]


class SampleCost(wire.Message, frozen=True):
    """The cost of the sample in the sender's subtree: broken hard constraints, and costs (COST).

    `best`: the least that is known for these values without a broken one, and None before there is any. `hopeless`:
    there is none, whatever the subtree does.
    """

    broken: int
    cost: int
    best: int | None
    hopeless: bool

    act = Act(Performative.INFORM, "the receiver comes to know what its sample costs below")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        broken = f", and breaks {counted(self.broken, 'constraint')}" if self.broken else ""
        if self.hopeless:
            best = "with these values there is no solution"
        else:
            best = "no solution yet" if self.best is None else f"the best so far costs {cost_text(self.best)}"
        return f"this sample costs my subtree {cost_text(self.cost)}{broken}; {best}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the sender pays no more than its subtree does.

        If all its neighbours are in the context, nobody is below, and what is hopeless is so by its own constraints.
        """
        asked = hearing.last(SampleContext, hearing.receiver, hearing.sender)
        if asked is None:
            return NOTHING
        found: list[Proof] = []
        if not self.broken:
            found.append(SomeValuePays(hearing.sender, asked.values, self.cost))
        if self.best is not None:
            found.append(SomeValuePays(hearing.sender, asked.values, self.best))
        if self.hopeless and asked.values.keys() >= set(hearing.neighbours(hearing.sender)):
            found.append(EveryValuePays(hearing.sender, asked.values, INFINITE))
        return found


class Fixed(wire.Message, frozen=True):
    """The values of the receiver's separator in the end: it goes on sampling for these only."""

    values: dict[str, wire.Value]

    act = Act(Performative.REQUEST, "the receiver is to choose its value for good, for these values")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.assigned(self.values.items())} for good; choose your own value"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [StandsAt(*chosen) for chosen in self.values.items()]
