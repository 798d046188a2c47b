"""Messages of synchronous backtracking, separate from `sbt.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.disclosure import (
    INFINITE,
    NOTHING,
    EveryValuePays,
    HasValue,
    Proof,
    Reception,
    partial_assignment,
)
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots before the receiver, in priority order."""

    assignments: tuple[Value, ...]

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        return f"so far {words.partial(self.assignments)}; it is {words.receiver}'s turn"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        stands = [HasValue(robot, value) for robot, value in zip(reception.branch, self.assignments, strict=False)]
        return [*stands, *partial_assignment(reception.branch, self.assignments)]


class Backtrack(Message, frozen=True):
    """A request to take the next value: no robot below has a value that is consistent with the receiver's."""

    act = acts.REJECT_VALUE
    backtracks = True

    def in_words(self, words: Wording) -> str:
        return f"nobody below {words.receiver} has a value left that goes with its own: take another one"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        cpa = reception.last(CPA, reception.receiver, reception.sender)
        if cpa is None or not reception.is_lowest(reception.sender):
            return NOTHING
        return [EveryValuePays(reception.sender, dict(zip(reception.branch, cpa.assignments, strict=False)), INFINITE)]
