"""Answers while a search goes on: the best by the deadline is published, and what is better until the time is over.

The robots search on. At times they tell what they have (`communication/search_watch.py`); that is checked with the
files as any answer is. What is published only gets better, and satisfies all hard constraints.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

from robochoc.communication.search_result import SearchResult
from robochoc.communication.search_watch import SearchWatch
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import Answer, EpochOutcome, Improvement, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.run.evaluation import PhaseAnswer, Search, evaluate_search
from robochoc.run.options import Options
from robochoc.run.phases import RunPhase
from robochoc.verification.checker import RefutedError

PERIOD_S = 0.1
"""The shortest time between two snapshots. Where they take long, there are fewer: see `_SHARE`."""
_SHARE = 10
"""After a snapshot the search continues for at least this many times the snapshot's duration."""
_FOUND = frozenset({Verdict.SOLUTION, Verdict.OPTIMAL})


class Audience(Protocol):
    """Observers that receive each answer during a search."""

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        """Take in an answer that is better than all before in its epoch. The robots `withdrawn` do not fly.

        `epoch` is the epoch as if it had ended now, `team` its team as the files have it.
        """

    def has_news(self, team: Team) -> bool:
        """Return whether the problem has changed, so that nothing better is to be searched for."""


class Rank:
    """The order of answers: first by the weight of the robots that withdraw, then by the cost."""

    def __init__(self, team: Team, told: Callable[[float], Cost]) -> None:
        self._weights = {robot.name: robot.weight for robot in team.robots}
        self._sign = -1 if told(1) < told(0) else 1

    def of(self, cost: Cost, withdrawn: Sequence[str]) -> tuple[int, Cost]:
        """Return the rank of an answer of this `cost` without the robots `withdrawn`: the lower, the better."""
        return sum(self._weights[name] for name in withdrawn), self._signed(cost)

    def of_answer(self, answer: PhaseAnswer) -> tuple[int, Cost]:
        """Return the rank of `answer`, which has an assignment."""
        return self.of(answer.cost or 0, answer.withdrawn)

    def tightest(self, bounds: Sequence[Cost | None]) -> Cost | None:
        """Return the bound that says the most; None if there is none."""
        return max((bound for bound in bounds if bound is not None), key=self._signed, default=None)

    def meets(self, answer: PhaseAnswer, bound: Cost | None) -> bool:
        """Return whether `answer`, by all robots, is as good as `bound` says that anything is."""
        return bound is not None and not answer.withdrawn and self._signed(answer.cost or 0) <= self._signed(bound)

    def _signed(self, cost: Cost) -> Cost:
        return self._sign * cost


class Improvements(SearchWatch):
    """The answers of one search, published from its deadline on.

    Args:
        began: When the time of the deadline began, on the monotonic clock.
        deadline: When the first answer is due, on the same.
        evaluate: Returns the checked answer of a snapshot.
        rank: The order of answers.
        has_costs: Whether there are costs. Without them a solution by all robots is as good as any other.
        bounded: Whether bounds are of costs. (Where robots may withdraw, they are of weights.)
        publish: Publishes an answer.
        has_news: Returns whether the problem has changed.
        earlier: What was published before, where this is not the first search of an epoch.
        keep: Is called with each answer that is the best so far, published or not (None: nobody needs to know).
    """

    def __init__(  # noqa: PLR0913 - what differs between runs, by names
        self,
        *,
        began: float,
        deadline: float,
        evaluate: Callable[[SearchResult], PhaseAnswer],
        rank: Rank,
        has_costs: bool,
        bounded: bool,
        publish: Callable[[PhaseAnswer, tuple[Improvement, ...]], None],
        has_news: Callable[[], bool],
        earlier: Sequence[Improvement] = (),
        keep: Callable[[PhaseAnswer], None] | None = None,
    ) -> None:
        self._began = began
        self._deadline = deadline
        self._evaluate = evaluate
        self._rank = rank
        self._has_costs = has_costs
        self._bounded = bounded
        self._publish = publish
        self._has_news = has_news
        self._keep = keep
        self._published: PhaseAnswer | None = None
        self._best: PhaseAnswer | None = None
        self._bound: Cost | None = None
        self._asked = self._polled = began
        self._due = min(began + PERIOD_S, deadline)
        self._over = self._outdated = False
        self.improvements = [*earlier]

    @property
    def satisfied(self) -> bool:
        """See `SearchWatch`: nothing can be better than what is published, or the problem has changed."""
        return self._over or self._outdated

    def wait_s(self, now: float) -> float:
        """See `SearchWatch`."""
        due = (self._due, self._polled + PERIOD_S) if now >= self._deadline else (self._due, self._deadline)
        return max(0.0, min(due) - now)

    def wants_snapshot(self, now: float) -> bool:
        """See `SearchWatch`: publish what is due."""
        first = self._published is None and self._best is not None
        if now < self._due and (now < self._deadline or not (first or now - self._polled >= PERIOD_S)):
            return False
        self._publish_if_due(now)
        if self._published is not None and now - self._polled >= PERIOD_S:
            self._outdated = self._outdated or self._has_news()
        self._polled = now
        if now < self._due:
            return False
        self._asked, self._due = now, float("inf")
        return True

    def receive(self, snapshot: SearchResult) -> None:
        """See `SearchWatch`: check it, and publish it if it is better."""
        came = time.monotonic()
        self._note(self._evaluate(snapshot))
        now = time.monotonic()
        self._publish_if_due(now)
        self._due = now + max(PERIOD_S, came - self._asked, _SHARE * (now - came))
        if now < self._deadline - PERIOD_S:
            self._due = min(self._due, self._deadline - PERIOD_S)  # so that the answer is there at the deadline

    def _note(self, answer: PhaseAnswer) -> None:
        """Keep `answer` if it is the best so far, and what is proven of the costs of all."""
        if self._bounded:
            self._bound = self._rank.tightest([self._bound, answer.bound])
        if _is_found(answer) and (
            self._best is None or self._rank.of_answer(answer) < self._rank.of_answer(self._best)
        ):
            self._best = answer
            if self._keep is not None:
                self._keep(answer)
        best = self._best
        if best is not None and (self._has_costs or best.withdrawn) and self._is_proven(best, answer):
            self._best = replace(best, verdict=Verdict.OPTIMAL, bound=None, deadline=None)

    def _is_proven(self, best: PhaseAnswer, answer: PhaseAnswer) -> bool:
        """Return whether nothing is better than the `best`, as `answer` says, or the bound."""
        optimal = answer.verdict == Verdict.OPTIMAL and self._rank.of_answer(answer) == self._rank.of_answer(best)
        return optimal or self._rank.meets(best, self._bound)

    def _publish_if_due(self, now: float) -> None:
        if now >= self._deadline and self._best is not None:
            self._tell(self._best, now)
            final = self._best.verdict == Verdict.OPTIMAL or not (self._has_costs or self._best.withdrawn)
            self._over = self._over or final

    def _tell(self, best: PhaseAnswer, now: float) -> None:
        """Publish the `best`, if that is a gain: robots under way are not sent elsewhere for nothing."""
        before = self._published
        if self._outdated or (before is not None and not self._rank.of_answer(best) < self._rank.of_answer(before)):
            return
        self._published = best
        if now >= self._deadline:
            self.improvements.append(Improvement(now - self._began, best.verdict, best.cost, best.withdrawn))
        self._publish(best, tuple(self.improvements))

    def concluded(self, final: PhaseAnswer, *, lost: bool) -> PhaseAnswer:
        """Return the answer of the search, which has ended with `final`: that, or what is better of those before.

        It is published if nothing as good is, and the problem has not changed. If robots were `lost`, what was
        published does not count for the others.

        Raises:
            RefutedError: when the protocol claims what an answer refutes.
        """
        if lost:
            return replace(final, improvements=tuple(self.improvements))
        self._refuse_false_claims(final)
        self._note(final)
        best, now = self._best, time.monotonic()
        if best is None or (now < self._deadline and not _is_found(final)):
            return replace(final, improvements=tuple(self.improvements))
        self._tell(best, now)
        best = self._published or best
        proven = self._best is not None and self._best.verdict == Verdict.OPTIMAL and not self._outdated
        return replace(
            final,
            verdict=Verdict.OPTIMAL if proven else Verdict.SOLUTION,
            bound=None if proven else self._bound if self._bounded and not _is_found(final) else final.bound,
            deadline=None if proven or final.ended else best.deadline,
            reason=final.reason if _is_found(final) else best.reason,
            improvements=tuple(self.improvements),
            **best.assignment_parts(),
        )

    def _refuse_false_claims(self, final: PhaseAnswer) -> None:
        best = self._best
        if best is None:
            return
        if final.verdict == Verdict.NO_SOLUTION:
            raise RefutedError(f"the protocol claims that there is no solution, but one was found (cost {best.cost})")
        if final.verdict == Verdict.OPTIMAL and self._rank.of_answer(best) < self._rank.of_answer(final):
            raise RefutedError(f"the protocol says that {final.cost} is optimal, and {best.cost} was found before")


def improvements_of(  # noqa: PLR0913 - what differs between deployments, by names
    phase: RunPhase,
    team: Team,
    options: Options,
    *,
    began: float,
    told: Callable[[float], Cost],
    check: Callable[[SearchResult], Answer | None],
    publish: Callable[[PhaseAnswer, tuple[Improvement, ...]], None],
    audience: Audience | None,
    before: Improvements | None,
    keep: Callable[[PhaseAnswer], None] | None = None,
) -> Improvements:
    """Return the best answers of the search of `phase`, of a run with a deadline.

    Args:
        phase: The phase.
        team: The team as its files have it.
        options: The options of the run.
        began: When the time of the run began, on the monotonic clock, in seconds.
        told: Turns a cost into the user's numbers.
        check: Checks what robots had at a snapshot. It may raise `RefutedError`.
        publish: Publishes an answer, with all improvements so far.
        audience: Tells whether the problem has changed.
        before: Those of the search before this one, if there was one.
        keep: Gets each best answer when it is found.
    """

    def evaluate(snapshot: SearchResult) -> PhaseAnswer:
        snapshot = _as_told_one_after_the_other(snapshot, phase, options)
        return evaluate_search(phase, Search(snapshot, partial(check, snapshot)), team.kind, told, options.deadline)

    return Improvements(
        began=began,
        deadline=began + (options.deadline or 0.0),
        evaluate=evaluate,
        rank=Rank(team, told),
        has_costs=team.kind == ProblemKind.DISWCSP,
        bounded=phase.parameters.withdrawal_cost is None,
        publish=publish,
        has_news=lambda: audience is not None and audience.has_news(team),
        earlier=before.improvements if before else (),
        keep=keep,
    )


def _as_told_one_after_the_other(snapshot: SearchResult, phase: RunPhase, options: Options) -> SearchResult:
    """Return `snapshot`, of which nothing is known but what can be checked where messages get lost.

    Robots report one after the other, so a message may be lost that no robot has missed yet.
    """
    if not options.loss or phase.traits.bears_loss:
        return snapshot
    lost = max(1, snapshot.metrics.lost_messages)
    return replace(snapshot, metrics=replace(snapshot.metrics, lost_messages=lost))


def _is_found(answer: PhaseAnswer) -> bool:
    """Return whether `answer` is one that was checked. That nobody flies is none, unless nothing else is possible."""
    flown = bool(answer.assignment) or not answer.withdrawn or answer.verdict == Verdict.OPTIMAL
    return flown and answer.verdict in _FOUND and answer.verified and answer.cost is not None
