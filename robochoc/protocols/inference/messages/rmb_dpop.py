"""The messages of RMB-DPOP (see `rmb_dpop`); others are DPOP's and MB-DPOP's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Proof
from robochoc.model.message import Message
from robochoc.model.wording import Wording, cost_text, counted, listed
from robochoc.protocols.inference.dpop_tables import Width, piece_in_words
from robochoc.protocols.inference.messages.dpop import Cost, Need, Size
from robochoc.protocols.inference.messages.mb_dpop import Axis, Depth


class Candidate(msgspec.Struct, frozen=True, array_like=True):
    """A robot that may be cut: the size of its domain, its depth, and the robots that this would relieve.

    `relieved` is the number of robots with too large a separator that it belongs to; `lowest` is the depth of the
    lowest of them.
    """

    size: Size
    depth: Depth
    relieved: Annotated[int, msgspec.Meta(ge=1)]
    lowest: Depth


class ClusterLabel(Message, frozen=True):
    """The sender's separator; where this is too large, also who may be cut for the sender and its cluster below.

    `dearest`, `induced_width` and `most` are those of DPOP's `Dimensions`.
    """

    separator: dict[str, Axis]
    candidates: dict[str, Candidate]
    dearest: Cost
    induced_width: int
    most: Need

    act = Act(Performative.INFORM, "the receiver comes to know the sender's table, and who may be fixed for it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        sizes = {name: axis.size for name, axis in self.separator.items()}
        axes = listed([f"{robot} ({counted(size, 'value')})" for robot, size in sizes.items()])
        cells = counted(math.prod(sizes.values()), "cell")
        over = " over " if axes else ""
        table = f"my table has {cells}{over}{axes}, and no cost above {cost_text(self.dearest)}"
        return f"{table}; {_in_words(self.candidates)}" if self.candidates else table

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class SepDegree(Message, frozen=True):
    """The robots that may still be cut for the cluster below; `most` is the largest memory need there by now."""

    candidates: dict[str, Candidate]
    most: Need

    act = Act(Performative.INFORM, "the receiver comes to know who else may be fixed")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return _in_words(self.candidates) if self.candidates else "from me down, all tables are small enough"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Allocation(Message, frozen=True):
    """The cluster root's choice: `robot` is cut, and fixed for the tables that it makes too large."""

    robot: str

    act = Act(Performative.REQUEST, "the receiver is to make its tables for fixed values of one more robot")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"{self.robot} will be fixed; who else may be?"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class CutUTIL(Message, frozen=True):
    """A piece of the sender's table, as in UTIL; with the best values of the cut robots from the sender down.

    `places` has a row for each of these robots, in the order of their allocation, with a place for each cell.
    """

    width: Width
    costs: bytes
    places: bytes

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's subtree costs, and the values for it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        values = counted(len(self.places), "byte")
        return f"{piece_in_words(self.costs, self.width)}, with the values that are fixed for them ({values})"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class CutValue(Message, frozen=True):
    """The optimal values, as places, of the receiver's cut robots: those above it, then those from it down."""

    values: list[int]

    act = Act(Performative.REQUEST, "the receiver is to make its table for the optimal values")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        places = listed([str(place + 1) for place in self.values])
        return f"the best values of the robots that are fixed for you, or for others below, are by number {places}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


def _in_words(candidates: dict[str, Candidate]) -> str:
    told = [f"{robot} (for {counted(one.relieved, 'table')})" for robot, one in candidates.items()]
    return f"from me down, tables are too large, unless robots are fixed: {listed(told)}"
