"""Messages of AFC-ng, separate from `afc_ng.py` because mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import AT_THE_END, HasValue, Proof, Reception, partial_assignment
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording

Assignment = tuple[Value, int]
"""A robot's value, and the number of values that it has taken so far."""


class CPA(Message, frozen=True):
    """The current partial assignment: the values of all robots from the highest down to the sender (`cpa`)."""

    assignments: tuple[Assignment, ...]

    act = acts.PROPOSE_CPA
    shareable = True

    def in_words(self, words: Wording) -> str:
        return f"so far {words.partial([value for value, _ in self.assignments])}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        values = [value for value, _ in self.assignments]
        counters = tuple([counter for _, counter in self.assignments])
        stands = [
            HasValue(robot, value, counters[: place + 1])
            for place, (robot, value) in enumerate(zip(reception.branch, values, strict=False))
        ]
        return [*stands, *partial_assignment(reception.branch, values)]


class Solved(Message, frozen=True):
    """The end of the search: a solution was found (`stp`). Receivers do not modify the message."""

    solution: dict[str, Value]

    shareable = True
    act = Act(Performative.INFORM, "the receiver learns the solution")

    def in_words(self, words: Wording) -> str:
        return f"a solution is found, and the search is over: {words.assigned(self.solution.items())}"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        robots = [robot for robot in reception.order if robot in self.solution]
        values = [self.solution[robot] for robot in robots]
        return [*(HasValue(*one, AT_THE_END) for one in self.solution.items()), *partial_assignment(robots, values)]
