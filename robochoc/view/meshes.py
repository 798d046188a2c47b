"""Triangle meshes of the scene: drones, pads, obstacles, and blocks on footprints."""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

_Vertices = npt.NDArray[np.float64]
_Faces = npt.NDArray[np.int64]

_SHELL, _ROTOR, _DARK = 0.95, 1.0, 0.42
"""The factors for the drone's colour."""
_REACH = 0.23
"""The distance from the centre of the drone to the centre of a rotor, along x and along y."""
_DECK = 0.17
"""The height of the arms."""
HUB = (0.0, 0.0, _DECK)
"""The centre of rotation, relative to the point on which the drone stands."""


class TriangleMesh(NamedTuple):
    """A triangle mesh: N x 3 vertices in cells, M x 3 faces, and N x 3 colours from 0 to 1."""

    vertices: _Vertices
    faces: _Faces
    colours: _Vertices


@cache
def quadrotor() -> TriangleMesh:
    """Return the mesh for all drones, around its `HUB`: a body on skids, four arms, and four guarded rotors.

    The mesh is about 0.8 cells wide, and has so few faces that every drone can have a copy.
    """
    corners = [(x, y) for x in (-_REACH, _REACH) for y in (-_REACH, _REACH)]
    parts = [_body(), _bar((-_REACH, -_REACH), (_REACH, _REACH)), _bar((-_REACH, _REACH), (_REACH, -_REACH))]
    parts += [_rotor(x, y) for x, y in corners]
    parts += [_skid(side) for side in (-0.11, 0.11)]
    joined = joined_shapes(parts)
    return joined._replace(vertices=joined.vertices - np.array(HUB))


def disc(centre: tuple[float, float, float], radius: float, colour: tuple[float, float, float]) -> TriangleMesh:
    """Return a flat disc, for a pad on the ground."""
    sides = 16
    vertices = np.concatenate([[centre], _circle(radius, 0, sides) + np.array(centre)])
    here = np.arange(sides)
    faces = np.column_stack([np.zeros_like(here), here + 1, (here + 1) % sides + 1])
    return TriangleMesh(vertices, faces, np.tile(colour, (sides + 1, 1)))


def box(centre: tuple[float, float, float], size: float | tuple[float, float, float]) -> TriangleMesh:
    """Return a box, for an obstacle: a cube, or a box with the width, depth and height in `size`."""
    corners = np.array([*product((-0.5, 0.5), repeat=3)]) * np.array(size) + np.array(centre)
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([face for a, b, c, d in sides for face in ((a, b, c), (a, c, d))])
    return _painted(corners, faces, 1)


def prisms(footprints: _Vertices, low: float, high: float) -> TriangleMesh:
    """Return upright blocks on footprints (K, 4, 2), whose corners are counterclockwise."""
    count = len(footprints)
    heights = np.repeat([low, high], 4)
    vertices = np.empty((count, 8, 3))
    vertices[:, :, :2] = np.tile(footprints, (1, 2, 1))
    vertices[:, :, 2] = heights
    sides = [(a, b, b + 4, a + 4) for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    faces = np.array([face for a, b, c, d in (*sides, (4, 5, 6, 7)) for face in ((a, b, c), (a, c, d))])
    every = (faces[None] + 8 * np.arange(count)[:, None, None]).reshape(-1, 3)
    return _painted(vertices.reshape(-1, 3), every, 1)


def joined_shapes(parts: list[TriangleMesh]) -> TriangleMesh:
    """Return several meshes joined into one."""
    before = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return TriangleMesh(
        np.concatenate([part.vertices for part in parts]),
        np.concatenate([part.faces + offset for part, offset in zip(parts, before, strict=False)]),
        np.concatenate([part.colours for part in parts]),
    )


def _painted(vertices: _Vertices, faces: _Faces, shade: float) -> TriangleMesh:
    return TriangleMesh(vertices, faces, np.full_like(vertices, shade))


def _circle(radius: float, height: float, sides: int) -> _Vertices:
    turn = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(sides, height)])


def _band(sides: int) -> _Faces:
    """Return the faces between two circles of `sides` vertices each, numbered circle by circle."""
    here = np.arange(sides)
    there = (here + 1) % sides
    return np.concatenate(
        [np.column_stack([here, there, there + sides]), np.column_stack([here, there + sides, here + sides])]
    )


def _body() -> TriangleMesh:
    """Return a faceted dome."""
    sides = 8
    rings = [_circle(0.09, _DECK - 0.05, sides), _circle(0.14, _DECK, sides), _circle(0.08, _DECK + 0.08, sides)]
    vertices = np.concatenate([*rings, [[0, 0, _DECK + 0.1]]])
    top = 2 * sides + np.arange(sides)
    lid = np.column_stack([top, 2 * sides + (np.arange(sides) + 1) % sides, np.full(sides, 3 * sides)])
    return _painted(vertices, np.concatenate([_band(sides), _band(sides) + sides, lid]), _SHELL)


def _bar(start: tuple[float, float], stop: tuple[float, float]) -> TriangleMesh:
    """Return an arm, a flat box from one rotor through the body to the opposite rotor."""
    ends = np.array([start, stop])
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    side = 0.025 * np.array([-along[1], along[0]])
    outline = np.array([ends[0] - side, ends[1] - side, ends[1] + side, ends[0] + side])
    vertices = np.concatenate(
        [np.column_stack([outline, np.full(4, height)]) for height in (_DECK - 0.02, _DECK + 0.02)]
    )
    lid = np.array([[4, 5, 6], [4, 6, 7]])
    return _painted(vertices, np.concatenate([_band(4), lid]), _DARK)


def _rotor(x: float, y: float) -> TriangleMesh:
    """Return two blades, and the guard ring around them."""
    sides, height = 12, _DECK + 0.03
    ring = np.concatenate([_circle(0.13, height, sides), _circle(0.17, height, sides)])
    guard = _painted(ring, _band(sides), _ROTOR)
    blade = np.array([[-0.13, -0.012, height], [0.13, -0.03, height], [0.13, 0.012, height], [-0.13, 0.03, height]])
    blades = _painted(blade, np.array([[0, 1, 2], [0, 2, 3]]), _DARK)
    joined = joined_shapes([guard, blades])
    return joined._replace(vertices=joined.vertices + np.array([x, y, 0]))


def _skid(side: float) -> TriangleMesh:
    """Return a runner on two legs."""
    runner = np.array([[x, side + dy, z] for x in (-0.17, 0.17) for dy, z in ((-0.015, 0), (0.015, 0), (0, 0.025))])
    legs = [
        np.array([[x - 0.012, side, 0.02], [x + 0.012, side, 0.02], [x * 0.6, side * 0.6, _DECK - 0.04]])
        for x in (-0.1, 0.1)
    ]
    triangle = np.array([[0, 1, 2]])
    return joined_shapes([_painted(runner, _band(3), _DARK), *(_painted(leg, triangle, _DARK) for leg in legs)])
