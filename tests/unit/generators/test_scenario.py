"""Random scenarios: every event is one that the team can take, and the epochs' answers are right."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team, read_team, write_team
from robochoc.generators.coloring import coloring
from robochoc.generators.graphs import tree
from robochoc.generators.meetings import meetings
from robochoc.generators.random_csp import random_csp, random_on
from robochoc.generators.scenario import ChangeKind, random_scenario
from robochoc.generators.sensors import grid_sensors
from robochoc.model.change import apply_changes, describe_change
from robochoc.model.problem import Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.evaluation import best
from tests.support.examples import examples
from tests.support.program import robochoc_within
from tests.support.random_changes import stages

TEAMS = [
    random_csp(5, 3, 0.6, 0.3, 2),
    random_csp(5, 2, 0.6, 0, 2, max_cost=9),
    coloring(6, 2, 2.5),
    meetings(4, 3, 2, 3),
    grid_sensors(2, 4, 3, model="sensors"),
]


@given(st.sampled_from(TEAMS), st.integers(1, 5), st.floats(0, 1), st.integers(0, 2**32))
@examples(30)
def test_a_team_can_take_its_scenario(team: Team, events: int, rate: float, seed: int) -> None:
    changing = random_scenario(team, events, rate, seed)
    check_team(changing)
    shared = sum(len(robot.shared) for robot in team.robots)
    assert [len(event.changes) for event in changing.scenario] == [max(1, round(rate * shared))] * events
    assert changing == random_scenario(team, events, rate, seed)
    now = team
    for event in changing.scenario:
        for change in event.changes:
            now = apply_changes(now, [change])
            assert len(now.robots) > 1
            assert all(len(variable.domain) for variable in now.variables.values())


@looped("kind", [*ChangeKind])
def test_kinds_of_changes(kind: ChangeKind) -> None:
    opposite = {"remove-": "add-", "add-": "remove-"}
    start = next(word for word in opposite if kind.startswith(word))
    both = {kind, ChangeKind(kind.replace(start, opposite[start]))}
    changing = random_scenario(random_csp(6, 3, 0.6, 0.3, 2), 8, 0.2, 5, kinds=both)
    said = {type(change).__name__ for event in changing.scenario for change in event.changes}
    assert said == {"".join(word.capitalize() for word in one.split("-")) for one in both}


def test_a_seed_is_one_scenario_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    changing = random_scenario(random_csp(5, 3, 0.6, 0.3, 2), 4, 0.4, 2)
    assert changing.name == "random-5-3-0.6-0.3-2-events4-0.4-2"
    assert [[describe_change(change, changing) for change in event.changes] for event in changing.scenario] == [
        ["+Late1", "V1 without 3"],
        ["-Robot5", "V1 with 3"],
        ["+Added2 (Robot1, Robot3)", "-C3.5 (Robot3, Late1)"],
        ["+Robot5", "+C3.5 (Robot3, Late1)"],
    ]


@looped("team", TEAMS[:3])
def test_files_say_the_same(team: Team, tmp_path: Path) -> None:
    for seed in range(3):
        changing = random_scenario(team, 4, 0.3, seed, after=50)
        write_team(changing, tmp_path / str(seed))
        read = read_team(tmp_path / str(seed))
        assert {event.after for event in read.scenario} == {50}
        assert [best(now) for now in stages(read)] == [best(now) for now in stages(changing)]


@looped("seed", range(3))
def test_each_epoch_is_solved(seed: int) -> None:
    changing = random_scenario(random_on(tree(5), 2, 0, 4, max_cost=9), 4, 0.5, seed)
    outcome = solve(changing, Options(protocol="syncbb", runtime=Runtime.SIMULATOR))
    assert [epoch.cost for epoch in outcome.epochs] == [best(now) for now in stages(changing)]


@pytest.mark.usefixtures("in_a_folder")
def test_the_command_writes_a_copy(tmp_path: Path) -> None:
    team = random_csp(5, 3, 0.6, 0.3, 2)
    write_team(team, tmp_path / "team")
    done = robochoc_within("generate", "scenario", "team", "--events", 3, "--rate", 0.4, "-o", "out")
    assert done.stdout == "out: 3 events, 6 changes; next: robochoc solve out\n"
    assert len(read_team(tmp_path / "out").scenario) == 3
    assert not read_team(tmp_path / "team").scenario
    refused = robochoc_within("generate", "scenario", "out", "--events", 1, "-o", "more")
    assert (refused.returncode, "has a scenario already" in refused.stderr) == (2, True)
    assert robochoc_within("generate", "scenario", "nowhere", "--events", 1).returncode in {1, 2}
    assert not (tmp_path / "more").exists()
