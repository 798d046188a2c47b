"""The floor plan: distances from walls and ways around them, by other means than its own: pixel by pixel."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from random import Random

import numpy as np
import pytest

from robochoc.flight.coordination.timetable import plan_routes
from robochoc.maps.routes.distances import Array
from robochoc.maps.routes.floor_plan import FloorPlan
from robochoc.maps.walls import PixelFrame
from tests.support.examples import count
from tests.support.flights_on_maps import gaps, rooms
from tests.support.maps import FREE, WALL, drawn_rows

HALL = ["#########", "#...#...#", "#...#...#", "#.......#", "#...#...#", "#...#...#", "#########"]
"""Two rooms with a door."""


def plan_of(rows: list[str], side: float = 0.5, keep: float = 0.2) -> FloorPlan:
    """Return the floor plan of a map, whose lower left corner is at (0, 0)."""
    solid = np.array([[one != FREE for one in row] for row in reversed(rows)])
    return FloorPlan(solid, PixelFrame(side), keep)


def along(path: Array, step: float = 0.004) -> Array:
    """Return points along a way, so close to each other."""
    parts = []
    for first, last in pairwise(path):
        shares = np.linspace(0, 1, 2 + int(np.linalg.norm(last - first) / step))
        parts.append(first + (last - first) * shares[:, None])
    return np.concatenate(parts)


def drawn(chance: Random) -> tuple[list[str], float]:
    columns, height = chance.randrange(6, 18), chance.randrange(6, 18)
    rows = drawn_rows(chance, columns, height, 0.1) if chance.random() < 0.5 else rooms(chance, columns, height)
    return rows, chance.choice((0.05, 0.1, 0.25, 0.5))


@count("maps", 12, 400)
def test_lines_and_points_are_as_far_from_walls_as_all_pixels_say(maps: int) -> None:
    for seed in range(maps):
        chance = Random(seed)
        rows, side = drawn(chance)
        plan = plan_of(rows, side, chance.uniform(0, 2 * side))
        size = np.array([len(rows[0]), len(rows)]) * side
        for _ in range(6):
            first, last = (np.array([chance.random(), chance.random()]) * size for _ in range(2))
            if chance.random() < 0.3:
                last[chance.randrange(2)] = first[chance.randrange(2)]
            apart = float(gaps(rows, side, along(np.array([first, last]))).min())
            if abs(apart - plan.keep) > 0.01 * side:
                assert bool(plan.are_clear(first[None], last[None])[0]) is (apart >= plan.keep), (seed, first, last)
            exact = gaps(rows, side, np.array([first, last]))
            assert plan.clearances(np.array([first, last]), 3 * side) == pytest.approx(np.minimum(exact, 3 * side))


def reached(
    rows: list[str], side: float, keep: float, start: tuple[float, float], parts: int = 6
) -> set[tuple[int, int]]:
    """Return the points of a fine grid, each so many parts of a pixel wide, to which a drone can fly step by step."""
    step = side / parts
    width, height = len(rows[0]) * parts, len(rows) * parts
    points = np.array([((x + 0.5) * step, (y + 0.5) * step) for y in range(height) for x in range(width)])
    # Between neighbours, walls are nearer than at both by less than half a step.
    free = (gaps(rows, side, points) >= keep + step / 2).reshape(height, width)
    waiting = [(int(start[0] / step), int(start[1] / step))]
    found = set(waiting)
    while waiting:
        x, y = waiting.pop()
        for beside in ((x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)):
            inside = 0 <= beside[0] < width and 0 <= beside[1] < height
            if inside and free[beside[1], beside[0]] and beside not in found:
                found.add(beside)
                waiting.append(beside)
    return found


@count("maps", 8, 300)
def test_a_way_is_clear_of_walls_and_there_is_one_wherever_a_drone_gets(maps: int) -> None:
    for seed in range(maps):
        chance = Random(1000 + seed)
        rows, side = drawn(chance)
        keep = chance.choice((0.3, 0.8)) * side
        plan = plan_of(rows, side, keep)
        free = [
            ((x + 0.5) * side, (y + 0.5) * side)
            for y, row in enumerate(reversed(rows))
            for x, one in enumerate(row)
            if one == FREE
        ]
        start, goal = chance.choice(free), chance.choice(free)
        ends = np.array([start, goal])
        if gaps(rows, side, ends).min() < keep:
            continue
        way = plan.route(*ends)
        there = reached(rows, side, keep, start)
        if way is None:
            # The lattice of this map may be coarser than the grid, but not by so much.
            assert (int(goal[0] / side * 6), int(goal[1] / side * 6)) not in reached(rows, side, 1.2 * keep, start), (
                seed
            )
            continue
        assert (way[0] == start).all()
        assert (way[-1] == goal).all()
        assert gaps(rows, side, along(way)).min() >= keep - 1e-6, seed
        length = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
        assert length >= math.dist(start, goal) - 1e-9
        assert there


def test_a_way_leads_through_the_door_and_is_taut() -> None:
    plan = plan_of(HALL, 0.5, 0.22)
    way = plan.route(np.array([1.0, 1.0]), np.array([3.5, 1.0]))
    assert way is not None
    length = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    # Around both corners of the door, as near as the drone may come to them, it would be 2.96 m.
    assert 2.9 < length < 3.05
    assert len(way) <= 4
    assert plan.route(np.array([1.0, 1.0]), np.array([1.0, 1.0])) is not None
    assert plan_of(HALL, 0.5, 0.26).route(np.array([1.0, 1.0]), np.array([3.5, 1.0])) is None  # the door is 0.5 m wide
    assert plan_of([WALL * 3] * 3).route(np.array([0.1, 0.1]), np.array([1.0, 1.0])) is None


def test_a_plan_is_moved_scaled_and_turned_with_its_ways() -> None:
    plan = plan_of(HALL, 0.5, 0.22)
    way = plan.route(np.array([1.0, 1.0]), np.array([3.5, 1.0]))
    assert way is not None
    moved = FloorPlan(plan.solid, plan.frame.moved((10.0, -3.0), 2.0), 2 * plan.keep)
    there = moved.route(np.array([12.0, -1.0]), np.array([17.0, -1.0]))
    assert there is not None
    assert len(there) >= 3
    assert moved.clearances(np.array([[12.0, -1.0]]), 5.0)[0] == pytest.approx(1.0)
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    turned = FloorPlan(plan.solid, replace(plan.frame, yaw=math.atan2(0.6, 0.8)), plan.keep)
    ends = np.array([[1.0, 1.0], [3.5, 1.0]]) @ turn.T
    same = turned.route(*ends)
    assert same is not None
    assert same == pytest.approx(way @ turn.T)
    assert (
        turned.are_clear(ends[:1], ends[1:]).tolist()
        == plan.are_clear(np.array([[1.0, 1]]), np.array([[3.5, 1]])).tolist()
    )


def test_routes_of_many_drones_through_one_door_keep_from_walls_and_from_each_other() -> None:
    plan = plan_of(HALL, 0.5, 0.22)
    left = [(x, y, 0.5) for x in (0.9, 1.5) for y in (1.0, 1.75, 2.5)]
    right = [(4.5 - x, y, z) for x, y, z in left]
    goals = [*right, *left]
    routes = plan_routes(np.array([*left, *right]), np.array(goals), distance=0.5, floor_plan=plan)
    places = np.array([routes.at(s).position for s in np.arange(0, routes.duration_s + 0.05, 0.05)])
    assert gaps(HALL, 0.5, places[:, :, :2].reshape(-1, 2)).min() >= 0.22 - 1e-6
    for one in range(len(goals)):
        for other in range(one):
            assert np.linalg.norm(places[:, one] - places[:, other], axis=1).min() >= 0.5
    assert places[-1] == pytest.approx(np.array(goals))
