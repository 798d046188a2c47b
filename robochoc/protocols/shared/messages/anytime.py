"""The messages by which robots find the best cycle themselves (see `anytime.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof, can_take
from robochoc.model.wording import Wording, cost_text
from robochoc.protocols import acts

Natural = Annotated[int, msgspec.Meta(ge=0)]


class Place(wire.Message, frozen=True):
    """The sender's place in the breadth-first tree, as far as it knows.

    `parent` is None for a root, `below` the height of its subtree once that is complete, `height` that of the tree.
    """

    root: str
    distance: Natural
    parent: str | None
    below: Natural | None
    height: Natural | None

    act = Act(Performative.INFORM, "the receiver comes to know a root, and how far the sender is from it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        parent = "I am a root" if self.parent is None else f"{self.parent} is my parent, {self.root} my root"
        if self.height is not None:
            return f"{parent}; the tree is complete, with a height of {self.height}"
        return f"{parent}, at a distance of {self.distance}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Step(wire.Message, frozen=True):
    """The sender's value in its next step (a cycle): the receiver may have to charge for it."""

    value: wire.Value

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} in the next step that is to be priced"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [can_take(hearing.sender, self.value)]


class Paid(wire.Message, frozen=True):
    """The cost of the next step in the sender's subtree."""

    cost: int | float

    act = Act(Performative.INFORM, "the receiver adds it to what it pays itself")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"my subtree pays {cost_text(self.cost)} for the next step"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself, as it is a sum over many robots."""
        return NOTHING


class Best(wire.Message, frozen=True):
    """News of the next step: the best one so far is `step` (None: all broke a hard constraint)."""

    step: Natural | None

    act = Act(Performative.INFORM, "the receiver comes to know which of its values to remember")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if self.step is None:
            return "all steps so far broke a hard constraint"
        return f"the best step so far is that of cycle {self.step}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


AnytimeMessage = Place | Step | Paid | Best
"""The messages that every `CycleProtocol` receives besides its own, if it is to find the best cycle."""
