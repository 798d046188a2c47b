"""Flights of teams on OctoMaps: random teams on random maps, checked by brute force over the log; and refusals."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from robochoc.flight.flight import fly
from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.preview import preview_of
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.maps.ground_map import GroundMap, ground_map_json, read_ground_map
from robochoc.model.problem import Team
from tests.support.flights import mission_to
from tests.support.flights_in_space import flown_in_space, gaps_in_space
from tests.support.flown_teams import FlownTeam
from tests.support.octomaps import FREE, Voxel, write_octomap
from tests.support.outcomes import outcome_of

NO_ROOM = re.compile(
    r"that keeps its radius of|and the minimum is"
    r"|no order of flying was found in which (\w+ gets past the others|\w+, .+ get past each other) between the walls"
)
"""Words of the refusals of a flight: a way is too narrow, places are too near, or drones block each other."""
FLOORS = {
    (x, y, z): FREE for x, y, z in product(range(8), range(4), range(5)) if z != 2 or (x in {6, 7} and y in {2, 3})
}
"""Two storeys of 0.5 m a voxel, with a hole in the floor between them."""


def floors(
    folder: Path, voxels: dict[Voxel, int] | None = None, anchor: str = "1,1,0.5", **how: object
) -> tuple[Team, GroundMap]:
    path = write_octomap(folder / "floors.bt", voxels or FLOORS)
    given = {"map": str(path), "at": "0.5,0.5,0.5 1.5,0.5,0.5", "cell": 0.5, "cells": 200, **how}
    team, ground = formation(MapChoice(**given), anchor=anchor)  # type: ignore[arg-type]
    return team, read_ground_map(ground_map_json(ground))


def sent(
    team: Team, ground: GroundMap, *places: tuple[float, float, float], withdrawn: tuple[str, ...] = ()
) -> Mission:
    """Return the mission of robots that go to these places, in metres."""
    volume = ground.volume
    assert volume is not None
    firsts = (*ground.first, volume.first)
    cells = []
    for place in places:
        x, y, z = (round(part / (ground.scale or 1)) - first for part, first in zip(place, firsts, strict=True))
        cells.append((z * ground.rows + y) * ground.columns + x)
    return mission_to(team, ground, cells, withdrawn)


# A house with large voxels, a loose map, and a wall with a narrow hole.
@pytest.mark.parametrize("seed", [7, 11])
def test_drones_fly_around_voxels_and_keep_from_each_other(seed: int, tmp_path: Path) -> None:
    made = flown_in_space(seed, tmp_path)
    assert isinstance(made, FlownTeam)
    assert made.faults() == []


@pytest.mark.slow
@pytest.mark.parametrize("block", range(10))
def test_drones_fly_around_voxels_on_hundreds_of_maps(block: int, tmp_path: Path) -> None:
    seeds = range(100 + 20 * block, 120 + 20 * block)
    made = {seed: flown_in_space(seed, tmp_path) for seed in seeds}
    flown = {seed: one for seed, one in made.items() if isinstance(one, FlownTeam)}
    assert {seed: one.faults() for seed, one in flown.items() if one.faults()} == {}
    refused = [one for one in made.values() if isinstance(one, str) and not one.startswith("no team")]
    assert [one for one in refused if not NO_ROOM.search(one)] == []
    assert len(flown) >= 5, "most teams that could be made fly"


def test_without_walls_they_would_fly_through_the_floor(tmp_path: Path) -> None:
    """The check can fail: the same flight as if there were no walls goes through the floor."""
    team, ground = floors(tmp_path)
    mission = sent(team, ground, (0.5, 0.5, 2), (1.5, 0.5, 2))
    through = fly(replace(mission, walls=None))
    assert gaps_in_space(FLOORS, 0.5, through.positions.reshape(-1, 3)).min() == 0
    around = fly(mission)
    assert gaps_in_space(FLOORS, 0.5, around.positions.reshape(-1, 3)).min() >= 0.2
    assert around.errors_m.max() < 0.01
    assert around.nearest_wall is not None
    assert around.nearest_wall.set_m == 0.2


def test_robots_begin_exactly_where_they_are_and_go_back_there(tmp_path: Path) -> None:
    team, ground = floors(tmp_path, at="0.6,0.55,0.65 1.5,0.5,0.5")
    mission = sent(team, ground, (3.5, 1.5, 2), (1.5, 0.5, 2), withdrawn=("Robot1",))
    assert mission.drones[0].home == pytest.approx((0.6, 0.55, 0.65))
    assert mission.legs[-1].goals[0].at == mission.drones[0].home
    log = fly(mission)
    assert log.positions[-1, 0] == pytest.approx((0.6, 0.55, 0.65), abs=0.03)
    assert log.positions[-1, 1] == pytest.approx((1.5, 0.5, 2), abs=0.03)
    assert gaps_in_space(FLOORS, 0.5, log.positions.reshape(-1, 3)).min() >= 0.2


def test_an_obstacle_is_flown_around_between_the_walls(tmp_path: Path) -> None:
    team, ground = floors(tmp_path)
    mission = sent(team, ground, (3.5, 0.5, 0.5), (1.5, 1.5, 0.5))
    log = fly(mission, FlightConditions(obstacles=((2.2, 0.4, 0.5),)))
    assert np.linalg.norm(log.positions[:, 0] - (2.2, 0.4, 0.5), axis=1).min() > 0.4
    assert gaps_in_space(FLOORS, 0.5, log.positions.reshape(-1, 3)).min() >= 0.2
    assert log.errors_m.max() < 0.01


def test_who_fails_falls_to_the_floor_below_and_is_flown_around(tmp_path: Path) -> None:
    team, ground = floors(tmp_path, at="0.5,0.5,2 3.5,0.5,2")
    mission = sent(team, ground, (2, 0.5, 2), (0.5, 1.5, 2))
    log = fly(mission, FlightConditions(failures=(MotorFailure("Robot1", 1.6),)))
    assert np.isnan(log.errors_m[0])
    # The upper storey begins at 1.5 m; below it are a floor and another storey.
    assert log.positions[-1, 0, 2] == pytest.approx(1.5, abs=0.01)
    assert log.positions[:, 0, 2].min() > 1.45
    assert log.errors_m[1] < 0.01
    assert gaps_in_space(FLOORS, 0.5, log.positions[:, 1]).min() >= 0.2


def test_what_cannot_be_flown_is_said_in_one_sentence(tmp_path: Path) -> None:
    shut = {at: kind for at, kind in FLOORS.items() if at[2] != 2 or at[:2] == (7, 3)}
    team, ground = floors(tmp_path, shut, radius=0.3, at="1,1,0.5 2,1,0.5")
    with pytest.raises(
        ValueError, match=r"no route around the walls from \(1.00, 1.00, 0.50\) to \(1.00, 1.00, 2.00\)"
    ):
        fly(sent(team, ground, (1, 1, 2), (2, 1, 0.5)))
    team, ground = floors(tmp_path)
    with pytest.raises(ValueError, match=r"Robot2 is at \(1.50, 0.50, 1.00\), in a wall"):
        fly(sent(team, ground, (3.5, 0.5, 0.5), (1.5, 0.5, 1)))
    with pytest.raises(ValueError, match=r"the map with walls has the scale 0.5 m"):
        mission_of(
            outcome_of({"V1": 40}),
            team,
            2.0,
            ground,
        )
    pipe = {(x, 0, 0): FREE for x in range(8)}
    team, ground = floors(tmp_path, pipe, "2,0.25,0.25", at="0.25,0.25,0.25 3.75,0.25,0.25", cell=0.25)
    with pytest.raises(ValueError, match="Robot1, Robot2 get past each other between the walls: use a smaller"):
        fly(sent(team, ground, (3.75, 0.25, 0.25), (0.25, 0.25, 0.25)))


def test_a_map_with_tiny_cells_is_flown_in_a_picture_with_its_walls(tmp_path: Path) -> None:
    path = write_octomap(tmp_path / "tiny.bt", FLOORS, "0.05")
    choice = MapChoice(map=str(path), at="0.05,0.05,0.05 0.15,0.05,0.05", cell=0.05, radius=0.01, cells=200)
    team, ground = formation(choice, anchor="0.1,0.1,0.05")
    preview = preview_of(sent(team, ground, (0.05, 0.05, 0.2), (0.15, 0.05, 0.05)))
    assert preview.flown, preview.why_not
    assert preview.mission.scale == 1
    walls = preview.mission.walls
    assert walls is not None
    assert walls.frame.size == pytest.approx(1)
    assert preview.flown.nearest_wall is not None
    assert preview.flown.nearest_wall.distance_m >= preview.flown.nearest_wall.set_m
    high = preview.flown.positions[:, 0, 2]
    assert high[-1] - high[0] == pytest.approx(3, abs=0.05)


def test_voxels_in_a_map_are_read_and_wrong_ones_told(tmp_path: Path) -> None:
    _, ground = floors(tmp_path)
    whole = json.loads(ground_map_json(ground))
    assert read_ground_map(json.dumps(whole).encode()) == ground

    def read(wrong: Mapping[str, object], **also: object) -> GroundMap:
        volume = {**whole["volume"], "walls": {**whole["volume"]["walls"], **wrong}}
        return read_ground_map(json.dumps({**whole, "volume": volume, **also}).encode())

    for wrong, why in (
        ({"free": "AAAA"}, "its walls have 420 voxels, but free has flags for 24"),
        ({"occupied": ""}, "occupied has flags for 0"),
        ({"columns": 10**7, "rows": 10**7}, "its walls have 700,000,000,000,000 voxels, more than 16,000,000"),
        ({"levels": 0}, "levels"),
        ({"resolution": 0}, "resolution"),
        ({"radius": -1}, "radius"),
        ({"speed": 0}, "speed"),
        ({"yaw": 1}, "yaw"),
        ({"corner": [0, 0]}, "length"),
    ):
        with pytest.raises(ValueError, match=why):
            read(wrong)
    pixels = {"columns": 1, "rows": 1, "resolution": 1, "corner": [0, 0], "radius": 0, "speed": 1}
    with pytest.raises(ValueError, match="both walls in the plane and a volume"):
        read({}, walls={**pixels, "free": "AA==", "occupied": "AA=="})
    with pytest.raises(ValueError, match="no scale"):
        read({}, scale=None)
