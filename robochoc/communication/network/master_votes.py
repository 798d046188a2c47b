"""The master's side of the votes by which at most one master decides for a team. See `leadership.py`.

Votes are needed if a robot knows several masters. The masters that lead the same robots one after the other share a
mission, which is named after the run of the master that closed the team. A later master learns the mission and its
team from the robots. Pure.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from robochoc.communication.network.control_messages import (
    Accepted,
    Lead,
    Promised,
    Propose,
    Standing,
    TeamDecision,
)
from robochoc.communication.network.framing import MASTER
from robochoc.communication.network.leadership import NO_TERM, Acceptance, Leadership, Term
from robochoc.communication.search_result import RobotsLostError
from robochoc.system.errors import RobochocError

_NAMED = 5
LAST_TERM = 1_000_000
"""A term that is never reached, since a takeover needs seconds, and certificates expire after a day."""


class NoMajorityError(RobotsLostError):
    """Raised if a master has no votes from a majority of the team. Another master may have them."""

    def __init__(self, why: str) -> None:
        super().__init__({MASTER: why})
        self.args = (why,)


class SupersededError(RobochocError):
    """Raised if a master with a higher priority leads before this one has closed a team."""


class MasterVotes:
    """The votes for the master `name` in its run `run`.

    Attributes:
        is_needed: True if a robot knows several masters.
        mission: The mission of the robots; empty before their first promise to any master.
        team: The robots in the mission; empty before their first promise.
        leadership: The leadership of this master, or None before it asked for votes.
    """

    def __init__(self, run: str, name: str) -> None:
        self.name = name
        self.is_needed = False
        self.mission = ""
        self.team: tuple[str, ...] = ()
        self.leadership: Leadership[TeamDecision] | None = None
        self._run = run
        self._seen: set[Term] = {NO_TERM}
        self._values: dict[str, dict[str, dict[str, int]]] = {}

    @property
    def term(self) -> int | None:
        """The number of the master's term, or None if it needs no votes."""
        return self.leadership.term.number if self.leadership else None

    @property
    def is_takeover(self) -> bool:
        """True if another master closed the team."""
        return bool(self.mission) and self.mission != self._run

    def admit(self, standing: Standing | None, *, closed: bool) -> str:
        """Consider the standing of a robot that registers. Return why the robot cannot be admitted, or an empty text.

        Args:
            standing: The robot's standing, or None if it knows only this master.
            closed: True if the team of this master is complete.
        """
        if standing is None:
            return ""
        if standing.promised.number > LAST_TERM:
            return f"it has promised term {standing.promised.number}, which no master can have reached"
        self.is_needed = True
        self._seen.add(standing.promised)
        if standing.mission in {"", self.mission}:
            return ""
        if self.mission or closed:
            return "it takes part in the run of other robots, which another master has started"
        self.mission, self.team = standing.mission, standing.team
        return ""

    def start(self, order: Sequence[str]) -> Lead:
        """Begin a term that is later than all known ones. Return the request for the robots in `order`."""
        self.mission, self.team = self.mission or self._run, self.team or tuple(order)
        term = Term(0, self._run).after(self._seen)
        self.leadership = Leadership(term, frozenset(self.team))
        return Lead(term, self.mission, self.team)

    def note(self, name: str, answer: Promised | Accepted) -> str:
        """Record a robot's answer. Return why it is not a vote for this master, or an empty text."""
        if self.leadership is None or answer.term != self.leadership.term:
            return "it has voted in a term that this master did not ask for"
        if answer.promised != answer.term:
            return f"it has voted for another master in term {answer.promised.number}"
        if isinstance(answer, Accepted):
            self.leadership = self.leadership.note_acceptance(name)
            return ""
        self._values[name] = answer.values
        accepted = None if answer.accepted is None else Acceptance(*answer.accepted)
        self.leadership = self.leadership.note_promise(name, accepted)
        return ""

    def propose(self, decision: TeamDecision) -> Propose:
        """Return the proposal of `decision`, or of the decision that an earlier master may have published."""
        if self.leadership is None:
            raise AssertionError
        self.leadership = self.leadership.propose(decision)
        if self.leadership.proposed is None:
            raise AssertionError
        return Propose(self.leadership.term, self.leadership.proposed)

    @property
    def last_values(self) -> dict[str, dict[str, int]]:
        """The robots' values in their latest run, by robot."""
        return {name: next(reversed(found.values())) for name, found in self._values.items() if found}

    def decided_values(self, decision: TeamDecision) -> dict[str, dict[str, int]]:
        """Return the robots' values in a decision, by robot, as far as the robots have voted for this master."""
        return {name: self._values.get(name, {}).get(decision.run, {}) for name in decision.robots}

    @property
    def inherited(self) -> TeamDecision | None:
        """The decision that an earlier master may have published, or None."""
        return self.leadership.inherited if self.leadership else None

    @property
    def promised(self) -> frozenset[str]:
        """The robots that have promised the term of this master."""
        return self.leadership.promised if self.leadership else frozenset()

    @property
    def accepted(self) -> frozenset[str]:
        """The robots that have accepted the proposed decision."""
        return self.leadership.acceptances if self.leadership else frozenset()

    @property
    def reason(self) -> str:
        """The reason why this master leads, in words."""
        votes = f"{len(self.promised)} of {len(self.team)} robots have promised it"
        return f"the previous master is gone, and {votes}" if self.is_takeover else votes

    def check_team(self, present: Collection[str]) -> None:
        """Raise `NoMajorityError` if the robots `present` are a minority of the team that another master closed."""
        self._check(Leadership(NO_TERM, frozenset(self.team)), set(self.team) & set(present), "here")

    def check_majority(self, present: Collection[str]) -> None:
        """Raise `NoMajorityError` if the robots `present` are a minority of the team."""
        if self.leadership is not None:
            self._check(self.leadership, self.leadership.team & set(present), "connected")

    def check_promises(self) -> None:
        """Raise `NoMajorityError` without the promises of a majority."""
        if self.leadership is not None and not self.leadership.may_search:
            self._check(self.leadership, self.leadership.promised, "for this master")

    def check_acceptances(self) -> None:
        """Raise `NoMajorityError` if no majority has accepted the proposed decision."""
        if self.leadership is not None and not self.leadership.may_publish:
            self._check(self.leadership, self.leadership.acceptances, "for the decision")

    def _check(self, leadership: Leadership[TeamDecision], robots: Collection[str], what: str) -> None:
        if len(robots) < leadership.needed:
            missing = sorted(leadership.team - set(robots))
            more = f" and {len(missing) - _NAMED} more" * (len(missing) > _NAMED)
            raise NoMajorityError(
                f"{len(robots)} of {len(leadership.team)} robots are {what}, and a decision needs {leadership.needed},"
                f" so that no other master can decide differently; missing: {', '.join(missing[:_NAMED])}{more}"
            )
