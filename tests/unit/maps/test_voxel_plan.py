"""Walls in space: distances from voxels, lines and ways, by other means than the plan's own: voxel by voxel."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from random import Random

import numpy as np
import pytest

from robochoc.flight.coordination.move_order import NoRouteError
from robochoc.flight.coordination.timetable import plan_routes
from robochoc.maps.octomap.voxels import read_voxels
from robochoc.maps.routes.distances import Array
from robochoc.maps.routes.voxel_plan import Resting, VoxelPlan
from robochoc.maps.walls import VoxelFrame
from tests.support.examples import count
from tests.support.flights_in_space import gaps_in_space, house
from tests.support.octomaps import FREE, Voxel, drawn_voxels, write_octomap


def plan_of(voxels: Mapping[Voxel, int], sides: Voxel, side: float = 0.5, keep: float = 0.2) -> VoxelPlan:
    """Return the plan of a map whose lowest corner is at (0, 0, 0)."""
    solid = np.ones(sides[::-1], dtype=bool)
    for (x, y, z), kind in voxels.items():
        solid[z, y, x] = kind != FREE
    return VoxelPlan(solid, VoxelFrame(side), keep)


def along(path: Array, step: float = 0.01) -> Array:
    """Return points along a way, so close to each other."""
    parts = []
    for first, last in pairwise(path):
        shares = np.linspace(0, 1, 2 + int(np.linalg.norm(last - first) / step))
        parts.append(first + (last - first) * shares[:, None])
    return np.concatenate(parts)


def drawn(chance: Random) -> tuple[dict[Voxel, int], Voxel, float]:
    sides = chance.randrange(4, 10), chance.randrange(4, 10), chance.randrange(4, 8)
    voxels = drawn_voxels(chance, sides, walls=0.1) if chance.random() < 0.5 else house(chance, sides)
    return voxels, sides, chance.choice((0.1, 0.25, 0.5))


@count("maps", 3, 300)
def test_lines_and_points_are_as_far_from_walls_as_all_voxels_say(maps: int) -> None:
    for seed in range(maps):
        chance = Random(seed)
        voxels, sides, side = drawn(chance)
        plan = plan_of(voxels, sides, side, chance.uniform(0, 1.5 * side))
        for _ in range(6):
            first, last = (np.array([chance.random() * size * side for size in sides]) for _ in range(2))
            if chance.random() < 0.4:
                last[chance.randrange(3)] = first[chance.randrange(3)]
            apart = float(gaps_in_space(voxels, side, along(np.array([first, last]), side / 100)).min())
            if abs(apart - plan.keep) > 0.02 * side:
                assert bool(plan.are_clear(first[None], last[None])[0]) is (apart >= plan.keep), (seed, first, last)
            ends = np.array([first, last])
            for most in (0.4 * side, 3 * side):
                exact = np.minimum(gaps_in_space(voxels, side, ends), most)
                assert plan.clearances(ends, most) == pytest.approx(exact), (seed, most)


def reached(voxels: Mapping[Voxel, int], sides: Voxel, side: float, keep: float, start: Array) -> set[Voxel]:
    """Return the points of a fine grid, three along a voxel, to which a drone can fly step by step."""
    step = side / 3
    points = {(x, y, z): (np.array([x, y, z]) + 0.5) * step for x, y, z in np.ndindex(*(3 * part for part in sides))}
    # Between neighbours, walls are nearer than at both by less than half a step.
    apart = gaps_in_space(voxels, side, np.array([*points.values()]))
    free = {at for at, gap in zip(points, apart, strict=True) if gap >= keep + step / 2}
    x, y, z = np.floor(start / step).astype(int).tolist()
    waiting, found = [(x, y, z)], {(x, y, z)}
    while waiting:
        x, y, z = waiting.pop()
        for near in ((x + 1, y, z), (x - 1, y, z), (x, y + 1, z), (x, y - 1, z), (x, y, z + 1), (x, y, z - 1)):
            if near in free and near not in found:
                found.add(near)
                waiting.append(near)
    return found


@count("maps", 2, 150)
def test_a_way_is_clear_and_is_found_where_there_is_one(maps: int) -> None:
    for seed in range(maps):
        chance = Random(seed)
        voxels, sides, side = drawn(chance)
        keep = chance.uniform(0.2, 0.9) * side
        plan = plan_of(voxels, sides, side, keep)
        free = [at for at, kind in sorted(voxels.items()) if kind == FREE]
        places = [(np.array(chance.choice(free)) + 0.5) * side for _ in range(4)]
        places = [place for place in places if gaps_in_space(voxels, side, place[None])[0] >= keep]
        for first, last in pairwise(places):
            way = plan.route(first, last)
            if way is not None:
                assert (way[0] == first).all()
                assert (way[-1] == last).all()
                assert gaps_in_space(voxels, side, along(way)).min() >= keep - 1e-6, (seed, first, last)
            else:
                x, y, z = np.floor(last / (side / 3)).astype(int).tolist()
                assert (x, y, z) not in reached(voxels, sides, side, keep, first), (seed, first, last)


@count("maps", 4, 150)
def test_a_way_keeps_from_drones_at_rest_too(maps: int) -> None:
    found = 0
    for seed in range(maps):
        chance = Random(seed)
        sides = 8, 7, 5
        voxels = house(chance, sides)
        plan = plan_of(voxels, sides, 0.5, 0.2)
        free = [at for at, kind in sorted(voxels.items()) if kind == FREE]
        first, last, *others = ((np.array(chance.choice(free)) + 0.5) * 0.5 for _ in range(6))
        resting = Resting(np.array(others), chance.choice((0.3, 0.5, 0.8)), chance.choice((1.0, 2.0)))
        squash = np.array([1, 1, resting.downwash])
        near = np.linalg.norm((np.array([first, last])[:, None] - np.array(others)) / squash, axis=2)
        if near.min() < resting.distance:
            continue
        way = plan.route_among(first, last, resting)
        if way is not None:
            found += 1
            points = along(way)
            assert gaps_in_space(voxels, 0.5, points).min() >= 0.2 - 1e-6
            apart = np.linalg.norm((points[:, None] - np.array(others)) / squash, axis=2)
            assert apart.min() >= resting.distance - 1e-6, seed
    assert found


CORRIDOR = {(x, y, z): FREE for x in range(12) for y in range(1) for z in range(1)}
"""One drone wide, and 6 m long."""
BAY = {**CORRIDOR, (5, 1, 0): FREE}
"""The same, with a bay half way, in which one can wait."""


def routes(voxels: Mapping[Voxel, int], starts: list[float], goals: list[float]) -> Array:
    """Return the places (T, N, 3) of drones that fly along a corridor, from these x to those."""
    plan = plan_of(voxels, (12, 2, 1), 0.5, 0.2)
    ends = [np.array([[x, 0.25, 0.25] for x in places]) for places in (starts, goals)]
    found = plan_routes(*ends, distance=0.3, floor_plan=plan)
    return np.array([found.at(s).position for s in np.arange(0, found.duration_s + 0.05, 0.05)])


def test_drones_in_a_corridor_get_past_each_other_where_one_can_wait() -> None:
    flown = routes(BAY, [0.25, 5.75], [5.75, 0.25])
    assert flown[-1, :, 0] == pytest.approx([5.75, 0.25])
    assert np.linalg.norm(flown[:, 0] - flown[:, 1], axis=1).min() >= 0.3
    assert gaps_in_space(BAY, 0.5, flown.reshape(-1, 3)).min() >= 0.2 - 1e-6
    # One that is in the way of another makes room, though it is at its place, and comes back.
    flown = routes(BAY, [0.25, 3.25], [5.75, 3.25])
    assert flown[-1, :, 0] == pytest.approx([5.75, 3.25])
    assert np.linalg.norm(flown[:, 0] - flown[:, 1], axis=1).min() >= 0.3


def test_who_does_not_get_past_another_is_told() -> None:
    with pytest.raises(NoRouteError, match="they do not get past each other") as refused:
        routes(CORRIDOR, [0.25, 5.75], [5.75, 0.25])
    assert refused.value.drones == (0, 1)
    assert refused.value.indoors


def test_small_voxels_are_flown_among_on_a_coarser_lattice(tmp_path: Path) -> None:
    """A wall of voxels that are much smaller than a drone, with a hole in it."""
    sides = 22, 16, 11
    voxels = {(x, y, z): FREE for x, y, z in np.ndindex(*sides) if x not in {10, 11} or (8 <= y < 15 and 3 <= z < 10)}
    grid = read_voxels(write_octomap(tmp_path / "small.bt", voxels, "0.05"))
    plan = VoxelPlan(~grid.free, VoxelFrame(0.05, (-0.05, -0.05, -0.05)), 0.15)
    assert tuple(map(float, grid.origin)) == plan.frame.corner
    first, last = np.array([0.2, 0.2, 0.2]), np.array([0.9, 0.2, 0.2])
    way = plan.route(first, last)
    assert way is not None
    assert gaps_in_space(voxels, 0.05, along(way)).min() >= 0.15 - 1e-6
    assert plan.keeping(0.2).route(first, last) is None
