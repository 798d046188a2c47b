"""The messages of CompAPO (see `compapo.py`)."""

from __future__ import annotations

import math

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, counted, listed
from robochoc.protocols import acts

Changes = dict[str, tuple[int, int]]
"""New values of robots: the place in the robot's domain, and how often it has changed its value by then."""


class Table(msgspec.Struct, frozen=True, array_like=True):
    """All constraints over the same robots in one table: a bit for each combination of their values, set if allowed.

    The place of the last robot's value runs fastest; bit i of the table is bit i % 8 of byte i // 8.
    """

    robots: tuple[str, ...]
    sizes: tuple[int, ...]
    allowed: bytes

    def __post_init__(self) -> None:
        """Check that the table is complete."""
        if not len({*self.robots}) == len(self.robots) == len(self.sizes) > 0 or min(self.sizes) < 1:
            raise ValueError("a table does not say how many values each of its robots has")
        if len(self.allowed) != -(-math.prod(self.sizes) // 8):
            raise ValueError("a table does not have a bit for each combination of values")


class Init(Message, frozen=True):
    """The sender's domain; it begins with the first value (`init`)."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.domain(self.values)


class Ok(Message, frozen=True):
    """The sender's new value, and how often it has changed (`ok?`)."""

    value: Value
    count: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"{words.own_value(self.value)} from now on"


class Evaluate(Message, frozen=True):
    """The request to join a mediation session with this priority; with `tables`, to send constraints (`evaluate?`)."""

    session: int
    priority: int
    tables: bool

    act = Act(Performative.REQUEST, "the sender wants to mediate, and needs the receiver to keep its value for now")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        known = f"I know the constraints of {counted(self.priority, 'robot')}"
        more = "; tell me yours" if self.tables else ""
        return f"let me mediate: keep {words.variables(words.receiver)} until I say more ({known}{more})"


class Evaluation(Message, frozen=True):
    """The receiver may mediate: the sender's value, its number of changes, and its constraints if they are wanted.

    The paper's `evaluate!`.
    """

    session: int
    place: int
    count: int
    tables: tuple[Table, ...]

    act = Act(Performative.AGREE, "the sender keeps its value until the mediation session is over")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        told = f"; my constraints are {counted(len(self.tables), 'table')}" if self.tables else ""
        return f"do mediate: I keep my value number {self.place + 1}{told}"


class Wait(Message, frozen=True):
    """The receiver may not mediate now: the sender is in a session of higher priority (`wait!`)."""

    session: int

    act = Act(Performative.REFUSE, "the sender is in a mediation session of higher priority")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "wait with your mediation: another one is going on here that comes first"


class Free(Message, frozen=True):
    """The sender, which told the receiver to wait, is in no session any more."""

    act = Act(Performative.INFORM, "the receiver may ask again to mediate")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return "you need not wait for me any more"


class Assign(Message, frozen=True):
    """The end of a session: the receiver's value, and its neighbours' new ones (`accept!`)."""

    place: int
    changes: Changes

    act = Act(Performative.REQUEST, "the receiver is to take the value that it is given")

    def in_words(self, _: Wording) -> str:
        """Return what the sender says."""
        return f"the mediation is over: take your value number {self.place + 1}{_with(self.changes)}"


class Release(Message, frozen=True):
    """The end of a session for a robot that keeps its value: its neighbours' new values."""

    changes: Changes

    act = Act(Performative.INFORM, "the receiver need not keep its value any more")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"the mediation is over: {words.variables(words.receiver)} may change again{_with(self.changes)}"


def _with(changes: Changes) -> str:
    """Return the new values of others in words; empty if there are none."""
    told = [f"{robot} now has its value number {place + 1}" for robot, (place, _) in changes.items()]
    return f"; {listed(told)}" if told else ""
