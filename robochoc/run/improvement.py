"""Answers during a search: at the deadline the best answer is published, and then each better one until the time limit.

After the deadline, the robots continue to search. From time to time they report snapshots
(`communication/search_watch.py`), which are checked like any other answer. Each published answer is better than the
previous one, and satisfies all hard constraints.
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
"""The shortest time between two snapshots, in seconds. Slow snapshots are taken less often: see `_SHARE`."""
_SHARE = 10
"""The search after a snapshot lasts at least this many times as long as the snapshot."""
_FOUND = frozenset({Verdict.SOLUTION, Verdict.OPTIMAL})


class Audience(Protocol):
    """Observers that receive each answer during a search."""

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        """Receive an answer that is better than all earlier answers of its epoch. The robots `withdrawn` do not fly.

        `epoch` describes the epoch as if it had ended now; `team` is its team in the form of the files.
        """

    def has_news(self, team: Team) -> bool:
        """Return whether the problem has changed, so that the search for better answers must stop."""


class Rank:
    """The ranking of answers: first by the total weight of the withdrawn robots, then by the cost."""

    def __init__(self, team: Team, in_user_units: Callable[[float], Cost]) -> None:
        self._weights = {robot.name: robot.weight for robot in team.robots}
        self._sign = -1 if in_user_units(1) < in_user_units(0) else 1

    def of(self, cost: Cost, withdrawn: Sequence[str]) -> tuple[int, Cost]:
        """Return the rank of an answer of this `cost` without the robots `withdrawn`. Lower ranks are better."""
        return sum(self._weights[name] for name in withdrawn), self._signed(cost)

    def of_answer(self, answer: PhaseAnswer) -> tuple[int, Cost]:
        """Return the rank of `answer`. It must have an assignment."""
        return self.of(answer.cost or 0, answer.withdrawn)

    def tightest(self, bounds: Sequence[Cost | None]) -> Cost | None:
        """Return the tightest of the `bounds`, or None if there is no bound."""
        return max((bound for bound in bounds if bound is not None), key=self._signed, default=None)

    def meets(self, answer: PhaseAnswer, bound: Cost | None) -> bool:
        """Return whether `answer`, without withdrawals, reaches `bound`."""
        return bound is not None and not answer.withdrawn and self._signed(answer.cost or 0) <= self._signed(bound)

    def _signed(self, cost: Cost) -> Cost:
        return self._sign * cost


class Improvements(SearchWatch):
    """Publishes the answers of one search, from its deadline on.

    Args:
        began: The time from which the deadline counts, on the monotonic clock.
        deadline: The time at which the first answer is due, on the same clock.
        evaluate: Returns the checked answer of a snapshot.
        rank: The ranking of answers.
        has_costs: True if there are costs. Without them all solutions without withdrawals are equally good.
        bounded: True if the bounds refer to costs. (If robots may withdraw, the bounds refer to weights.)
        publish: Publishes an answer.
        has_news: Returns true if the problem has changed.
        earlier: The answers published by earlier searches in the epoch.
        keep: Called with each new best answer, even if the answer is not published (None: not called).
    """

    def __init__(  # noqa: PLR0913 - the parts that differ between runs, by name
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
        """See `SearchWatch`: the published answer cannot be improved, or the problem has changed."""
        return self._over or self._outdated

    def wait_s(self, now: float) -> float:
        """See `SearchWatch`."""
        due = (self._due, self._polled + PERIOD_S) if now >= self._deadline else (self._due, self._deadline)
        return max(0.0, min(due) - now)

    def wants_snapshot(self, now: float) -> bool:
        """See `SearchWatch`. Publishes an answer that is due."""
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
        """See `SearchWatch`. Checks the snapshot, and publishes it if it is better."""
        came = time.monotonic()
        self._note(self._evaluate(snapshot))
        now = time.monotonic()
        self._publish_if_due(now)
        self._due = now + max(PERIOD_S, came - self._asked, _SHARE * (now - came))
        if now < self._deadline - PERIOD_S:
            self._due = min(self._due, self._deadline - PERIOD_S)  # so that there is an answer at the deadline

    def _note(self, answer: PhaseAnswer) -> None:
        """Update the best answer so far, and the proven bound of the cost."""
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
        """Return whether `answer` or the bound proves that `best` is optimal."""
        optimal = answer.verdict == Verdict.OPTIMAL and self._rank.of_answer(answer) == self._rank.of_answer(best)
        return optimal or self._rank.meets(best, self._bound)

    def _publish_if_due(self, now: float) -> None:
        if now >= self._deadline and self._best is not None:
            self._publish_gain(self._best, now)
            final = self._best.verdict == Verdict.OPTIMAL or not (self._has_costs or self._best.withdrawn)
            self._over = self._over or final

    def _publish_gain(self, best: PhaseAnswer, now: float) -> None:
        """Publish the `best` answer if it is better than the published one, so that robots move only if needed."""
        before = self._published
        if self._outdated or (before is not None and not self._rank.of_answer(best) < self._rank.of_answer(before)):
            return
        self._published = best
        if now >= self._deadline:
            self.improvements.append(Improvement(now - self._began, best.verdict, best.cost, best.withdrawn))
        self._publish(best, tuple(self.improvements))

    def concluded(self, final: PhaseAnswer, *, lost: bool) -> PhaseAnswer:
        """Return the final answer of the search: `final`, or a better answer found earlier.

        The answer is published unless an equally good answer has already been published, or the problem has changed. If
        robots were `lost`, earlier published answers are invalid for the remaining robots.

        Raises:
            RefutedError: if an answer refutes a claim of the protocol.
        """
        if lost:
            return replace(final, improvements=tuple(self.improvements))
        self._refuse_false_claims(final)
        limited = self._published is not None and final.verdict == Verdict.UNKNOWN and bool(final.assignment)
        self._note(replace(final, verdict=Verdict.SOLUTION) if limited else final)  # the last gain before a limit
        best, now = self._best, time.monotonic()
        if best is None or (now < self._deadline and not _is_found(final)):
            return replace(final, improvements=tuple(self.improvements))
        self._publish_gain(best, now)
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
            raise RefutedError(
                f"the protocol claims that there is no solution, but a solution was found (cost {best.cost})"
            )
        if final.verdict == Verdict.OPTIMAL and self._rank.of_answer(best) < self._rank.of_answer(final):
            raise RefutedError(f"the protocol claims that {final.cost} is optimal, but {best.cost} was found before")


def improvements_of(  # noqa: PLR0913 - the parts that differ between deployments, by name
    phase: RunPhase,
    team: Team,
    options: Options,
    *,
    began: float,
    in_user_units: Callable[[float], Cost],
    check: Callable[[SearchResult], Answer | None],
    publish: Callable[[PhaseAnswer, tuple[Improvement, ...]], None],
    audience: Audience | None,
    before: Improvements | None,
    keep: Callable[[PhaseAnswer], None] | None = None,
) -> Improvements:
    """Return the watch for the answers in the search of `phase`, in a run with a deadline.

    Args:
        phase: The phase.
        team: The team in the form of its files.
        options: The options of the run.
        began: The start of the run's time, on the monotonic clock, in seconds.
        in_user_units: Converts a cost to the user's units.
        check: Checks the values of a snapshot. It may raise `RefutedError`.
        publish: Publishes an answer, with all improvements so far.
        audience: Reports whether the problem has changed.
        before: The answers of the previous search, if there was one.
        keep: Called with each new best answer.
    """

    def evaluate(snapshot: SearchResult) -> PhaseAnswer:
        snapshot = _with_possible_loss(snapshot, phase, options)
        return evaluate_search(
            phase, Search(snapshot, partial(check, snapshot)), team.kind, in_user_units, options.deadline
        )

    return Improvements(
        began=began,
        deadline=began + (options.deadline or 0.0),
        evaluate=evaluate,
        rank=Rank(team, in_user_units),
        has_costs=team.kind == ProblemKind.DISWCSP,
        bounded=phase.parameters.withdrawal_cost is None,
        publish=publish,
        has_news=lambda: audience is not None and audience.has_news(team),
        earlier=before.improvements if before else (),
        keep=keep,
    )


def _with_possible_loss(snapshot: SearchResult, phase: RunPhase, options: Options) -> SearchResult:
    """Return `snapshot`, marked as spoiled if messages may be lost. Then only its checked values are valid.

    Robots report one after the other, so a message may have been lost although no robot has noticed the loss yet.
    """
    if not options.loss or phase.traits.bears_loss:
        return snapshot
    lost = max(1, snapshot.metrics.lost_messages)
    return replace(snapshot, metrics=replace(snapshot.metrics, lost_messages=lost))


def _is_found(answer: PhaseAnswer) -> bool:
    """Return whether `answer` was checked. An answer without robots is valid only if it is optimal."""
    flown = bool(answer.assignment) or not answer.withdrawn or answer.verdict == Verdict.OPTIMAL
    return flown and answer.verdict in _FOUND and answer.verified and answer.cost is not None
