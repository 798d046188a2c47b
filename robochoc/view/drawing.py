"""Draws a scene as meshcat commands: the ground, the box with its grid and axes, the drones, and their flight."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterator, Sequence
from html import escape
from itertools import product
from typing import NamedTuple, assert_never

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import BoxAxis, Point
from robochoc.system.plain_text import printable
from robochoc.view.keyframes import Keys, Samples, angle, attitude_keys, position_keys
from robochoc.view.meshcat_commands import MeshcatCommands, Track
from robochoc.view.meshes import HUB, TriangleMesh, box, disc, joined_shapes, prisms, quadrotor
from robochoc.view.palette import GREY, RED, STONE, UNKNOWN, Colour, colours
from robochoc.view.playback import DroneState, Playback
from robochoc.view.scene import DrawnDrone, Scene
from robochoc.view.walls import blocked_cell_faces, mesh_of_faces

_EM = 44
"""The font size in pixels, sharp at close range and small in memory."""
_HEIGHT = 64
_LONGEST = 24


_Corners = npt.NDArray[np.float64]
"""Two rows: the lowest x, y and z, and the highest x, y and z."""
_Corner = npt.NDArray[np.float64]
"""The x, y and z of a point."""

_LINE: Colour = (0.45, 0.52, 0.60)
_GROUND: Colour = (0.50, 0.56, 0.62)
_WHITE: Colour = (1, 1, 1)
_MARGIN = 0.8
"""The width of the ground beyond the outermost drones, in cells."""
_EYE = np.array([0.7, -1.0, 0.42])
"""The direction of the camera: in front of row 1, a little to the right, and above."""
_FIELD_OF_VIEW_DEG = 28
_VIEW_MARGIN = 1.06
"""The size of the view relative to the scene, since the axes' labels need space."""
_TEXT = 0.045
"""The height of text, in radii of the scene."""
_READABLE = 0.03
"""The minimum height of text, in radii of the scene."""
_NAME_WIDTH = 0.8
"""The maximum width of a drone's name, in cells, since the neighbour's name needs space, too."""
FPS = 30
"""The number of frames per second of the animation."""
_FADE = 25
"""The number of frames in which a withdrawing drone turns grey."""
_CLOSE_CELLS = 0.002
"""The largest deviation of an animated drone from its flown position, in cells."""
_ALIKE_RAD = math.radians(0.5)
"""The largest deviation of an animated drone's attitude, in radians."""
_OBSTACLE_SIZE = 0.9
"""The size of an obstacle, in cells."""
_OPACITIES = {"body": 0.35, "edges": 0.9}
"""The opacities of an obstacle's parts."""
_BLOCK = 0.94
"""The width of a blocked cell's block, in cells, with which neighbouring blocks are distinguishable."""
_BLOCK_OPACITY = 0.85
_WALL_OPACITY = 0.6
_BESIDE_UNIT = 3.4
"""The distance from an axis's numbers to its name if it has a unit, in heights of the numbers: such names are wider."""
_CELL_LINES_MAX = 16
"""The maximum number of lines along an axis between cells, since lines in large boxes are too faint to be visible."""
_FLAT = 0.02
"""The height of flat areas on the ground, in cells."""


def commands(scene: Scene) -> list[bytes]:
    """Return the packed commands with which meshcat's viewer shows `scene` and plays its flight once."""
    if scene.playback is None:
        return _draw_scene(scene, [drone.end for drone in scene.drones]).commands
    meshcat = _draw_scene(scene, [drone.home for drone in scene.drones])
    _draw_obstacles(meshcat, [place for _, place in scene.playback.obstacles])
    _animate(meshcat, scene, scene.playback)
    return meshcat.commands


def commands_at_home(scene: Scene) -> list[bytes]:
    """Return the commands without the flight, in which every drone stays at home."""
    return _draw_scene(scene, [drone.home for drone in scene.drones]).commands


def path_of(number: int, name: str) -> str:
    """Return the path of a drone in meshcat's tree, from its name and its number (from 0).

    The number makes paths unique, and different from names with a meaning in JavaScript.
    """
    return f"drones/{number + 1} " + re.sub(r"[^\w.-]", "_", name)


def corners(scene: Scene) -> list[list[float]]:
    """Return points around all visible objects and axis names, in a frame scaled to radius 1 around the drones."""
    extent, radius = _extent_and_radius(scene)
    names = [2 * name_at - origin for _, _, origin, name_at in _axis_lines(scene.axes, _TEXT * radius)]
    found: list[list[float]] = ((np.array([*_corners(extent), *names]) - extent.mean(axis=0)) / radius).tolist()
    return found


def cell_of(scene: Scene) -> float:
    """Return the length of a cell in the frame of `corners`."""
    return 1 / _extent_and_radius(scene)[1]


def _draw_scene(scene: Scene, points: Sequence[Point]) -> MeshcatCommands:
    """Draw everything, with the drones at `points`."""
    meshcat = MeshcatCommands()
    extent, radius = _extent_and_radius(scene)
    _aim(meshcat, extent, radius)
    _draw_ground(meshcat, scene, extent)
    _draw_box(meshcat, scene.axes)
    for since_s, shape in _blocks(scene).items():
        meshcat.mesh(f"blocks/{since_s:g} s", shape, STONE, _BLOCK_OPACITY)
    walls = _walls(scene)
    if walls:
        meshcat.mesh("walls", walls, STONE, one_sided=True)
    _draw_walls(meshcat, scene)
    _label_axes(meshcat, scene.axes, _TEXT * radius)
    _draw_drones(meshcat, scene.drones, points, radius)
    return meshcat


def _extent_and_radius(scene: Scene) -> tuple[_Corners, float]:
    """Return the extent of the scene, and the radius of the sphere around it."""
    points = [point for drone in scene.drones for point in (drone.home, drone.place, drone.landing) if point]
    everything = np.array([*points, *_box(scene.axes)])
    margin = np.array([_MARGIN, _MARGIN, 0])
    extent = np.array([everything.min(axis=0) - margin, everything.max(axis=0) + margin])
    return extent, float(np.linalg.norm(extent[1] - extent[0])) / 2


def _box(axes: Sequence[BoxAxis]) -> _Corners:
    return np.array([[axis.low - 0.5 for axis in axes], [axis.high + 0.5 for axis in axes]])


def _corners(extent: _Corners) -> _Corners:
    return np.array([*product(*extent.T)])


def _aim(meshcat: MeshcatCommands, extent: _Corners, radius: float) -> None:
    """Scale the scene to radius 1 around the origin, where the lights are, and place the camera to show everything."""
    x, y, z = (float(part) for part in -extent.mean(axis=0) / radius)
    meshcat.place("", (x, y, z), (1 / radius, 1 / radius, 1 / radius))
    for default in ("/Grid", "/Axes"):
        meshcat.set(default, "visible", value=False)
    around = (_corners(extent) - extent.mean(axis=0)) / radius
    x, y, z = (float(part) for part in _camera_position(around))
    camera = "/Cameras/default/rotated/<object>"
    meshcat.set(camera, "fov", _FIELD_OF_VIEW_DEG)
    meshcat.set(camera, "position", [x, z, -y])  # in the camera's frame, y is up


def _camera_position(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the camera position, in the direction of `_EYE`, from which all `corners` are visible."""
    back: npt.NDArray[np.float64] = _EYE / np.linalg.norm(_EYE)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    across = np.abs(corners @ np.column_stack([right, np.cross(back, right)])).max(axis=1)
    distance = corners @ back + _VIEW_MARGIN * across / math.tan(math.radians(_FIELD_OF_VIEW_DEG / 2))
    return back * float(distance.max())


def _draw_ground(meshcat: MeshcatCommands, scene: Scene, extent: _Corners) -> None:
    """Draw a plane, and a pad for each drone in the colour of its row."""
    (left, front, _), (right, back, _) = extent
    corners = np.array([[left, front, 0], [right, front, 0], [right, back, 0], [left, back, 0]])
    plane = TriangleMesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.ones((4, 3)))
    meshcat.mesh("ground/plane", plane, _GROUND, opacity=0.3)
    meshcat.place("ground/plane", (0, 0, scene.ground - 0.02))
    if scene.drones:
        paint = row_colours(scene.drones)
        pads = [disc(drone.home, 0.36, colour) for drone, colour in zip(scene.drones, paint, strict=True)]
        meshcat.mesh("ground/pads", joined_shapes(pads), _WHITE, opacity=0.45)
        meshcat.place("ground/pads", (0, 0, -0.01))


def _draw_box(meshcat: MeshcatCommands, axes: Sequence[BoxAxis]) -> None:
    """Draw the edges, the back and bottom sides with their grids, and very faintly every cell."""
    low, high = _box(axes)
    walls = [np.arange(a, b + 0.5) for a, b in zip(low, high, strict=True)]
    cells = [wall[:: 1 + len(wall) // _CELL_LINES_MAX] for wall in walls]
    parts = {
        "cells": (cells, 0.5 / max(map(len, cells))),
        "floor": ([*walls[:2], low[2:]], 0.35),
        "side": ([low[:1], *walls[1:]], 0.2),
        "back": ([walls[0], high[1:2], walls[2]], 0.2),
        "edges": ([wall[[0, -1]] for wall in walls], 0.9),
    }
    for name, (lines, opacity) in parts.items():
        meshcat.segments(f"box/{name}", _lattice(lines), _LINE, opacity)


def _label_axes(meshcat: MeshcatCommands, axes: Sequence[BoxAxis], height: float) -> None:
    """Draw the name and the numbers of each named axis, beside the edge of the box nearest to the viewer."""
    for number, axis, origin, name_at in _axis_lines(axes, height):
        for at, text in axis.ticks:
            spot = origin.copy()
            spot[number] = at
            _draw_text(meshcat, f"axes/{axis.name} {text}", text, spot, height)
        _draw_text(meshcat, f"axes/{axis.name}", axis.title, name_at, 1.2 * height)


def _axis_lines(axes: Sequence[BoxAxis], height: float) -> Iterator[tuple[int, BoxAxis, _Corner, _Corner]]:
    """Yield each named axis: its index, the axis, the middle of the line of its numbers, and the place of its name."""
    low, high = _box(axes)
    middle = (low + high) / 2
    near = 1.2 * height
    lines = [
        np.array([middle[0], low[1] - near, low[2]]),
        np.array([high[0] + near, middle[1], low[2]]),
        np.array([low[0] - near, low[1], middle[2]]),
    ]
    for number, (axis, origin) in enumerate(zip(axes, lines, strict=True)):
        if axis.name:
            away = (2.2 if axis.unit_m is None else _BESIDE_UNIT) * height
            yield number, axis, origin, origin + np.sign(origin - middle) * [1, 1, 0] * away


def _lattice(walls: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Return both ends of all lattice lines, which are parallel to the axes."""
    ends = []
    for along in range(3):
        across = [walls[axis] if axis != along else walls[axis][[0, -1]] for axis in range(3)]
        mesh = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1)
        if len(walls[along]) > 1:
            ends.append(np.moveaxis(mesh, along, 2).reshape(-1, 3))
    return np.concatenate(ends)


def _draw_drones(
    meshcat: MeshcatCommands, drones: Sequence[DrawnDrone], points: Sequence[Point], radius: float
) -> None:
    texts = _drone_texts([drone.name for drone in drones], _READABLE * radius)
    drawn = zip(drones, points, texts, row_colours(drones), strict=True)
    for number, (drone, point, text, colour) in enumerate(drawn):
        path = path_of(number, drone.name)
        meshcat.mesh(f"{path}/body", quadrotor(), colour)
        meshcat.place(f"{path}/body", HUB)
        height = min(_TEXT * radius, _NAME_WIDTH / label_picture(text).aspect)
        _draw_text(meshcat, f"{path}/name", text, np.array([0, 0, 0.42]), height)
        meshcat.place(path, point)


def _draw_obstacles(meshcat: MeshcatCommands, obstacles: Sequence[Point]) -> None:
    for number, place in enumerate(obstacles, 1):
        meshcat.mesh(f"obstacles/{number}/body", box(place, _OBSTACLE_SIZE), RED, opacity=_OPACITIES["body"])
        sides = [np.array([at - _OBSTACLE_SIZE / 2, at + _OBSTACLE_SIZE / 2]) for at in place]
        meshcat.segments(f"obstacles/{number}/edges", _lattice(sides), RED, _OPACITIES["edges"])


def _blocks(scene: Scene) -> dict[float, TriangleMesh]:
    """Return the blocks of blocked cells, joined into one mesh for each time of appearance."""
    found: dict[float, list[TriangleMesh]] = {}
    for block in (block for block in scene.blocks if not block.is_cube):
        x, y, top = block.top
        shape = box((x, y, (top + scene.ground) / 2), (_BLOCK, _BLOCK, top - scene.ground))
        found.setdefault(block.since_s, []).append(shape)
    return {since_s: joined_shapes(shapes) for since_s, shapes in found.items()}


def _walls(scene: Scene) -> TriangleMesh | None:
    """Return the walls of a three-dimensional map."""
    if scene.faces is not None:
        return mesh_of_faces(scene.faces.reshape(-1, 3))
    cubes = [block for block in scene.blocks if block.is_cube]
    places = np.rint(np.array([cube.top for cube in cubes]).reshape(-1, 3)).astype(np.int64)
    sides = np.array([cube.sides for cube in cubes], dtype=np.int64)
    low, high = np.array([axis.low for axis in scene.axes]), np.array([axis.high for axis in scene.axes])
    return blocked_cell_faces(places, sides, low, high, _BLOCK)


def _draw_walls(meshcat: MeshcatCommands, scene: Scene) -> None:
    """Draw walls with the height of the box, and unknown parts flat on the ground."""
    if scene.walls is None:
        return
    top = scene.axes[2].high + 0.5
    if len(scene.walls.occupied):
        meshcat.mesh("walls/occupied", prisms(scene.walls.occupied, scene.ground, top), STONE, _WALL_OPACITY)
    if len(scene.walls.unknown):
        flat = prisms(scene.walls.unknown, scene.ground, scene.ground + _FLAT)
        meshcat.mesh("walls/unknown", flat, UNKNOWN, _WALL_OPACITY)


def _animate(meshcat: MeshcatCommands, scene: Scene, playback: Playback) -> None:
    paint = row_colours(scene.drones)
    tracks: list[Track] = []
    for number, (drone, colour) in enumerate(zip(scene.drones, paint, strict=True)):
        path = path_of(number, drone.name)
        tracks += _motion_tracks(path, playback, number)
        if playback.states[number]:
            tracks.append(_colour_track(f"{path}/body/<object>", playback.states[number], colour))
    for number, (seen_s, _) in enumerate(playback.obstacles, 1):
        if seen_s > 0:
            tracks += [
                _appearance_track(f"obstacles/{number}/{part}/<object>", seen_s, opacity)
                for part, opacity in _OPACITIES.items()
            ]
    tracks += [
        _appearance_track(f"blocks/{since_s:g} s/<object>", since_s, _BLOCK_OPACITY)
        for since_s in _blocks(scene)
        if since_s > 0
    ]
    if tracks:
        meshcat.animate(tracks, FPS)


def _motion_tracks(path: str, playback: Playback, number: int) -> Iterator[Track]:
    """Yield the tracks of a drone's positions and attitudes, if it moves at all."""
    frames = FPS * playback.times
    positions, attitudes = playback.positions[:, number], playback.attitudes[:, number]
    if np.linalg.norm(positions - positions[0], axis=1).max() > _CLOSE_CELLS:
        yield Track(
            path, "position", "vector3", _keys(frames, positions, position_keys(frames, positions, _CLOSE_CELLS))
        )
    if angle(attitudes, attitudes[0]).max() > _ALIKE_RAD:
        keys = attitude_keys(frames, attitudes, _ALIKE_RAD)
        yield Track(f"{path}/body", "quaternion", "quaternion", _keys(frames, attitudes, keys))


def _keys(frames: Samples, values: Samples, keys: Keys) -> list[tuple[float, list[float]]]:
    return [*zip(frames[keys].round(6).tolist(), values[keys].tolist(), strict=True)]


def _colour_track(path: str, states: Sequence[tuple[float, DroneState]], colour: Colour) -> Track:
    """Return the track of a drone's colour."""
    keys: list[tuple[float, Colour]] = [(0, colour)]
    for at_s, state in states:
        begin, now = max(FPS * at_s, keys[-1][0]), keys[-1][1]
        keys += [(begin, now), (begin + _FADE, colour_of(state, colour))]
    return Track(path, "material.color", "color", keys)


def _appearance_track(path: str, at_s: float, opacity: float) -> Track:
    """Return the track of an obstacle that becomes visible."""
    begin = FPS * at_s
    return Track(path, "material.opacity", "number", [(0, [0.0]), (begin, [0.0]), (begin + _FADE, [opacity])])


def _drone_texts(names: Sequence[str], readable: float) -> list[str]:
    """Return the texts on the drones: their names, or only numbers (3.1 for `Robot3.1`) if names would be too small."""
    if all(_NAME_WIDTH / label_picture(name).aspect >= readable for name in names):
        return list(names)
    word = re.split("[0-9]", names[0])[0]
    numbered = all(name.startswith(word) and name[len(word) :][:1].isdecimal() for name in names)
    return [name[len(word) :] for name in names] if numbered else list(names)


def _draw_text(meshcat: MeshcatCommands, path: str, text: str, at: npt.NDArray[np.float64], height: float) -> None:
    picture = label_picture(text)
    x, y, z = (float(part) for part in at)
    meshcat.sprite(path, picture.svg)
    meshcat.place(path, (x, y, z), (height * picture.aspect, height, 1))


def row_colours(drones: Sequence[DrawnDrone]) -> list[Colour]:
    """Return the colour of each drone, given by its row."""
    groups = sorted({drone.group for drone in drones})
    shades = dict(zip(groups, colours(len(groups)), strict=True))
    return [shades[drone.group] for drone in drones]


def colour_of(state: DroneState, colour: Colour) -> Colour:
    """Return the colour of a drone in `state`; `colour` is the colour of its row."""
    match state:
        case DroneState.FLIES:
            return colour
        case DroneState.WITHDRAWN:
            return GREY
        case DroneState.FALLEN:
            return RED
        case _ as never:
            assert_never(never)


class LabelPicture(NamedTuple):
    """An SVG picture of a label, drawn with the browser's fonts, and the ratio of its width to its height."""

    svg: str
    aspect: float


def label_picture(text: str) -> LabelPicture:
    """Return `text` in white with a dark outline, readable on any background, and truncated if it is too long."""
    shown = printable(text)
    if len(shown) > _LONGEST:
        shown = shown[: _LONGEST - 1] + "…"
    ems = sum(1.1 if unicodedata.east_asian_width(sign) in "WF" else 0.62 for sign in shown)
    width = round(ems * _EM) + 24
    svg = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{_HEIGHT}">'
        f'<text x="50%" y="46" text-anchor="middle" font-family="system-ui,sans-serif" font-size="{_EM}"'
        ' font-weight="600" fill="#fff" stroke="#1d2733" stroke-width="9" stroke-linejoin="round"'
        f' paint-order="stroke">{escape(shown)}</text></svg>'
    )
    return LabelPicture(svg, width / _HEIGHT)
