"""A map of the ground: where a flight begins, and what it goes over."""

from __future__ import annotations

import json

import numpy as np
import pytest

from robochoc.flight.flight import fly
from robochoc.flight.mission import MissionBlock, mission_of
from robochoc.flight.preview import preview_of
from robochoc.maps.ground_map import MAX_BYTES, BlockedCell, GroundMap, ground_map_json, read_ground_map
from robochoc.model.expression import Constant, Name
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import Domain, Robot, Team, Topic, Variable
from robochoc.view.drawing import commands
from robochoc.view.page import legend
from robochoc.view.scene import DrawnBlock, scene_of
from tests.support.outcomes import outcome_of

ROBOTS = tuple(
    Robot(
        name,
        (Variable(f"{name}.x", Domain("D", (range(1, 7),))),),
        topics=(Topic(f"/{name}/waypoint", x=Name(f"{name}.x"), y=Constant(row), z=Constant(1)),),
    )
    for name, row in (("A", 1), ("B", 2))
)
IDLE = Robot("Idle", (Variable("Idle.slot", Domain("S", (range(1, 4),))),))
TEAM = Team("walled", (*ROBOTS, IDLE))
WALL = tuple(BlockedCell(3, row) for row in (1, 2, 3))
GROUND = GroundMap(6, 4, {"A": (1, 1), "B": (1, 2), "Idle": (2, 4)}, WALL)


def outcome(*places: tuple[int, int]) -> Outcome:
    """A result with an epoch for each of the two robots' columns."""
    values = [{"A.x": a, "B.x": b, "Idle.slot": 2} for a, b in places]
    names = ("A", "B", "Idle")
    epochs = tuple(EpochOutcome(Verdict.SOLUTION, robots=names, assignment=one) for one in values)
    return outcome_of(values[-1], team="walled", epochs=epochs)


def test_robots_begin_where_they_stand_and_who_has_no_waypoint_stays_there() -> None:
    mission = mission_of(outcome((5, 6)), TEAM, ground=GROUND)
    assert [drone.home for drone in mission.drones] == [(1, 1, 0), (1, 2, 0), (2, 4, 0)]
    assert {number: goal.at for number, goal in mission.legs[0].goals.items()} == {0: (5, 1, 1), 1: (6, 2, 1)}
    assert [(axis.first, axis.last) for axis in mission.axes] == [(1, 6), (1, 4), (1, 1)]
    assert [block.at for block in mission.blocks] == [pytest.approx((3, row, 0.6)) for row in (1, 2, 3)]
    # Without a map it is as it was: the chosen cell is the home, and everybody with a value flies.
    before = mission_of(outcome((5, 6)), TEAM)
    assert before.drones[0].home == pytest.approx((5, 1, 0))
    assert len(before.legs[0].goals) == 3
    assert not before.rises
    assert not before.blocks


def test_drones_rise_where_they_stand_and_go_over_blocked_cells() -> None:
    flown = fly(mission_of(outcome((5, 6)), TEAM, ground=GROUND))
    assert flown.errors_m.max() < 0.05
    across = np.linalg.norm(flown.positions[:, :2, :2] - flown.positions[0, :2, :2], axis=2)
    low = flown.positions[:, :2, 2] < 0.7
    assert (across[low] < 0.2).all()  # it goes straight up
    blocks = np.array([(cell.x, cell.y, 0.6) for cell in WALL])
    gaps = np.linalg.norm(flown.positions[:, :2, None] - blocks, axis=3)
    assert gaps.min() > 0.5
    assert (flown.positions[:, 2] == flown.positions[0, 2]).all()
    # Without blocks it goes at the level that it was sent to.
    free = fly(mission_of(outcome((5, 6)), TEAM, ground=GroundMap(6, 4, GROUND.starts)))
    assert free.positions[:, :2, 2].max() < 1.1 < flown.positions[:, :2, 2].max()


def test_the_second_epoch_begins_where_the_first_one_ended_and_brings_its_blocks() -> None:
    ground = GroundMap(6, 4, GROUND.starts, (*WALL, BlockedCell(6, 2, 1)))
    run = outcome((5, 6), (5, 4))
    mission = mission_of(run, TEAM, ground=ground)
    assert mission.blocks[-1] == MissionBlock(pytest.approx((6, 2, 0.6)), 1)  # type: ignore[arg-type]
    flown = fly(mission)
    second = flown.legs[1].begins_s
    there = flown.positions[int(np.searchsorted(flown.times, second)), 1]
    assert there == pytest.approx((6, 2, 1), abs=0.05)
    assert flown.positions[-1, 1] == pytest.approx((4, 2, 1), abs=0.05)
    scene = scene_of(run, mission, flown)
    assert [block.since_s for block in scene.blocks] == [0, 0, 0, second]
    assert scene.blocks[0] == DrawnBlock(pytest.approx((3, 1, 0.6)))  # type: ignore[arg-type]
    drawn = b"".join(commands(scene))
    assert b"/meshcat/blocks/0 s" in drawn
    assert f"/meshcat/blocks/{second:g} s".encode() in drawn
    assert "blocked cell" in legend(scene)


def test_a_goal_in_a_blocked_cell_is_flown_to_all_the_same() -> None:
    flown = fly(mission_of(outcome((3, 6)), TEAM, ground=GROUND))
    assert flown.positions[-1, 0] == pytest.approx((3, 1, 1), abs=0.05)
    assert flown.events == ()


def test_a_map_is_drawn_whole_however_large_it_is() -> None:
    ground = GroundMap(60, 60, GROUND.starts, (BlockedCell(60, 60),))
    preview = preview_of(mission_of(outcome((5, 6)), TEAM, ground=ground))
    assert preview.flown, preview.why_not
    assert [axis.cells for axis in preview.mission.axes] == [60, 60, 1]
    (block,) = scene_of(outcome((5, 6)), preview.mission, preview.flown).blocks
    assert block.top == pytest.approx((60, 60, 0.6))


def test_a_map_says_where_its_first_cell_is_and_how_long_a_unit_is() -> None:
    ground = GroundMap(6, 4, {"A": (2, 3)}, (BlockedCell(3, 1),), (-2, 1), 0.5)
    assert read_ground_map(ground_map_json(ground)) == ground
    mission = mission_of(outcome((1, 2)), TEAM, ground=ground)
    assert mission.scale == 0.5
    assert mission.drones[0].home == pytest.approx(
        (-0.5, 1.5, 0)
    )  # column 2, row 3: x = -1 and y = 3, half a metre each
    assert [block.at for block in mission.blocks] == [pytest.approx((0, 0.5, 0.3))]
    assert [(axis.first, axis.last) for axis in mission.axes][:2] == [(-2, 3), (1, 4)]
    assert mission_of(outcome((1, 2)), TEAM, 2.0, ground).scale == 2


def test_a_map_is_read_and_a_wrong_one_told() -> None:
    whole = {"columns": 6, "rows": 4, "starts": {"A": [1, 4]}, "blocked": [{"x": 6, "y": 1, "epoch": 2}]}
    assert read_ground_map(json.dumps(whole).encode()) == GroundMap(6, 4, {"A": (1, 4)}, (BlockedCell(6, 1, 2),))
    for wrong, why in (
        ({"columns": 0}, "columns"),
        ({"columns": 10**9}, "columns"),
        ({"starts": {"A": [7, 1]}}, r"A is at \(7, 1\), outside the map"),
        ({"blocked": [{"x": 1, "y": 5}]}, "a blocked cell is at"),
        ({"blocked": [{"x": 1, "y": 1}] * 10_001}, "length"),
        ({"starts": {"A": [1]}}, "length"),
        ({"height": 3}, "height"),
        ({"colums": 3}, "there is no field 'colums'; did you mean 'columns'"),
        ({"first": [1]}, "length"),
        ({"first": [1, 10**7]}, "first"),
        ({"scale": 0}, "scale"),
    ):
        with pytest.raises(ValueError, match=why):
            read_ground_map(json.dumps({**whole, **wrong}).encode())
    for broken in (b" " * (MAX_BYTES + 1), b"", b"[" * 100_000, b"{}", b"\xff", b'{"\xff": 1}'):
        with pytest.raises(ValueError):  # noqa: PT011 - the JSON reader's words
            read_ground_map(broken)
    with pytest.raises(ValueError, match="not UTF-8"):
        read_ground_map(b'{"\xff": 1}')
