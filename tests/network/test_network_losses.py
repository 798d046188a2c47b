"""What robots on a network show: when others are lost, and when others want to see more than their files say."""

from __future__ import annotations

import os
import signal
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.communication.network.local import LocalNetwork
from robochoc.communication.network.settings import NetworkSettings
from robochoc.communication.search_result import RobotsLostError
from robochoc.formats import PREDEFINED
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.generators.tasks import tasks
from robochoc.journal.events import AnyEvent, Lost, Sent
from robochoc.model.costs import normalized
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint
from robochoc.model.team_edits import without_robots
from robochoc.run.options import OnLoss, Options, Runtime
from robochoc.run.orchestrator import solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.run.scenario import FinishedEpoch, ScenarioRun
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import violations
from tests.support.complex_problems import complex_team
from tests.support.encrypted_problems import affordable, short_settings
from tests.support.limits import HANG_S
from tests.support.loose_problems import minimum_cost, untold_interface
from tests.support.paused_abt import PausedABT

DIFFER = PREDEFINED["ne"]
TEAM = complex_team(
    {"V": ["v", "w"], "A": ["a"], "B": ["b"]},
    {"v": [1, 2], "w": [1, 2, 3], "a": [1, 2], "b": [1, 2]},
    [Constraint("C", DIFFER, pair, pair) for pair in (("v", "a"), ("w", "b"))],
)
"""Who is without B shows w to nobody."""


@pytest.mark.slow
def test_those_who_are_left_go_on_with_the_values_that_they_had(tmp_path: Path) -> None:
    """They still show what B saw, and whoever reads their values knows."""
    events: list[AnyEvent] = []
    go = tmp_path / "go"

    def observe(event: AnyEvent) -> None:
        if isinstance(event, Sent) and not any(isinstance(one, Sent) for one in events):
            os.kill(network.processes["B"].pid or 0, signal.SIGKILL)
        if isinstance(event, Lost):
            go.touch()
        events.append(event)

    parameters = RunParameters(settings={"file": str(go)})
    journey = ScenarioRun(TEAM, None, CompiledTeam, lambda: None, parameters=parameters)
    played: list[FinishedEpoch] = []
    with LocalNetwork(
        journey.compiled(), PausedABT, observer=observe, settings=NetworkSettings(survive=True), parameters=parameters
    ) as network:
        for one in journey.epochs(network, lambda _: None):
            played.append(one)
            shown = {name: member.robot.interface for name, member in network.master.members.robots.items()}
            assert shown == {robot.name: robot.interface for robot in one.epoch.team.robots}
    first, second = played
    assert list(first.result.lost) == ["B"]
    assert second.epoch.team["V"].interface == ("v", "w")
    assert second.result.verdict is Verdict.SOLUTION
    assert second.result.assignments["V"]["v"] != second.result.assignments["A"]["a"]


@pytest.mark.slow
def test_who_is_asked_to_show_more_is_not_misread() -> None:
    """Others once took x for y: ABT found no solution."""
    team = untold_interface()
    with LocalNetwork(team, protocol_named("abt")) as network:
        result = network.search(60)
    assert result.verdict is Verdict.SOLUTION
    assert not list(violations(team, {**result.assignments["A"], **result.assignments["B"]}))


def test_a_robot_that_is_killed_at_a_set_time() -> None:
    options = Options(runtime=Runtime.NETWORK, kill=(Kill("Robot2.2", 0),), on_loss=OnLoss.WITHDRAW)
    outcome = solve(queens3d(4), options)
    assert outcome.epochs[0].lost == ("Robot2.2",)
    assert len(outcome.epochs[1].robots) == 15


@pytest.mark.slow
@pytest.mark.parametrize("protocol", protocol_names())
def test_whatever_the_protocol_the_verdict_is_true_for_those_who_are_left(protocol: str) -> None:
    kind = protocol_named(protocol)
    costs, tightness = (9, 0.0) if kind.traits.costs else (None, 0.2)
    team = random_csp(6, 3, 0.5, tightness, seed=3, connected=True, max_cost=costs)
    team = affordable(protocol, lambda: team, most=20_000)
    if kind.traits.allocates:
        team = normalized(tasks(6, 4, 3))
    options = Options(
        protocol=protocol,
        runtime=Runtime.NETWORK,
        kill=(Kill(team.order[2], 0),),
        on_loss=OnLoss.WITHDRAW,
        timeout=HANG_S,
        settings=short_settings(protocol, 20),
    )
    outcome = solve(team, options)
    assert outcome.epochs[0].lost == (team.order[2],)
    truth = minimum_cost(without_robots(team, {team.order[2]}))
    assert truth < INFINITE
    if outcome.verdict is Verdict.UNKNOWN:  # an incomplete protocol may break a constraint in all its cycles
        assert not kind.traits.complete
        return
    assert outcome.verified
    assert outcome.cost is not None
    assert outcome.cost >= truth
    assert outcome.cost == truth or not kind.traits.complete
    with pytest.raises(RobotsLostError):
        solve(team, replace(options, on_loss=OnLoss.FAIL))
