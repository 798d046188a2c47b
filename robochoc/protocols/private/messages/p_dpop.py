"""The messages of P-DPOP (see `p_dpop`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    HasOnly,
    Hearing,
    Proof,
    SomeValuePays,
    StandsAt,
)
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, counted
from robochoc.protocols import acts

WIDTH = 16
"""Bytes of a cell, and of a key."""
BROKEN = 1 << 60
"""The cost of a hard constraint that is broken: above all finite costs, and hidden by keys like these."""
Shape = dict[str, int]
"""The axes of a table: codenames, and how many codes each has."""


class Codes(Message, frozen=True):
    """Codes and keys for the sender's values, by which a neighbour below speaks of them without telling others.

    `codename` stands for the sender; the code of a value is its place in `values`, which are in a random order. `keys`
    has a random key for each of them, which is added to what a table says of it.
    """

    codename: str
    values: list[Value]
    keys: bytes

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"call me {self.codename[:4]}; {words.domain(self.values)}, and you get a key for each"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver."""
        return [HasOnly(hearing.sender, tuple(self.values))]


class UTIL(Message, frozen=True):
    """The sender's table, by codenames and codes: minimum costs of its subtree, each with keys added.

    The last axis changes fastest. Cells have `WIDTH` bytes, little-endian.
    """

    axes: Shape
    cells: bytes

    act = Act(Performative.INFORM, "the receiver comes to know what the sender's subtree costs")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        axes = counted(len(self.axes), "codename")
        return f"a table over {axes}: {counted(len(self.cells) // WIDTH, 'cost')}, hidden by keys"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: something only if no other robot's key is in it.

        Then all that is below the sender shares constraints with the receiver alone, which can subtract its keys.
        """
        subtree = _without(hearing)
        near = [robot for robot in sorted(subtree) if robot in hearing.neighbours(hearing.receiver)]
        told = [hearing.last(Codes, hearing.receiver, robot) for robot in near]
        codes = [one for one in told if one is not None]
        if len(codes) < len(told) or list(self.axes) != [codes[0].codename]:
            return NOTHING
        found: list[Proof] = []
        keys = map(sum, zip(*(numbers(one.keys) for one in codes), strict=True))
        for value, cell, key in zip(codes[0].values, numbers(self.cells), keys, strict=True):
            cost = cell - key
            paid = INFINITE if cost >= BROKEN else cost
            found.append(SomeValuePays(hearing.sender, {hearing.receiver: value}, paid))
            if len(subtree) == 1:
                found.append(EveryValuePays(hearing.sender, {hearing.receiver: value}, paid))
        return found


class VALUE(Message, frozen=True):
    """The codes of the values above the receiver, by the codenames of its table."""

    codes: Shape

    act = Act(Performative.INFORM, "the receiver comes to know the values above it")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"the codes of {counted(len(self.codes), 'value')} above you"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver: the values of robots that have told it their codes."""
        told = {robot: hearing.last(Codes, robot, hearing.receiver) for robot in hearing.neighbours(hearing.receiver)}
        return [
            StandsAt(robot, codes.values[self.codes[codes.codename]])
            for robot, codes in sorted(told.items())
            if codes is not None and codes.codename in self.codes
        ]


def numbers(packed: bytes) -> list[int]:
    """Return the cells of a table, or keys."""
    return [int.from_bytes(packed[at : at + WIDTH], "little") for at in range(0, len(packed), WIDTH)]


def packed(cells: Iterable[int]) -> bytes:
    """Return cells, or keys, as they travel."""
    return b"".join([cell.to_bytes(WIDTH, "little") for cell in cells])


def cells_of(shape: Shape) -> int:
    """Return the number of cells of a table; nothing is allocated."""
    return math.prod(shape.values())


def _without(hearing: Hearing) -> set[str]:
    """Return the robots that are connected with the sender without the receiver."""
    found = {hearing.sender}
    waiting = [hearing.sender]
    while waiting:
        for robot in hearing.neighbours(waiting.pop()):
            if robot not in found and robot != hearing.receiver:
                found.add(robot)
                waiting.append(robot)
    return found
