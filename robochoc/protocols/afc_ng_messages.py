"""The messages of nogood-based Asynchronous Forward Checking (see `afc_ng.py`)."""

from __future__ import annotations

from robochoc.model.communicative_acts import Act, Performative
from robochoc.model.message import Message, Value
from robochoc.model.wording import Wording
from robochoc.protocols import acts

Assignment = tuple[Value, int]
"""A robot's value, and the counter that says how many it has taken so far."""


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots from the highest down to the sender (`cpa`)."""

    assignments: list[Assignment]

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"so far {words.partial([value for value, _ in self.assignments])}"


class Nogood(Message, frozen=True):
    """A nogood: the receiver cannot take `value` while all assignments in `lhs` hold (`ngd`)."""

    lhs: dict[str, Value]
    value: Value

    act = acts.RULE_OUT
    backtracks = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return words.nogood(self.lhs, self.value)


class Solved(Message, frozen=True):
    """The end of the search: a solution was found (`stp`)."""

    solution: dict[str, Value]

    act = Act(Performative.INFORM, "the receiver comes to know the solution")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"a solution is found, and the search is over: {words.assigned(self.solution.items())}"
