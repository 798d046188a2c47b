"""The messages of k-opt (see `kopt.py`): what spreads from robot to robot, a link further in each phase."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from operator import add
from typing import Annotated

import msgspec

from robochoc.model import message as wire
from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import NOTHING, Hearing, Pays, Proof
from robochoc.model.wording import Wording, counted, listed
from robochoc.protocols import acts
from robochoc.protocols.local_search.messages.mgm import saving_in_words

Place = Annotated[int, msgspec.Meta(ge=0)]


class Table(msgspec.Struct, frozen=True, array_like=True):
    """The costs of a constraint for all places of the values of `scope`, the last robot's changing first.

    The robots are in priority order. `inf` stands for a violated hard constraint.
    """

    scope: list[str]
    costs: list[int | float]


class Part(msgspec.Struct, frozen=True, array_like=True):
    """A robot's part of the problem: what each of its values costs, and the constraints in which it is the highest."""

    charges: list[int | float]
    tables: list[Table]


class Region(wire.Message, frozen=True):
    """The parts of robots that are new to the sender."""

    parts: dict[str, Part]

    act = Act(Performative.INFORM, "the receiver comes to know the constraints of robots around")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if not self.parts:
            return "I have heard of no other robots' constraints"
        tables = sum(len(part.tables) for part in self.parts.values())
        return f"{counted(tables, 'constraint')} of {listed(self.parts)}, value by value"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: what values cost by themselves, and in pairs of robots.

        Constraints of more robots are left out: others of the same robots may stand in other messages.
        """
        return [proof for robot, part in self.parts.items() for proof in _part_proves(robot, part, hearing)]


class Values(wire.Message, frozen=True):
    """The places of the values of robots that have moved, as far as they are new to the sender."""

    places: dict[str, Place]

    act = acts.TELL_VALUE

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        moved = [f"{robot} has its value number {place + 1}" for robot, place in self.places.items()]
        return listed(moved) or "I have heard of nobody who has moved"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


class Offer(msgspec.Struct, frozen=True, array_like=True):
    """A move of several robots: the places of their new values, and the gain (broken hard constraints, and costs)."""

    broken: int
    cost: int | float
    moves: dict[str, Place]


class Offers(wire.Message, frozen=True):
    """The best moves that robots have found, by robot, as far as they are new to the sender."""

    offers: dict[str, Offer]

    act = Act(Performative.PROPOSE, "what robots around would save by moving together")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        if not self.offers:
            return "I have heard of no move that saves anything"
        said = [
            f"{listed(offer.moves)} would save {saving_in_words(offer.broken, offer.cost)}"
            for offer in self.offers.values()
        ]
        return f"{'; '.join(said)}"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: nothing by itself, as the moves are of several robots."""
        return NOTHING


class MoveTogether(wire.Message, frozen=True):
    """The moves that are made: the places of the robots' new values, as far as they are new to the sender."""

    moves: dict[str, Place]

    act = Act(Performative.REQUEST, "the robots of a group are to move")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"go: {listed(self.moves)}" if self.moves else "I have heard of no move that is made"

    def proves(self, _: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return NOTHING


def _part_proves(robot: str, part: Part, hearing: Hearing) -> Iterator[Proof]:
    """Yield what a robot's part proves, as far as the receiver knows whose values its numbers stand for."""
    values = hearing.values(robot)
    if values is None:
        return
    for value, charge in zip(values, part.charges, strict=True):
        yield Pays(robot, value, {}, charge, charge)
    for other, costs in _pairs(robot, part).items():
        theirs = hearing.values(other) or ()
        rows = itertools.product(zip(values, part.charges, strict=True), theirs)
        for ((value, charge), their), cost in zip(rows, costs, strict=False):
            yield Pays(robot, value, {other: their}, charge + cost, charge + cost)


def _pairs(robot: str, part: Part) -> dict[str, list[int | float]]:
    """Return, for each other robot, the costs of all constraints over the two robots together."""
    found: dict[str, list[int | float]] = {}
    for table in part.tables:
        if len(table.scope) == len((robot, "other")):
            other = table.scope[-1]
            before = found.get(other)
            found[other] = table.costs if before is None else list(map(add, before, table.costs))
    return found
