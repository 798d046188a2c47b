"""An environment, whatever it is, is told each epoch and says what changes: the next epoch."""

from __future__ import annotations

import os
import signal
import sys
from dataclasses import replace

import pytest

from robochoc.api import Problem
from robochoc.communication.search_result import RobotsLostError
from robochoc.formats import read_team
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import AddAgent, RemoveAgent, RemoveValue, ScenarioEvent, Team
from robochoc.robots.source import SourceError
from robochoc.run import OnLoss, Options, Runtime, Withdrawal, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.environments import SIMULATED, Says, openings
from tests.support.faults import own_children
from tests.support.limits import HANG_S
from tests.support.moved_clock import MovedClock
from tests.support.problems import ON_ONE_MACHINE
from tests.support.program import ROOT
from tests.support.small_teams import pair

HANGAR = read_team(ROOT / "docs" / "examples" / "hangar")


@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
def test_an_environment_is_told_each_epoch_and_says_the_next(runtime: Runtime) -> None:
    environment = Says(ScenarioEvent((RemoveValue("A", 1),)), ScenarioEvent((RemoveAgent("RB"),)))
    outcome = solve(pair(values=3), Options(protocol="dynabt", runtime=runtime), environment=environment)
    assert openings(outcome) == ["the start", "A without 1", "-RB"]
    both, alone = (("RA", "RB"), None), (("RA",), None)
    assert [(order, left_s) for order, _, left_s in environment.summary] == [both, both, alone]
    assert [epoch for _, epoch, _ in environment.summary] == [*outcome.epochs]
    assert all(epoch.verified for epoch in outcome.epochs)
    assert outcome.assignment == {"A": 2}


def test_what_cannot_be_is_passed_over() -> None:
    environment = Says(
        ScenarioEvent((RemoveAgent("RX"), RemoveValue("A", 9), RemoveValue("A", 1))),
        ScenarioEvent((RemoveAgent("RX"),)),
    )
    outcome = solve(pair(values=3), SIMULATED, environment=environment)
    assert openings(outcome) == ["the start", "A without 1", "nothing"]
    team = pair(values=3)
    there = Says(ScenarioEvent((AddAgent(team["RB"]),)))
    assert openings(solve(team, SIMULATED, environment=there)) == ["the start", "nothing"]


def test_the_files_own_events_come_first() -> None:
    team = pair(ScenarioEvent((RemoveValue("A", 1),)), values=3)
    outcome = solve(team, SIMULATED, environment=Says(ScenarioEvent((RemoveValue("A", 2), RemoveValue("A", 1)))))
    assert openings(outcome) == ["the start", "A without 1", "A without 2"]
    assert outcome.events == 2


def test_without_an_environment_a_problem_that_does_not_change_has_no_epochs() -> None:
    assert solve(pair(values=3), SIMULATED).epochs == ()
    assert len(solve(pair(values=3), SIMULATED, environment=Says()).epochs) == 1


def test_an_epoch_without_a_solution_may_be_followed_by_one_with() -> None:
    values = tuple(RemoveValue("A", value) for value in (1, 2, 3))
    outcome = solve(
        pair(values=3), SIMULATED, environment=Says(ScenarioEvent(values), ScenarioEvent((RemoveAgent("RA"),)))
    )
    assert [epoch.verdict for epoch in outcome.epochs] == ["solution", "no-solution", "solution"]


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (Options(protocol="dynabt", withdraw=Withdrawal.MINIMUM), "--withdraw"),
        (Options(protocol="dynabt", runtime=Runtime.NETWORK), "--runtime network"),
        (Options(protocol="central"), "--protocol central"),
    ],
)
def test_what_a_changing_problem_cannot_have_is_refused(options: Options, named: str) -> None:
    with pytest.raises(UnsupportedError, match=f"{named} is for problems that do not change"):
        solve(pair(values=3), options, environment=Says())


def test_when_the_time_is_over_nothing_that_comes_is_heeded(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = MovedClock()
    for module in ("run.context", "run.orchestrator", "solver.compile", "communication.session", "system.time_limit"):
        monkeypatch.setattr(f"robochoc.{module}.time", clock)

    class Slow(Says):
        def __call__(self, team: Team, epoch: EpochOutcome, left_s: float | None) -> ScenarioEvent | None:
            assert left_s == (0 if self.summary else HANG_S)
            clock.end()
            return super().__call__(team, epoch, left_s)

    environment = Slow(ScenarioEvent((RemoveValue("A", 1),)))
    outcome = solve(pair(values=3), replace(SIMULATED, timeout=HANG_S), environment=environment)
    assert (outcome.verdict, openings(outcome)) == (Verdict.UNKNOWN, ["the start", "A without 1"])
    assert environment.summary[-1][2] == 0
    assert "--timeout" in (outcome.reason or "")


def test_when_all_messages_are_sent_nothing_that_comes_is_heeded() -> None:
    environment = Says()
    outcome = solve(HANGAR, replace(SIMULATED, messages=3), environment=environment)
    assert (outcome.verdict, environment.summary[-1][2]) == (Verdict.UNKNOWN, 0)


class Striking(Says):
    """Kills a robot's process while the team waits."""

    def __call__(self, team: Team, epoch: EpochOutcome, left_s: float | None) -> ScenarioEvent | None:
        if not self.summary:
            victim = next(pid for pid, name in own_children().items() if name == "RB")
            os.kill(victim, signal.SIGKILL)
            os.waitid(os.P_PID, victim, os.WEXITED | os.WNOWAIT)
        return super().__call__(team, epoch, left_s)


@pytest.mark.skipif(sys.platform != "linux", reason="as the runtime's other tests of faults")
def test_a_robot_that_dies_while_the_team_waits_is_lost() -> None:
    options = Options(protocol="dynabt")
    event = ScenarioEvent((RemoveValue("A", 1),))
    with pytest.raises(RobotsLostError) as lost:
        solve(pair(values=3), options, environment=Striking(event))
    assert "RB" in lost.value.robots
    surviving = Options(protocol="dynabt", on_loss=OnLoss.WITHDRAW)
    outcome = solve(pair(values=3), surviving, environment=Striking(event))
    assert openings(outcome) == ["the start", "A without 1", "the loss of RB"]
    assert (outcome.lost, outcome.assignment) == (("RB",), {"A": 2})


@pytest.mark.parametrize("error", [KeyboardInterrupt, SourceError("the robots cannot be heard any more")])
def test_no_process_outlives_an_environment_that_fails(error: BaseException | type[BaseException]) -> None:
    before = own_children()

    def fails(_team: Team, _epoch: EpochOutcome, _left_s: float | None) -> ScenarioEvent | None:
        assert len(own_children()) == len(before) + 2
        raise error

    with pytest.raises((KeyboardInterrupt, SourceError)):
        solve(pair(values=3), Options(protocol="dynabt"), environment=fails)
    assert own_children() == before


def test_an_environment_for_whoever_uses_the_library() -> None:
    environment = Says(ScenarioEvent((RemoveValue("port", 3),)))
    outcome = Problem(HANGAR).solve("dynabt", "simulator", environment=environment)
    assert openings(outcome) == ["the start", "port without 3"]
