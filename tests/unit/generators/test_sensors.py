"""SensorDCSP: both models say the same, and it is what choosing triples by hand says."""

from __future__ import annotations

import itertools

from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import check_team
from robochoc.generators.sensors import Reach, grid_sensors, sensors
from robochoc.model.problem import Relation, Team
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve
from tests.support.cases import looped
from tests.support.evaluation import digest
from tests.support.examples import examples


def network(team: Team) -> tuple[list[set[int]], set[tuple[int, int]]]:
    """Return who sees each target, and who is compatible, as robots of targets know it."""
    seen = [set(robot.variables[0].domain) for robot in team.robots]
    private = [one.definition for robot in team.robots for one in robot.private]
    return seen, {(a, b) for one in private if isinstance(one, Relation) for a, b in one.tuples}


def trackable(team: Team, needed: int) -> bool:
    """Return whether disjoint cliques of sensors can be chosen, one target after the other."""
    seen, compatible = network(team)

    def choose(target: int, used: frozenset[int]) -> bool:
        if target == len(seen):
            return True
        return any(
            all(pair in compatible for pair in itertools.combinations(group, 2)) and choose(target + 1, used | {*group})
            for group in itertools.combinations(sorted(seen[target] - used), needed)
        )

    return choose(0, frozenset())


def verdict(team: Team) -> str:
    return solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR)).verdict


def test_a_seed_is_one_problem_everywhere() -> None:
    """Fixed for good: who publishes figures names seeds."""
    teams = [
        sensors(9, 3, 2, visibility=0.6),
        sensors(9, 3, 2, visibility=0.6, model="sensors"),
        grid_sensors(3, 4, 3, 1, reach=Reach(2, 2, 0.8, 0.9), needed=2),
    ]
    assert {team.name: digest(team) for team in teams} == {
        "sensors-targets-9-3-3-0.6-0.5-2": "8a41cecf05ffdb6e",
        "sensors-sensors-9-3-3-0.6-0.5-2": "eff3ae5f44bcc780",
        "grid-sensors-targets-3x4-3-2-2-2-0.8-0.9-1": "e797c178544708ae",
    }


@looped(("count", "targets", "needed"), [(8, 2, 3), (7, 2, 2), (6, 3, 2)])
@looped("seed", range(3))
def test_both_models_say_what_is_so(count: int, targets: int, needed: int, seed: int) -> None:
    of_targets, of_sensors = (
        sensors(count, targets, seed, visibility=0.7, compatibility=0.7, needed=needed, model=model)
        for model in ("targets", "sensors")
    )
    wanted = "solution" if trackable(of_targets, needed) else "no-solution"
    assert verdict(of_targets) == verdict(of_sensors) == wanted


def test_some_networks_can_and_some_cannot() -> None:
    found = {trackable(sensors(8, 2, seed, visibility=0.7, compatibility=0.7), 3) for seed in range(6)}
    assert found == {True, False}


@given(st.integers(2, 12), st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**32))
@examples(20)
def test_the_shape(count: int, targets: int, needed: int, seed: int) -> None:
    team = sensors(count, targets, seed, visibility=1, compatibility=1, needed=needed)
    check_team(team)
    seen, compatible = network(team)
    assert seen == [set(range(1, count + 1))] * targets
    assert needed == 1 or len(compatible) == count * (count - 1)
    assert len(team.variables) == targets * needed
    shared = [one for robot in team.robots for one in robot.shared]
    assert len(shared) == targets * (targets - 1) // 2 * needed**2
    check_team(sensors(count, targets, seed, visibility=1, needed=needed, model="sensors"))


def test_sensors_of_a_grid_see_the_cells_around_them() -> None:
    """CSPLib's figure: 2 x 3 sensors, and a target in each of the two cells."""
    team = grid_sensors(2, 3, 2)
    seen, compatible = network(team)
    assert seen == [{1, 2, 4, 5}, {2, 3, 5, 6}]
    assert (1, 5) in compatible
    assert (1, 3) not in compatible
    assert verdict(team) == verdict(grid_sensors(2, 3, 2, model="sensors")) == "solution"
    assert verdict(grid_sensors(2, 3, 2, needed=4)) == "no-solution"
    far, _ = network(grid_sensors(4, 4, 9, reach=Reach(sight=2)))
    assert far[4] == set(range(1, 17))  # the cell in the middle
    assert far[0] == {1, 2, 3, 5, 6, 7, 9, 10, 11}


def test_targets_have_cells_of_their_own() -> None:
    for seed in range(5):
        seen, _ = network(grid_sensors(3, 4, 6, seed))
        assert len({tuple(sorted(one)) for one in seen}) == 6
