"""The messages of synchronous backtracking (see `sbt.py`)."""

from __future__ import annotations

from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording
from robochoc.protocols import acts


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots before the receiver, in priority order."""

    assignments: tuple[Value, ...]

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"so far {words.partial(self.assignments)}; it is {words.receiver}'s turn"


class Backtrack(Message, frozen=True):
    """A request to take the next value: no robot below has a value that agrees with the receiver's."""

    act = acts.REJECT_VALUE
    backtracks = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"nobody below {words.receiver} has a value left that goes with its own: take another one"
