"""Walls in the scene: pixels are covered by few rectangles, and by nothing else."""

from __future__ import annotations

import numpy as np

from robochoc.view.footprints import Flags, few_rectangles, rectangles
from robochoc.view.quadrotor import prisms
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
