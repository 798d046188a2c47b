"""The messages of MB-DPOP (see `mb_dpop`); others are DPOP's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, HasOnly, Hearing, Proof
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, counted, listed
from robochoc.protocols import acts
from robochoc.protocols.inference.messages.dpop import Cost, Need, Size

Depth = Annotated[int, msgspec.Meta(ge=0)]


class DomainAtDepth(Message, frozen=True):
    """The sender's domain and its depth in the tree, for the robots below that share a constraint with it."""

    depth: Depth
    values: list[Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{counted(self.depth, 'robot')} above me in the tree; {words.domain(self.values)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, tuple(self.values))]


class Axis(msgspec.Struct, frozen=True, array_like=True):
    """A robot of a separator: the size of its domain, and its depth in the tree."""

    size: Size
    depth: Depth


class Label(Message, frozen=True):
    """The sender's label: its separator, and its list of cycle-cut robots with the sizes of their domains.

    While these have fixed values, the sender's table has axes for the rest of the separator only. `dearest`,
    `induced_width` and `most` are those of DPOP's `Dimensions`.
    """

    separator: dict[str, Axis]
    cut: dict[str, Size]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver comes to know the sender's table, and who is fixed for it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        free = {name: axis.size for name, axis in self.separator.items() if name not in self.cut}
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in free.items()])
        cells = counted(math.prod(free.values()), "cell")
        fixed = f"while {listed(self.cut)} {'is' if len(self.cut) == 1 else 'are'} fixed, " if self.cut else ""
        return (
            f"{fixed}my table has {cells}{' over ' if axes else ''}{axes}, and no cost above {cost_text(self.dearest)}"
        )

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Context(Message, frozen=True):
    """Fixed values, as places, for the robots of the receiver's list of cycle-cut robots, in that order."""

    values: list[int]

    act = Act(Performative.REQUEST, "the receiver is to make its table for these values")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        places = listed([str(place + 1) for place in self.values])
        return f"make your table for these values of the robots that are fixed, by number: {places}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING
