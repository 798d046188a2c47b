"""The messages of DPOP (see `dpop`)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    NOTHING,
    HasOnly,
    Hearing,
    Proof,
    StandsAt,
    table_proves,
)
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, cost_text, counted, listed
from robochoc.protocols import acts
from robochoc.protocols.inference.dpop_tables import Width, cells_of, piece_in_words
from robochoc.solver.exact_costs import EXACT

Size = Annotated[int, msgspec.Meta(ge=2)]
Cost = Annotated[int, msgspec.Meta(ge=0, le=EXACT)]
"""2^53 stands for all that is larger, too: it ends the run."""
MOST_CELLS = 4096
"""For larger tables no rule says what they prove: it would take too long."""


class Need(msgspec.Struct, frozen=True, array_like=True, order=True):
    """A memory need: the peak number of `bytes` in arrays of `robot`; the nearest float from 2^53 on."""

    bytes: int | float
    robot: str


class Domain(Message, frozen=True):
    """The sender's domain, for the robots below that share a constraint with it."""

    values: list[Value]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.domain(self.values)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, tuple(self.values))]


class Dimensions(Message, frozen=True):
    """The sender's separator with its domain sizes; `dearest` is an upper bound on the costs in its table.

    `induced_width` is the size of the largest separator in the sender's subtree, `most` the largest memory need there.
    """

    separator: dict[str, Size]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver comes to know how large the sender's table will be")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        cells = counted(math.prod(self.separator.values()), "cell")
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in self.separator.items()])
        return (
            f"my table will have {cells}{' over ' if axes else ''}{axes}, and no cost above {cost_text(self.dearest)};"
            f" from me down the induced width is {self.induced_width},"
            f" and {self.most.robot} needs the most memory, {cost_text(self.most.bytes)} bytes"
        )

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Proceed(Message, frozen=True):
    """Permission to make tables, as the tree's tables fit in memory; with the axes of the receiver's table.

    The axes are the receiver's separator, the nearest robot first.
    """

    separator: list[str]

    act = Act(Performative.REQUEST, "the receiver is to make its table")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        axes = f", over {listed(self.separator)}" if self.separator else ""
        return f"all tables fit: make yours{axes}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class UTIL(Message, frozen=True):
    """A piece of the sender's table, in the order of its cells; its first axis is the nearest robot's.

    `costs` are unsigned integers of `width` bytes, little-endian; the largest number stands for `inf`.
    """

    width: Width
    costs: bytes

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's subtree costs")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return piece_in_words(self.costs, self.width)

    def proves(self, hearing: Hearing) -> Sequence[Proof] | None:
        """Return what the message proves to its receiver. There is no rule for large tables.

        For each combination of values, some value of the sender costs no more than its cell says: all that is below
        costs 0 at least. A sender whose neighbours are all above it has nobody below; then no value costs less.
        """
        axes = axes_of(hearing, hearing.receiver, hearing.sender)
        dimensions = hearing.last(Dimensions, hearing.sender, hearing.receiver)
        if axes is None or dimensions is None:
            return NOTHING  # told in another epoch, or as labels (MB-DPOP)
        shape = [dimensions.separator[robot] for robot in axes]
        cells = cells_of(self.costs, self.width)
        if len(cells) != math.prod(shape) or len(cells) > MOST_CELLS:
            return None
        return table_proves(axes, zip(itertools.product(*map(range, shape)), cells, strict=True), hearing)


class VALUE(Message, frozen=True):
    """The places of the values of the robots in the receiver's separator, in the order of its axes."""

    assignment: list[int]

    act = Act(Performative.INFORM, "the receiver comes to know the values above it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if not self.assignment:
            return "nobody above you has to do with your subtree: take your best value"
        places = listed([str(place + 1) for place in self.assignment])
        return f"by number, the values of the robots in your separator are {places}, the nearest robot first"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        axes = axes_of(hearing, hearing.sender, hearing.receiver)
        if axes is None:
            return NOTHING  # told in another epoch
        known = [(robot, hearing.values(robot), place) for robot, place in zip(axes, self.assignment, strict=True)]
        return [StandsAt(robot, values[place]) for robot, values, place in known if values is not None]


def axes_of(hearing: Hearing, parent: str, child: str) -> Sequence[str] | None:
    """Return the axes of a child's table. None: they were not told in this run."""
    told = hearing.last(Proceed, parent, child)
    return None if told is None else told.separator
