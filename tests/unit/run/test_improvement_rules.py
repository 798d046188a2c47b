"""The rules of `Improvements`, one by one, with a clock that is set and snapshots that are given."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from robochoc.model.absence import DroppedConstraint
from robochoc.model.outcome import Improvement, Verdict
from robochoc.run.evaluation import PhaseAnswer
from robochoc.run.improvement import Improvements, Rank
from robochoc.verification.checker import RefutedError
from tests.support.improvements import costly


def answer(cost: int, verdict: Verdict = Verdict.SOLUTION, **more: object) -> PhaseAnswer:
    known = PhaseAnswer(verdict, assignment={"X": cost}, cost=cost, verified=True)
    return replace(known, **more)  # type: ignore[arg-type]


class Bench:
    """Improvements with a clock that is set, and snapshots that are given."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, has_costs: bool = True) -> None:
        self.now = 0.0
        self.published: list[tuple[float, int]] = []
        self.news = False
        monkeypatch.setattr("robochoc.run.improvement.time", SimpleNamespace(monotonic=lambda: self.now))
        self._given = PhaseAnswer(Verdict.UNKNOWN)
        self.made = Improvements(
            began=0,
            deadline=1,
            evaluate=lambda _: self._given,
            rank=Rank(costly(), float),  # type: ignore[arg-type]
            has_costs=has_costs,
            bounded=True,
            publish=lambda one, _: self.published.append((self.now, int(one.cost or 0))),
            has_news=lambda: self.news,
        )

    def tick(self, at_s: float, given: PhaseAnswer | None = None) -> None:
        self.now = at_s
        if self.made.wants_snapshot(at_s) and given is not None:
            self._given = given
            self.made.receive(None)  # type: ignore[arg-type]


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_nothing_before_the_deadline_and_the_best_then(bench: Bench) -> None:
    for at_s, cost in ((0.2, 9), (0.5, 5), (0.8, 7)):
        bench.tick(at_s, answer(cost))
    assert bench.published == []
    assert bench.made.wait_s(0.8) <= 0.2
    bench.tick(1.0)
    assert bench.published == [(1.0, 5)]


def test_a_robot_that_computes_at_the_deadline_keeps_nobody_waiting(bench: Bench) -> None:
    bench.tick(0.5, answer(5))
    bench.tick(0.9)  # asked, and not answered
    bench.tick(1.0)
    assert bench.published == [(1.0, 5)]


def test_what_is_as_good_is_not_published_again(bench: Bench) -> None:
    """Robots are under way: they are not sent elsewhere for nothing."""
    for at_s, cost in ((1.0, 5), (1.2, 5), (1.4, 6), (1.6, 4)):
        bench.tick(at_s, answer(cost))
    assert bench.published == [(1.0, 5), (1.6, 4)]
    final = bench.made.concluded(replace(answer(4, Verdict.OPTIMAL), assignment={"X": 0}), lost=False)
    assert (final.verdict, final.assignment) == (Verdict.OPTIMAL, {"X": 4})
    assert bench.published == [(1.0, 5), (1.6, 4)]
    assert [(one.at_s, one.cost) for one in final.improvements] == bench.published


def test_a_bound_proves_what_was_found_before(bench: Bench) -> None:
    bench.tick(1.0, answer(5, bound=3, deadline=1.0))
    bench.tick(1.2, answer(7, bound=5))
    assert bench.made.satisfied
    final = bench.made.concluded(PhaseAnswer(Verdict.UNKNOWN, bound=4), lost=False)
    assert (final.verdict, final.cost, final.bound, final.deadline) == (Verdict.OPTIMAL, 5, None, None)


def test_a_limit_leaves_the_best_of_those_that_were_published(bench: Bench) -> None:
    bench.tick(1.0, answer(5, deadline=1.0))
    final = bench.made.concluded(PhaseAnswer(Verdict.UNKNOWN, bound=4, reason="the time was over"), lost=False)
    assert (final.verdict, final.cost, final.bound, final.deadline) == (Verdict.SOLUTION, 5, 4, 1.0)
    assert final.reason is None


def test_the_last_assignment_before_a_limit_may_be_the_best(bench: Bench) -> None:
    """Found by `make simulate`: the answer cost more than the robots' last assignment."""
    bench.tick(1.2, answer(5))
    limited = answer(4, Verdict.UNKNOWN, reason="the limit of messages was reached")
    final = bench.made.concluded(limited, lost=False)
    assert (final.verdict, final.cost, final.assignment) == (Verdict.SOLUTION, 4, {"X": 4})
    assert final.reason == limited.reason
    assert bench.published == [(1.2, 5), (1.2, 4)]


def test_the_end_may_be_better_than_all_before(bench: Bench) -> None:
    bench.tick(1.0, answer(5))
    bench.now = 2.0
    final = bench.made.concluded(answer(3, Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.cost) == (Verdict.OPTIMAL, 3)
    assert bench.published == [(1.0, 5), (2.0, 3)]
    assert final.improvements[-1] == Improvement(2.0, Verdict.OPTIMAL, 3)


def test_who_ends_before_the_deadline_has_published_once_and_improved_nothing(bench: Bench) -> None:
    bench.tick(0.5, answer(5))
    final = bench.made.concluded(answer(3, Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.cost, final.improvements) == (Verdict.OPTIMAL, 3, ())
    assert bench.published == [(0.5, 3)]


def test_a_limit_before_the_deadline_decides_nothing(bench: Bench) -> None:
    bench.tick(0.5, answer(5))
    unknown = PhaseAnswer(Verdict.UNKNOWN, reason="the limit of messages was reached (--messages 3)")
    assert bench.made.concluded(unknown, lost=False) == unknown
    assert bench.published == []


def test_after_a_loss_what_was_published_is_no_answer(bench: Bench) -> None:
    bench.tick(1.0, answer(5))
    final = bench.made.concluded(PhaseAnswer(Verdict.UNKNOWN), lost=True)
    assert (final.verdict, final.cost, len(final.improvements)) == (Verdict.UNKNOWN, None, 1)


def test_dropped_constraints_belong_to_the_assignment(monkeypatch: pytest.MonkeyPatch) -> None:
    dropped = (DroppedConstraint("C1", ("Robot1", "Robot2")),)
    bench = Bench(monkeypatch)
    bench.tick(1.0, answer(5, withdrawn=("Robot2",), dropped_constraints=dropped))
    final = bench.made.concluded(PhaseAnswer(Verdict.UNKNOWN), lost=False)
    assert (final.withdrawn, final.dropped_constraints) == (("Robot2",), dropped)


def test_a_protocol_that_an_answer_refutes_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    for claim in (PhaseAnswer(Verdict.NO_SOLUTION), answer(6, Verdict.OPTIMAL)):
        bench = Bench(monkeypatch)
        bench.tick(1.0, answer(5))
        with pytest.raises(RefutedError, match=r"\b5 was found|cost 5"):
            bench.made.concluded(claim, lost=False)


def test_that_nobody_flies_is_an_answer_only_once_it_is_proven(bench: Bench) -> None:
    nobody = answer(0, assignment={}, withdrawn=costly().order)
    bench.tick(1.0, nobody)
    assert bench.published == []
    final = bench.made.concluded(replace(nobody, verdict=Verdict.OPTIMAL, ended=True), lost=False)
    assert (final.verdict, final.withdrawn) == (Verdict.OPTIMAL, costly().order)


def test_news_count_once_something_is_published(bench: Bench) -> None:
    bench.news = True
    bench.tick(0.5, answer(5))
    assert not bench.made.satisfied
    bench.tick(1.0)
    bench.tick(1.2)
    assert bench.made.satisfied
