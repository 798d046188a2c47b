"""What every distributed run decides, wherever its robots are: phases, losses, reasons. The deployment is made up."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import Answer, Metrics, Outcome, Verdict
from robochoc.model.problem import ProblemKind
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run import Options, Withdrawal
from robochoc.run.distributed import Deployment, solve_distributed
from robochoc.run.evaluation import PhaseAnswer, Search
from robochoc.run.phases import RunPhase
from tests.support.random_outcomes import drawn

HEADER = Outcome(Verdict.UNKNOWN, team="team", protocol="abt", runtime="simulator", seed=0)
SPENT = Metrics(messages={"Ok": 2}, checks=5)
NOTHING = SearchResult(Verdict.NO_SOLUTION, "A", {}, SPENT)
SOLVED = SearchResult(Verdict.SOLUTION, None, {}, SPENT)
BROKEN_OFF = SearchResult(Verdict.UNKNOWN, None, {}, SPENT)


class MadeUp(Deployment):
    """Each search has the next of `results`; what is found is `found`."""

    def __init__(
        self,
        options: Options,
        results: Sequence[SearchResult],
        found: Answer | None = None,
        robots: str = "ABC",
    ) -> None:
        self.options = options
        self.phases: list[RunPhase] = []
        self._results = list(results)
        self._found = found
        self._robots = set(robots)
        self._lost: list[str] = []

    @property
    def kind(self) -> ProblemKind:
        return ProblemKind.DISCSP

    def in_user_units(self, total: float) -> Cost:
        return int(total)

    @property
    def lost(self) -> tuple[str, ...]:
        return tuple(self._lost)

    @property
    def searched(self) -> None:
        return None

    @property
    def is_empty(self) -> bool:
        return not self._robots

    def withdrawal_cost(self) -> float:
        return 10

    def left_s(self) -> float | None:
        return None

    def search(self, phase: RunPhase) -> Search:
        self.phases.append(phase)
        return Search(self._results.pop(0), lambda: self._found)

    def remove(self, lost: Mapping[str, str]) -> None:
        self._lost += lost
        self._robots -= lost.keys()


def losing(*names: str) -> SearchResult:
    return replace(BROKEN_OFF, lost=dict.fromkeys(names, "it was hit by a meteor"))


def test_a_solution_needs_one_phase() -> None:
    deployment = MadeUp(
        Options(protocol="abt"), [SOLVED], Answer(Verdict.UNKNOWN, assignment={"a": 1}, cost=0, verified=True)
    )
    outcome = solve_distributed(deployment, ABT, HEADER)
    assert (outcome.verdict, outcome.assignment, outcome.verified) == (Verdict.SOLUTION, {"a": 1}, True)
    assert [phase.name for phase in deployment.phases] == ["abt"]


@pytest.mark.parametrize(
    ("withdraw", "second", "cost"), [(Withdrawal.MINIMUM, "sfb", 10), (Withdrawal.MAXIMAL, "first-fit", None)]
)
def test_without_a_solution_another_protocol_decides_who_withdraws(
    withdraw: Withdrawal, second: str, cost: float | None
) -> None:
    options = Options(protocol="abt", withdraw=withdraw, settings={"of": "abt"})
    deployment = MadeUp(
        options,
        [NOTHING, SOLVED],
        Answer(Verdict.UNKNOWN, assignment={"a": 1}, cost=0, withdrawn=("B",), verified=True),
    )
    outcome = solve_distributed(deployment, ABT, HEADER)
    assert outcome.verdict is (Verdict.OPTIMAL if cost else Verdict.SOLUTION)
    assert (outcome.withdrawn, outcome.witness, outcome.placed_by) == (("B",), "A", second)
    assert outcome.metrics == SPENT + SPENT
    first, then = deployment.phases
    assert (first.parameters.settings, then.parameters.settings) == ({"of": "abt"}, {})
    assert (first.withdrawal, then.name, then.withdrawal, then.parameters.withdrawal_cost) == (
        False,
        second,
        True,
        cost,
    )


def test_a_protocol_with_costs_decides_at_once() -> None:
    options = Options(protocol="sfb", withdraw=Withdrawal.MINIMUM)
    deployment = MadeUp(
        options, [SOLVED], Answer(Verdict.UNKNOWN, assignment={"a": 1}, cost=0, withdrawn=("B",), verified=True)
    )
    outcome = solve_distributed(deployment, SFB, HEADER)
    assert (outcome.verdict, outcome.withdrawn, outcome.placed_by) == (Verdict.OPTIMAL, ("B",), None)


def test_after_a_loss_the_others_search_again_and_all_that_was_sent_counts() -> None:
    deployment = MadeUp(
        Options(protocol="abt"),
        [losing("B"), SOLVED],
        Answer(Verdict.UNKNOWN, assignment={"a": 1}, cost=0, verified=True),
    )
    outcome = solve_distributed(deployment, ABT, HEADER)
    assert (outcome.lost, outcome.withdrawn) == (("B",), ("B",))
    assert outcome.metrics == SPENT + SPENT


def test_all_are_lost() -> None:
    with pytest.raises(RobotsLostError):
        solve_distributed(MadeUp(Options(protocol="abt"), [losing("A"), losing("B")], robots="AB"), ABT, HEADER)


def test_why_there_is_no_verdict() -> None:
    for options, result, reason in [
        (Options(messages=2), BROKEN_OFF, "the limit of messages was reached (--messages 2)"),
        (Options(timeout=1.5, messages=3), BROKEN_OFF, "the time was over (--timeout 1.5)"),
        (Options(), replace(BROKEN_OFF, witness="C"), "C gave up, as its protocol has it"),
        (Options(protocol="dsa"), SOLVED, "dsa ended, and found no assignment that satisfies all hard constraints"),
    ]:
        outcome = solve_distributed(MadeUp(options, [result]), DSA if options.protocol == "dsa" else ABT, HEADER)
        assert (outcome.verdict, outcome.reason) == (Verdict.UNKNOWN, reason)


# Answers of searches become outcomes and epochs without loss


def test_no_field_of_an_answer_is_dropped() -> None:
    chance = Random(4)
    header = Outcome(
        Verdict.UNKNOWN, team="team", protocol="abt", runtime="simulator", seed=1, order="dfs", channel="wifi"
    )
    for _ in range(100):
        answer = drawn(PhaseAnswer, chance)
        outcome, epoch = answer.as_outcome(header, ("gone",)), answer.as_epoch(("a", "b"), "a loss", ("gone",))
        assert outcome.parts() | {"withdrawn": answer.withdrawn} == answer.parts()
        assert epoch.parts() | {"preprocessing": answer.preprocessing} == answer.parts()
        assert (outcome.epochs, outcome.withdrawn) == (answer.epochs, ("gone", *answer.withdrawn))
        assert (outcome.team, outcome.order, outcome.channel) == ("team", "dfs", "wifi")
        assert (epoch.robots, epoch.opened_by, epoch.lost) == (("a", "b"), "a loss", ("gone",))
