"""Votes by which at most one master decides for a team, even if masters die, return, or are cut off. Pure.

The rules are those of Paxos with a single decision (Lamport, "Paxos Made Simple", 2001). Robots are the acceptors and
masters the proposers. Each master that leads a team has a `Term` that no other master has. A robot promises a term,
and from then on votes in no earlier term (fencing). A master may search when a majority of the team has promised its
term, and may publish a decision when a majority has accepted the decision in its term. Two majorities have a common
robot, so a later master receives the decision that an earlier master may have published, and proposes it again.

The team is the one that the first master closed. Lost robots still count, so a minority never decides. Each robot must
store its `Votes` before it sends them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, NamedTuple, TypeVar

Decision = TypeVar("Decision")


class Term(NamedTuple):
    """A period in which one master leads. Later terms have larger numbers; `run` identifies the master's run."""

    number: int
    run: str

    def after(self, others: Iterable[Term]) -> Term:
        """Return a term of the same run that is later than all `others`."""
        return Term(1 + max((self.number, *(other.number for other in others))), self.run)


NO_TERM = Term(0, "")
"""The term before all others."""


class Acceptance(NamedTuple, Generic[Decision]):
    """A decision, and the latest term in which a robot has accepted it."""

    term: Term
    decision: Decision


class Votes(NamedTuple, Generic[Decision]):
    """The votes of a robot: the latest term that it has promised, and the decision that it has accepted, if any."""

    promised: Term = NO_TERM
    accepted: Acceptance[Decision] | None = None

    def promise(self, term: Term) -> Votes[Decision] | None:
        """Return the votes with a promise for `term`, or None if a later term was promised."""
        return None if term < self.promised else Votes(term, self.accepted)

    def accept(self, term: Term, decision: Decision) -> Votes[Decision] | None:
        """Return the votes after `decision` was accepted in `term`, or None if a later term was promised."""
        return None if term < self.promised else Votes(term, Acceptance(term, decision))


class Leadership(NamedTuple, Generic[Decision]):
    """The leadership of one master in `term`, for the robots in `team`.

    Attributes:
        term: The term. No other master has the same term, and the master has no second leadership in it.
        team: The names of the robots in the team when it was first closed.
        promises: The robots that have promised the term, with the decision that each had accepted before.
        proposed: The decision proposed to the robots, or None.
        acceptances: The robots that have accepted the proposed decision.
    """

    term: Term
    team: frozenset[str]
    promises: frozenset[tuple[str, Acceptance[Decision] | None]] = frozenset()
    proposed: Decision | None = None
    acceptances: frozenset[str] = frozenset()

    @property
    def needed(self) -> int:
        """The number of votes that are a majority of the team."""
        return len(self.team) // 2 + 1

    @property
    def promised(self) -> frozenset[str]:
        """The robots that have promised the term."""
        return frozenset(robot for robot, _accepted in self.promises)

    @property
    def may_search(self) -> bool:
        """True if a majority has promised the term."""
        return len(self.promises) >= self.needed

    @property
    def may_publish(self) -> bool:
        """True if a majority has accepted the proposed decision in this term."""
        return self.proposed is not None and len(self.acceptances) >= self.needed

    @property
    def inherited(self) -> Decision | None:
        """The decision that an earlier master may have published, and that must be proposed again, or None."""
        earlier = [accepted for _robot, accepted in self.promises if accepted is not None]
        return max(earlier, key=lambda accepted: accepted.term).decision if earlier else None

    def note_promise(self, robot: str, accepted: Acceptance[Decision] | None) -> Leadership[Decision]:
        """Return the leadership with a robot's promise. Repeated promises, and those of other robots, do not count."""
        if robot not in self.team or robot in self.promised:
            return self
        return self._replace(promises=self.promises | {(robot, accepted)})

    def propose(self, decision: Decision) -> Leadership[Decision]:
        """Return the leadership with a proposal: the inherited decision, or `decision` if there is none.

        The first proposal counts. Raises `ValueError` without a majority of promises.
        """
        if not self.may_search:
            raise ValueError("a decision requires promises from a majority of the team")
        if self.proposed is not None:
            return self
        inherited = self.inherited
        return self._replace(proposed=decision if inherited is None else inherited)

    def note_acceptance(self, robot: str) -> Leadership[Decision]:
        """Return the leadership after a robot has accepted the proposed decision in this term."""
        if robot not in self.team or self.proposed is None:
            return self
        return self._replace(acceptances=self.acceptances | {robot})
