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

    assignments: tuple[Assignment, ...]

    act = acts.PROPOSE_CPA
    shareable = True

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"so far {words.partial([value for value, _ in self.assignments])}"


class Solved(Message, frozen=True):
    """The end of the search: a solution was found (`stp`). Its receivers only look it up."""

    solution: dict[str, Value]

    shareable = True
    act = Act(Performative.INFORM, "the receiver comes to know the solution")

    def in_words(self, words: Wording) -> str:
        """Return what the sender says."""
        return f"a solution is found, and the search is over: {words.assigned(self.solution.items())}"
