"""Flights of teams on maps: random teams on random maps, checked by brute force over the log; and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robochoc.flight.flight import fly
from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.preview import preview_of
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.maps.ground_map import GroundMap, ground_map_json, read_ground_map
from robochoc.maps.routes.floor_plan import FloorPlan
from robochoc.maps.walls import PixelFrame
from robochoc.model.problem import Team
from tests.support.examples import examples
from tests.support.flights import mission_to
from tests.support.flights_on_maps import flown_team, gaps
from tests.support.flown_teams import FlownTeam
from tests.support.maps import ROOMS, write_map
from tests.support.outcomes import outcome_of
from tests.support.program import ROOT
from tests.support.ways_on_maps import NO_TEAM, refused_way

BUILDING = str(ROOT / "docs/examples/building/building.yaml")
NO_ROOM = "and the minimum is"
"""Words of the refusal of a flight: places are too near each other."""


def hall(folder: Path, **how: object) -> tuple[Team, GroundMap]:
    path = write_map(folder, ROOMS)
    given = {"map": str(path), "at": "1,1 1,2.5", "cell": 0.5, **how}
    return formation(MapChoice(**given), anchor="3.5,1.75", heading=0)  # type: ignore[arg-type]


def sent(team: Team, ground: GroundMap, *places: tuple[int, int], withdrawn: tuple[str, ...] = ()) -> Mission:
    """Return the mission of robots that go to these cells, given by x and y."""
    cells = [(y - ground.first[1]) * ground.columns + x - ground.first[0] for x, y in places]
    return mission_to(team, ground, cells, withdrawn)


# Seeds with a building, a loose map, narrow doors, large pixels, downwash; one that once led through a wall (45), and
# one with corners so close to each other that a drone that takes no time for them overshoots (115).
@pytest.mark.parametrize("seeds", [(45, 115), pytest.param((1, 4), marks=pytest.mark.slow)])
def test_drones_fly_around_walls_and_keep_from_each_other(seeds: tuple[int, ...], tmp_path: Path) -> None:
    for seed in seeds:
        made = flown_team(seed, tmp_path)
        assert isinstance(made, FlownTeam)
        assert made.faults() == []


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_drones_fly_around_walls_on_hundreds_of_maps(block: int, tmp_path: Path) -> None:
    seeds = range(100 + 20 * block, 120 + 20 * block)
    made = {seed: flown_team(seed, tmp_path) for seed in seeds}
    flown = {seed: one for seed, one in made.items() if isinstance(one, FlownTeam)}
    assert {seed: one.faults() for seed, one in flown.items() if one.faults()} == {}
    refused = [one for one in made.values() if isinstance(one, str) and not one.startswith("no team")]
    assert [one for one in refused if NO_ROOM not in one] == []
    assert len(flown) >= 5, "most teams that could be made fly"


# If ways kept 0.7 of the radius only, flights of these would be refused.
@example(15)
@example(24)
@example(35)
@given(st.integers(0, 2**32))
@examples(6, 120)
def test_no_flight_of_a_generated_team_is_refused_for_a_narrow_way(seed: int) -> None:
    with TemporaryDirectory() as folder:
        assert refused_way(seed, Path(folder)) in {"", NO_TEAM}


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_no_flight_of_hundreds_of_teams_is_refused_for_a_narrow_way(block: int, tmp_path: Path) -> None:
    said = {seed: refused_way(seed, tmp_path) for seed in range(40 * block, 40 * block + 40)}
    assert {seed: why for seed, why in said.items() if why not in {"", NO_TEAM}} == {}
    assert 4 * list(said.values()).count("") > len(said), "many teams can be made"


def test_a_flight_takes_as_long_as_the_team_was_told(tmp_path: Path) -> None:
    """A single robot in each case: it waits for nobody."""
    for place, told_s in (((7, 5), 7.6), ((2, 5), 3.0), ((7, 2), 6.6)):
        team, ground = hall(tmp_path, at="1,1")
        mission = sent(team, ground, place)
        log = fly(mission)
        # A second of standing, up to its height, and the way.
        taken = log.legs[0].ends_s - log.legs[0].begins_s
        assert told_s - 0.5 <= taken <= told_s + 5


def test_without_walls_they_would_fly_through_them(tmp_path: Path) -> None:
    """The check can fail: the same flight as if there were no walls goes through one."""
    team, ground = hall(tmp_path)
    mission = sent(team, ground, (7, 2), (7, 5))
    through = fly(replace(mission, walls=None))
    assert gaps(ROOMS, 0.5, through.positions[:, :, :2].reshape(-1, 2)).min() == 0
    around = fly(mission)
    assert gaps(ROOMS, 0.5, around.positions[:, :, :2].reshape(-1, 2)).min() >= 0.2
    assert around.errors_m.max() < 0.01
    assert around.nearest_wall is not None
    assert around.nearest_wall.set_m == 0.2


def test_where_robots_stand_and_where_they_land(tmp_path: Path) -> None:
    team, ground = hall(tmp_path, at="1.1,0.9 1,2.5")
    mission = sent(team, ground, (7, 2), (7, 5), withdrawn=("Robot1",))
    assert mission.drones[0].home == pytest.approx((1.1, 0.9, 0))
    assert mission.scale == 0.5
    assert mission.legs[-1].goals[0].lands
    log = fly(mission)
    # It lands where it has stood: the edge of the map is behind a wall.
    assert log.positions[-1, 0] == pytest.approx((1.1, 0.9, 0), abs=0.03)
    assert gaps(ROOMS, 0.5, log.positions[:, :, :2].reshape(-1, 2)).min() >= 0.2


def test_one_that_falls_and_an_obstacle_are_flown_around_between_the_walls(tmp_path: Path) -> None:
    team, ground = hall(tmp_path)
    mission = sent(team, ground, (7, 2), (7, 5))
    conditions = FlightConditions(failures=(MotorFailure("Robot1", 3.0),))
    log = fly(mission, conditions)
    counted = gaps(ROOMS, 0.5, log.positions[:, 1, :2])
    assert counted.min() >= 0.2
    assert log.errors_m[1] < 0.01
    blocked = fly(mission, FlightConditions(obstacles=((3.5, 2.5, 0.5),)))
    assert "beside its place" in " ".join(event.what for event in blocked.events)
    assert gaps(ROOMS, 0.5, blocked.positions[:, :, :2].reshape(-1, 2)).min() >= 0.2


def test_what_cannot_be_flown_is_said_in_one_sentence(tmp_path: Path) -> None:
    team, ground = hall(tmp_path, radius=0.3)
    with pytest.raises(ValueError, match=r"Robot1 has no route around the walls from \(1.00, 1.00\) to \(3.50, 1.00\)"):
        fly(sent(team, ground, (7, 2), (7, 5)))
    team, ground = hall(tmp_path)
    with pytest.raises(ValueError, match=r"Robot2 is at \(2.00, 0.50\), in a wall"):
        fly(sent(team, ground, (7, 2), (4, 1)))
    with pytest.raises(ValueError, match=r"the map with walls has the scale 0.5 m"):
        mission_of(
            outcome_of({"V1": 40}),
            team,
            2.0,
            ground,
        )
    with pytest.raises(ValueError, match=r"goals of Robot1 and Robot2 are 0\.50 m apart"):
        fly(sent(team, ground, (7, 2), (7, 3)), FlightConditions(distance=0.6))


def test_a_map_with_tiny_cells_is_flown_in_a_picture_with_its_walls(tmp_path: Path) -> None:
    path = write_map(tmp_path, ROOMS, resolution="0.05", origin="[100, 200, 0]")
    choice = MapChoice(map=str(path), at="100.1,200.1 100.1,200.25", cell=0.05, radius=0.01)
    team, ground = formation(choice, anchor="100.35,200.2", spacing=0.1)
    values = {name: own.variables[0].domain.ranges[0][0] for name, own in zip(("V1", "V2"), team.robots, strict=True)}
    values["V2"] = next(value for value in team.robots[1].variables[0].domain if value != values["V1"])
    preview = preview_of(
        mission_of(
            outcome_of(values),
            team,
            ground=ground,
        )
    )
    assert preview.flown, preview.why_not
    assert preview.mission.scale == 1
    walls = preview.mission.walls
    assert walls is not None
    assert isinstance(walls.frame, PixelFrame)
    assert walls.frame.size == pytest.approx(1)
    plan = FloorPlan(walls.solid, walls.frame, walls.radius)
    assert plan.clearances(preview.flown.positions.reshape(-1, 3), 1.0).min() >= 0.17


def test_walls_in_a_map_are_read_and_wrong_ones_told(tmp_path: Path) -> None:
    _, ground = hall(tmp_path)
    whole = json.loads(ground_map_json(ground))
    assert read_ground_map(json.dumps(whole).encode()) == ground
    for wrong, why in (
        ({"free": "AAAA"}, "its walls have 63 pixels, but free has flags for 24"),
        ({"occupied": ""}, "occupied has flags for 0"),
        ({"columns": 10**6, "rows": 10**6}, "its walls have 1,000,000,000,000 pixels, more than 4,000,000"),
        ({"resolution": 0}, "resolution"),
        ({"radius": -1}, "radius"),
        ({"speed": 0}, "speed"),
        ({"free": "*"}, "base64"),
        ({"height": 2}, "height"),
        ({"corner": [0]}, "length"),
    ):
        with pytest.raises(ValueError, match=why):
            read_ground_map(json.dumps({**whole, "walls": {**whole["walls"], **wrong}}).encode())
    with pytest.raises(ValueError, match="no scale"):
        read_ground_map(json.dumps({key: value for key, value in whole.items() if key != "scale"}).encode())
    assert np.isfinite(ground.scale or np.nan)
