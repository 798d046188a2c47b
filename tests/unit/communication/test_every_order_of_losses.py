"""Whole runs in every order: robots that are killed at any moment and return, events, phases, lost messages, deadlines.

The code that runs is that of `solve`, which checks each answer against all constraints.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, cast

import pytest

from robochoc.communication.control import EpochChange
from robochoc.communication.processes import processes
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.search_result import RobotsLostError
from robochoc.communication.search_state import SearchState
from robochoc.formats import read_team, write_team
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import AddValue, Constraint, RemoveAgent, RemoveValue, ScenarioEvent, Team
from robochoc.run import Options, Runtime, solve
from tests.support.compiled import plain_python_only
from tests.support.examples import count, drawn
from tests.support.explored_robots import RobotView
from tests.support.explored_team import ExploredTeam, Found
from tests.support.problems import PREDICATES, team_of

pytestmark = plain_python_only


def different(domains: Mapping[str, tuple[int, ...]], *pairs: str) -> Team:
    """Return a team whose variables in each of these pairs have different values."""
    return team_of(domains, [Constraint("C", PREDICATES[0], tuple(pair), tuple(pair)) for pair in pairs])


NARROW = different({"A": (0, 1), "B": (0,)}, "AB")
PAIR = different({"A": (0, 1), "B": (0, 1)}, "AB")
UNSOLVABLE = different({"A": (0,), "B": (0,)}, "AB")
CHAIN = different({"A": (0, 1), "B": (0, 1), "C": (0,)}, "AB", "BC")
CHANGING = replace(NARROW, scenario=(ScenarioEvent((RemoveValue("A", 0),)), ScenarioEvent((AddValue("B", 1),))))
LEAVING = replace(NARROW, scenario=(ScenarioEvent((RemoveAgent("RB"),), 1),))
"""RB leaves after the first message."""


def run(team: Team, protocol: str, **options: Any) -> Callable[[], Outcome]:  # noqa: ANN401 - as `Options`
    """Return the program of a master that solves the problem of `team`."""
    chosen = Options(protocol=protocol, runtime=Runtime.PROCESSES, **options)
    return lambda: solve(team, chosen)


def answered(result: object, _robots: Mapping[str, RobotView]) -> str:
    """Return why a run has not ended as it should: with a solution, and without one in epochs that a loss has ended."""
    if not isinstance(result, Outcome):
        return f"the run has failed: {result}"
    if any(epoch.lost and epoch.verdict != Verdict.UNKNOWN for epoch in result.epochs):
        return "an epoch in which a robot was lost has a verdict"
    has_answer = result.verdict not in {Verdict.UNKNOWN, Verdict.NO_SOLUTION}  # every team here has a solution
    return "" if has_answer else f"{result.verdict}: {result.reason}"


def in_time(result: object, robots: Mapping[str, RobotView]) -> str:
    """As `answered`; the time may be over."""
    timed_out = (
        isinstance(result, Outcome) and result.verdict == Verdict.UNKNOWN and "time was over" in str(result.reason)
    )
    return "" if timed_out else answered(result, robots)


def failed(result: object, robots: Mapping[str, RobotView]) -> str:
    """As `answered`; a run without robots has no answer."""
    return "" if isinstance(result, RobotsLostError) else answered(result, robots)


Judge = Callable[[object, Mapping[str, RobotView]], str]
LOSS = {"on_loss": "withdraw"}
CASES: dict[str, tuple[Callable[[], Outcome], Judge, dict[str, Any]]] = {
    "a robot is killed": (run(NARROW, "abt", **LOSS), answered, {"crashes": 1}),
    "both robots are killed": (run(NARROW, "dynabt", **LOSS), failed, {"crashes": 2}),
    "syncbb": (run(NARROW, "syncbb", **LOSS), answered, {"crashes": 1}),
    "the robots with least weight withdraw": (run(UNSOLVABLE, "abt", withdraw="minimum"), answered, {}),
    "the last robots withdraw": (run(UNSOLVABLE, "abt", withdraw="maximal", **LOSS), answered, {"crashes": 1}),
    "events": (run(CHANGING, "dynabt", **LOSS), answered, {"crashes": 1}),
    "a robot leaves": (run(LEAVING, "abt"), answered, {}),
    "lost messages": (run(PAIR, "dsa", message_loss=0.5, settings={"cycles": "2"}, **LOSS), answered, {"crashes": 1}),
    "the time is over": (run(NARROW, "abt", timeout=5.0, **LOSS), in_time, {"crashes": 1, "passes": 1, "pass_s": 5.0}),
}


def explored(program: Callable[[], Outcome], judge: Judge, states: int, **options: Any) -> Found:  # noqa: ANN401 - as `ExploredTeam`
    return ExploredTeam(program, judge, **options).explore(states)


@pytest.mark.parametrize("name", CASES)
@count("states", fast=2000, slow=200_000)
def test_a_run_ends_with_an_answer_whatever_happens_when(name: str, states: int) -> None:
    program, judge, options = CASES[name]
    found = explored(program, judge, states, **options)
    assert not found.fault, found


@pytest.mark.fresh
@pytest.mark.parametrize("name", CASES)
@count("walks", fast=15, slow=3000)
def test_random_orders_of_a_run_end_with_an_answer(name: str, walks: int) -> None:
    program, judge, options = CASES[name]
    found = ExploredTeam(program, judge, batches=True, **options).walk(drawn(f"orders in which {name}"), walks)
    assert not found.fault, found


@pytest.mark.fresh
@count("walks", fast=5, slow=1000)
def test_random_orders_of_three_robots_of_which_two_are_killed(walks: int) -> None:
    found = ExploredTeam(run(CHAIN, "dynabt", **LOSS), answered, crashes=2).walk(drawn("three robots"), walks)
    assert not found.fault, found


@pytest.fixture(scope="module")
def filed(tmp_path_factory: pytest.TempPathFactory) -> Team:
    """Return NARROW as files: a robot that returns reads its file again."""
    folder = tmp_path_factory.mktemp("filed") / "team"
    write_team(NARROW, folder)
    return read_team(folder)


@pytest.mark.parametrize("protocol", ["abt", "dynabt"])
@count("states", fast=2000, slow=200_000)
def test_a_robot_that_is_killed_at_any_moment_returns(filed: Team, protocol: str, states: int) -> None:
    found = explored(run(filed, protocol, spares=1), answered, states, crashes=1)
    assert not found.fault, found


@pytest.mark.fresh
@count("walks", fast=15, slow=3000)
def test_random_orders_in_which_robots_return_and_are_killed_again(filed: Team, walks: int) -> None:
    team = ExploredTeam(run(filed, "dynabt", spares=1, **LOSS), failed, crashes=2, batches=True)
    found = team.walk(drawn("robots return"), walks)
    assert not found.fault, found


# Planted faults


def keeps_gone(epoch: int, change: bytes, _gone: list[str]) -> EpochChange:
    """Do not tell robots who has left: they write into queues that nobody reads."""
    return EpochChange(epoch, change, [])


def ignores_loss(self: SearchState, wall_s: float) -> Any:  # noqa: ANN401 - a planted fault
    """Believe the verdict of a search in which a robot was lost."""
    result = RESULT(self, wall_s)
    return replace(result, verdict=self.verdict or Verdict.SOLUTION) if self.lost else result


def searches_on(self: SearchState) -> bool:
    """Continue the search when a robot is lost."""
    return self.max_messages is not None and self.counters.sent >= self.max_messages


def loses_reported(self: ProcessesRun) -> None:
    """Lose robots that have ended after their report; others are never noticed."""
    for robot, messages in cast("Any", self._pool).ended():
        for message in messages:
            self._handle(robot, message)
        if self.state.has_reported(robot.name):
            self._give_up([robot])


RESULT: Callable[..., Any] = SearchState.result
PLANTED: dict[str, tuple[object, str, Any]] = {
    "gone robots are kept": (processes, "EpochChange", keeps_gone),
    "a loss is ignored": (SearchState, "result", ignores_loss),
    "the search continues": (SearchState, "broken_off", property(searches_on)),
    "an end is not noticed": (ProcessesRun, "_handle_ends", loses_reported),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_fault_is_found(name: str, filed: Team, monkeypatch: pytest.MonkeyPatch) -> None:
    owner, attribute, fault = PLANTED[name]
    monkeypatch.setattr(owner, attribute, fault)
    found = explored(run(filed, "dynabt", spares=1), answered, 20_000, crashes=1)
    assert found.fault, found
