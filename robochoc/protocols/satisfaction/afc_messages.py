"""Messages of Asynchronous Forward Checking: apart from `afc.py`, as mypyc cannot compile msgspec's classes."""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.protocols import acts
from robochoc.protocols.acts import Act, Performative
from robochoc.protocols.disclosure import INFINITE, EveryValuePays, HasValue, Proof, Reception, partial_assignment
from robochoc.protocols.message import Message, Value
from robochoc.protocols.wording import Wording

Assignments = tuple[Value, ...]
"""A partial assignment: the values of the robots from the first one on, in priority order."""


class CPA(Message, frozen=True):
    """The current partial assignment, to which the receiver adds its value; `sc` is the step counter."""

    assignments: Assignments
    sc: int

    act = acts.PROPOSE_CPA

    def in_words(self, words: Wording) -> str:
        return f"so far {words.partial(self.assignments)}; it is {words.receiver}'s turn"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return _partial(self.assignments, self.sc, reception)


class FcCPA(Message, frozen=True):
    """A copy of the CPA of step `sc`, for forward checking (`FC_CPA`)."""

    assignments: Assignments
    sc: int

    act = Act(Performative.INFORM, "a copy of the CPA, for forward checking; the receiver need not extend it")

    def in_words(self, words: Wording) -> str:
        return f"so far {words.partial(self.assignments)}; look which of your values still go with it"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        return _partial(self.assignments, self.sc, reception)


class NotOk(Message, frozen=True):
    """An inconsistent partial assignment: no solution extends `assignments`; found at step `sc` (`Not_OK`)."""

    assignments: Assignments
    sc: int

    act = Act(Performative.DISCONFIRM, "the receiver assumes that the CPA is consistent, and it has no solution")

    def in_words(self, words: Wording) -> str:
        return f"no solution has {words.partial(self.assignments)}" if self.assignments else "there is no solution"

    def proves(self, reception: Reception) -> Sequence[Proof]:
        # The sender has found it by forward checking, with only its own constraints.
        return [EveryValuePays(reception.sender, dict(zip(reception.branch, self.assignments, strict=False)), INFINITE)]


class BacktrackCPA(Message, frozen=True):
    """The CPA on its way back: no solution extends `assignments` (`backtrack_CPA`).

    Its last value is the receiver's.
    """

    assignments: Assignments
    sc: int

    act = Act(Performative.REJECT_PROPOSAL, "the CPA that was proposed comes back")
    backtracks = True
    # It may follow from any robot's constraints.
    proves_nothing = True

    def in_words(self, words: Wording) -> str:
        return f"no solution has {words.partial(self.assignments)}: take another value"


def _partial(assignments: Assignments, sc: int, reception: Reception) -> Sequence[Proof]:
    """Return the proofs of a consistent CPA of step `sc`."""
    stands = [HasValue(robot, value, (sc,)) for robot, value in zip(reception.branch, assignments, strict=False)]
    return [*stands, *partial_assignment(reception.branch, assignments)]
