"""A three-dimensional map of a flight: drones are in the air in the beginning, and its walls are drawn."""

from __future__ import annotations

import json
from itertools import product

import numpy as np
import pytest

from robochoc.flight.flight import fly
from robochoc.flight.mission import MissionBlock, mission_of
from robochoc.flight.preview import preview_of
from robochoc.maps.ground_map import GroundMap, Volume, ground_map_json, read_ground_map
from robochoc.model.expression import Constant, Name
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Domain, Robot, Team, Topic, Variable
from robochoc.view.drawing import commands
from robochoc.view.page import legend
from robochoc.view.scene import scene_of
from robochoc.view.walls import blocked_cell_faces
from tests.support.outcomes import outcome_of

TEAM = Team(
    "flying",
    tuple(
        Robot(
            name,
            (Variable(f"{name}.z", Domain("D", (range(-3, 4),))),),
            topics=(Topic(f"/{name}/waypoint", x=Constant(x), y=Constant(2), z=Name(f"{name}.z")),),
        )
        for name, x in (("A", 2), ("B", 4))
    ),
)
FLOOR = tuple((x, y, 1) for x, y in product(range(1, 7), range(1, 5)))
VOLUME = Volume(6, -3, {"A": 2, "B": 5}, FLOOR)
GROUND = GroundMap(6, 4, {"A": (1, 1), "B": (5, 4)}, scale=0.5, volume=VOLUME)


def outcome(a: int, b: int) -> Outcome:
    return outcome_of({"A.z": a, "B.z": b}, team="flying")


def test_drones_are_in_the_air_in_the_beginning_where_the_map_says() -> None:
    mission = mission_of(outcome(2, -2), TEAM, ground=GROUND)
    assert [drone.home for drone in mission.drones] == [(0.5, 0.5, -1), (2.5, 2, 0.5)]
    assert {number: goal.at for number, goal in mission.legs[0].goals.items()} == {0: (1, 1, 1), 1: (2, 1, -1)}
    assert [(axis.first, axis.last) for axis in mission.axes] == [(1, 6), (1, 4), (-3, 2)]
    assert mission.ground == -2
    assert mission.blocks[0] == MissionBlock((0.5, 0.5, -1.5), is_cube=True)
    # Who is not among those of the map stands on the ground, as always.
    some = GroundMap(6, 4, {"A": (1, 1)}, volume=Volume(6, -3, {"A": 2}))
    assert [drone.home[2] for drone in mission_of(outcome(2, -2), TEAM, ground=some).drones] == [-2, -4]


def test_they_fly_to_goals_below_where_they_were() -> None:
    mission = mission_of(outcome(2, -2), TEAM, ground=GROUND)
    flown = fly(mission)
    assert flown.errors_m.max() < 0.05
    assert flown.events == ()
    assert flown.positions[0] == pytest.approx(np.array([drone.home for drone in mission.drones]), abs=0.01)
    assert flown.positions[:, :, 2].min() > mission.ground
    preview = preview_of(mission)
    assert preview.flown, preview.why_not


def test_walls_are_drawn_and_named_in_the_legend() -> None:
    run = outcome(2, -2)
    scene = scene_of(run, mission_of(run, TEAM, ground=GROUND))
    assert {block.top for block in scene.blocks} == {(x, y, -3) for x, y, _ in FLOOR}
    drawn = b"".join(commands(scene))
    assert b"/meshcat/walls" in drawn
    assert b"/meshcat/blocks" not in drawn
    assert "blocked cell" in legend(scene)


def test_a_wall_has_a_face_towards_each_free_cell_of_the_map() -> None:
    chance = np.random.default_rng(3)
    low, high = np.array([-1, 0, 2]), np.array([3, 4, 5])
    cells = [*product(range(-1, 4), range(5), range(2, 6))]
    for _ in range(20):
        taken = sorted(cell for cell in cells if chance.random() < 0.4)
        sides = chance.integers(0, 64, len(taken))
        shape = blocked_cell_faces(np.array(taken), sides, low, high, 0.9)
        assert shape is not None
        wanted = set()
        for (x, y, z), seen in zip(taken, sides.tolist(), strict=True):
            for bit, move in enumerate(((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))):
                if not seen & 1 << bit:
                    continue
                if (other := (x + move[0], y + move[1], z + move[2])) in cells and other not in taken:
                    wanted.add(((x, y, z), move))
        found = set()
        for corners in shape.vertices[shape.faces]:
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            move = np.rint(normal / np.linalg.norm(normal)).astype(int)
            wall = np.rint(corners.mean(axis=0) - move / 2).astype(int)
            found.add((tuple(wall.tolist()), tuple(move.tolist())))
        assert found == wanted
        assert len(shape.faces) == 2 * len(wanted)
    assert blocked_cell_faces(np.array(cells), np.full(len(cells), 63), low, high, 0.9) is None
    assert blocked_cell_faces(np.zeros((0, 3), dtype=np.int64), np.zeros(0, dtype=np.int64), low, high, 0.9) is None


def test_a_volume_is_read_and_a_wrong_one_told() -> None:
    assert read_ground_map(ground_map_json(GROUND)) == GROUND
    volume = {"levels": 6, "first": -3, "starts": {"A": 6}, "blocked": [[6, 4, 6]], "sides": [5]}
    whole = {"columns": 6, "rows": 4, "volume": volume}
    assert read_ground_map(json.dumps(whole).encode()).volume == Volume(6, -3, {"A": 6}, ((6, 4, 6),), (5,))
    for wrong, why in (
        ({"levels": 0}, "levels"),
        ({"levels": 1001}, "levels"),
        ({"starts": {"A": 7}}, "A is at level 7, above the map's 6"),
        ({"blocked": [[6, 5, 1]]}, r"a blocked cell is at \(6, 5, 1\), outside the map of 6 x 4 x 6 cells"),
        ({"blocked": [[1, 1]]}, "length"),
        ({"blocked": [[1, 1, 1]] * 10_001}, "length"),
        ({"last": 3}, "last"),
        ({"sides": [64]}, "sides"),
        ({"sides": [1, 2]}, "it has 2 sides, but 1 blocked cells"),
    ):
        with pytest.raises(ValueError, match=why):
            read_ground_map(json.dumps({**whole, "volume": {**volume, **wrong}}).encode())
