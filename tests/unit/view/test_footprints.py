"""Walls in the scene: pixels are covered by few rectangles, and by nothing else."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from robochoc.flight.layout import BoxAxis
from robochoc.flight.mission import Mission
from robochoc.maps.occupancy.rectangles import few_rectangles, rectangles
from robochoc.maps.walls import VoxelFrame, Walls
from robochoc.view.meshes import prisms
from robochoc.view.walls import Flags, faces, wall_faces
from tests.support.examples import count


def painted(sides: np.ndarray, shape: tuple[int, int], factor: int = 1) -> np.ndarray:
    """Return how often each pixel is covered."""
    times = np.zeros(shape, dtype=int)
    for left, low, right, high in (factor * sides).tolist():
        times[low:high, left:right] += 1
    return times


@count("maps", 50, 2000)
def test_rectangles_cover_each_pixel_once_and_no_other(maps: int) -> None:
    for seed in range(maps):
        chance = np.random.default_rng(seed)
        shape = (int(chance.integers(1, 20)), int(chance.integers(1, 20)))
        flags: Flags = chance.random(shape) < chance.random()
        assert (painted(rectangles(flags), shape) == flags).all()


def test_a_wall_is_one_rectangle_and_an_empty_map_none() -> None:
    flags = np.zeros((1000, 1000), dtype=bool)
    assert len(rectangles(flags)) == 0
    assert prisms(np.empty((0, 4, 2)), 0, 1).vertices.shape == (0, 3)
    flags[300:700, 10:20] = True
    assert rectangles(flags).tolist() == [[10, 300, 20, 700]]


def test_a_noisy_map_is_drawn_coarser_and_covers_all_of_it() -> None:
    flags = np.random.default_rng(1).random((301, 299)) < 0.2
    sides, factor = few_rectangles(flags, 500)
    assert factor > 1
    assert len(sides) <= 500
    assert (painted(sides, (301, 299), factor)[flags] > 0).all()
    assert few_rectangles(flags, 10**6)[1] == 1


def test_blocks_face_outwards() -> None:
    """Each face, seen from outside, turns counterclockwise: three.js draws no other side."""
    shape = prisms(np.array([[[0, 0], [2, 0], [2, 1], [0, 1]], [[5, 5], [6, 5], [6, 7], [5, 7]]], dtype=float), 0, 3)
    middles = shape.vertices.reshape(2, 8, 3).mean(axis=1)
    for number, face in enumerate(shape.faces):
        a, b, c = shape.vertices[face]
        outward = np.cross(b - a, c - a)
        assert outward @ ((a + b + c) / 3 - middles[number // 10]) > 0


# Faces of voxels


MOVES = ((-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1))


def test_an_occupied_voxel_has_a_face_towards_each_free_one() -> None:
    chance = np.random.default_rng(3)
    for _ in range(20):
        kinds = chance.integers(0, 3, chance.integers(1, 5, 3))  # 0: not known, 1: free, 2: occupied
        wanted = set()
        for z, y, x in np.argwhere(kinds == 2).tolist():
            for right, back, up in MOVES:
                beside = z + up, y + back, x + right
                inside = all(0 <= at < size for at, size in zip(beside, kinds.shape, strict=True))
                if inside and kinds[beside] == 1:
                    wanted.add(((x, y, z), (right, back, up)))
        found = set()
        for corners in faces(kinds == 2, kinds == 1):
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            move = np.rint(normal).astype(int)
            voxel = np.floor(corners.mean(axis=0) - move / 2).astype(int)
            found.add((tuple(voxel.tolist()), tuple(move.tolist())))
            assert len(np.unique(corners, axis=0)) == 4
        assert found == wanted


def mission_with(occupied: Flags, free: Flags) -> Mission:
    """Return a mission in a box of cells of a metre, whose map has voxels of half a metre from (1, 2, 3) on."""
    axes = tuple(BoxAxis(name, 1, 4, 1, 4) for name in "xyz")
    walls = Walls(~free, occupied, VoxelFrame(0.5, (1.0, 2.0, 3.0)), 0.1, 0.5)
    return Mission("team", (), (), (axes[0], axes[1], axes[2]), 1.0, has_volume=True, walls=walls)


def test_faces_are_where_the_voxels_are() -> None:
    free = np.zeros((2, 2, 2), dtype=bool)
    occupied = free.copy()
    free[0, 0, 0], occupied[0, 0, 1] = True, True
    mission = mission_with(occupied, free)
    drawn = wall_faces(mission)
    assert drawn is not None
    corners = {tuple(corner) for corner in drawn.reshape(-1, 3).tolist()}
    assert corners == {(1.5, y, z) for y, z in product((2, 2.5), (3, 3.5))}
    assert wall_faces(replace(mission, walls=None)) is None


def test_many_voxels_are_drawn_as_fewer_larger_ones() -> None:
    free = np.ones((16, 16, 15), dtype=bool)
    free[::2, ::2, ::2] = False
    mission = mission_with(~free, free)
    most = 100
    drawn = wall_faces(mission, most)
    assert drawn is not None
    assert len(drawn) <= most
    # A floor stays one, and what is behind it is seen from above.
    free = np.ones((16, 16, 15), dtype=bool)
    free[:4] = False
    drawn = wall_faces(mission_with(~free, free), most)
    assert drawn is not None
    assert 0 < len(drawn) <= most
    assert drawn[:, :, 2] == pytest.approx(5)
