"""The messages of CompAPO (see `compapo.py`)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence

import msgspec

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.disclosure import FINITE, Clash, HasOnly, Hearing, Pays, Proof, StandsAt
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording, counted, listed
from robochoc.protocols import acts

Changes = dict[str, tuple[int, int]]
"""New values of robots: the place in the robot's domain, and how often it has changed its value by then."""
MOST_PROOFS = 4096
"""For constraints with more combinations of values no rule says what they prove: it would take too long."""


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

    def allows(self, places: Iterable[int]) -> bool:
        """Return whether the values at these `places` of the robots are allowed."""
        at = 0
        for place, size in zip(places, self.sizes, strict=True):
            at = at * size + place
        return bool(self.allowed[at >> 3] >> (at & 7) & 1)


class Init(Message, frozen=True):
    """The sender's domain; it begins with the first value (`init`)."""

    values: tuple[Value, ...]

    act = acts.TELL_DOMAIN

    def in_words(self, words: Wording) -> str:
        return words.domain(self.values)

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [HasOnly(hearing.sender, self.values), StandsAt(hearing.sender, self.values[0], (0,))]


class Ok(Message, frozen=True):
    """The sender's new value, and how often it has changed (`ok?`)."""

    value: Value
    count: int

    act = acts.TELL_VALUE

    def in_words(self, words: Wording) -> str:
        return f"{words.own_value(self.value)} from now on"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return [StandsAt(hearing.sender, self.value, (self.count,))]


class Evaluate(Message, frozen=True):
    """The request to join a mediation session with this priority; with `tables`, to send constraints (`evaluate?`)."""

    session: int
    priority: int
    tables: bool

    act = Act(Performative.REQUEST, "the sender wants to mediate, and needs the receiver to keep its value for now")
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
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
        told = f"; my constraints are {counted(len(self.tables), 'table')}" if self.tables else ""
        return f"do mediate: I keep my value number {self.place + 1}{told}"

    def proves(self, hearing: Hearing) -> Sequence[Proof] | None:
        """Return what the message proves to its receiver: the sender's value, and what its constraints allow."""
        if sum(math.prod(table.sizes) for table in self.tables) > MOST_PROOFS:
            return None
        told = [proof for table in self.tables for proof in _table_proves(table, self.tables, hearing)]
        return [*_stands({hearing.sender: (self.place, self.count)}, hearing), *told]


class Wait(Message, frozen=True):
    """The receiver may not mediate now: the sender is in a session of higher priority (`wait!`)."""

    session: int

    act = Act(Performative.REFUSE, "the sender is in a mediation session of higher priority")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "wait with your mediation: another one is going on here that comes first"


class Free(Message, frozen=True):
    """The sender, which told the receiver to wait, is in no session any more."""

    act = Act(Performative.INFORM, "the receiver may ask again to mediate")
    proves_nothing = True

    def in_words(self, _: Wording) -> str:
        return "you need not wait for me any more"


class Assign(Message, frozen=True):
    """The end of a session: the receiver's value, and its neighbours' new ones (`accept!`)."""

    place: int
    changes: Changes

    act = Act(Performative.REQUEST, "the receiver is to take the value that it is given")

    def in_words(self, _: Wording) -> str:
        return f"the mediation is over: take your value number {self.place + 1}{_with(self.changes)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        """Return what the message proves to its receiver, and to its sender of the receiver's value."""
        agreed = hearing.last(Evaluation, hearing.receiver, hearing.sender)
        count = 0 if agreed is None else agreed.count + (agreed.place != self.place)
        return _stands({**self.changes, hearing.receiver: (self.place, count)}, hearing)


class Release(Message, frozen=True):
    """The end of a session for a robot that keeps its value: its neighbours' new values."""

    changes: Changes

    act = Act(Performative.INFORM, "the receiver need not keep its value any more")

    def in_words(self, words: Wording) -> str:
        return f"the mediation is over: {words.variables(words.receiver)} may change again{_with(self.changes)}"

    def proves(self, hearing: Hearing) -> Sequence[Proof]:
        return _stands(self.changes, hearing)


def _with(changes: Changes) -> str:
    """Return the new values of others in words; empty if there are none."""
    told = [f"{robot} now has its value number {place + 1}" for robot, (place, _) in changes.items()]
    return f"; {listed(told)}" if told else ""


def _stands(changes: Changes, hearing: Hearing) -> list[Proof]:
    """Return where robots stand, as far as the observer knows their values."""
    known = [(robot, hearing.values(robot), place, count) for robot, (place, count) in changes.items()]
    return [StandsAt(robot, values[place], (count,)) for robot, values, place, count in known if values is not None]


def _table_proves(table: Table, tables: Sequence[Table], hearing: Hearing) -> Iterator[Proof]:
    """Yield what one of the sender's `tables` proves: which values clash, and which go with all of its constraints.

    Nothing is concluded if the receiver does not know whose values the places stand for.
    """
    values = [hearing.values(robot) for robot in table.robots]
    if any(known is None for known in values):
        return
    within = [other for other in tables if {*other.robots} <= {*table.robots}]
    for places in itertools.product(*map(range, table.sizes)):
        at = dict(zip(table.robots, places, strict=True))
        view = {robot: known[at[robot]] for robot, known in zip(table.robots, values, strict=True) if known is not None}
        if not table.allows(places):
            yield Clash(view)
        elif all(other.allows(at[robot] for robot in other.robots) for other in within):
            yield Pays(hearing.sender, view.pop(hearing.sender), view, 0, FINITE)
