"""A scene as meshcat commands: the ground, the box with its grid and axes, the drones, and their flight."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import product

import numpy as np
import numpy.typing as npt

from robochoc.ros.layout import Axis
from robochoc.view.flight import FPS, Key, flights
from robochoc.view.label import label
from robochoc.view.palette import GREY, Colour, colours
from robochoc.view.quadrotor import Shape, disc, joined, quadrotor
from robochoc.view.recorder import Recorder, Track
from robochoc.view.scene import Drone, Scene

_Corners = npt.NDArray[np.float64]
"""The lowest and the highest x, y and z of something, a row each."""

_LINE: Colour = (0.45, 0.52, 0.60)
_GROUND: Colour = (0.50, 0.56, 0.62)
_WHITE: Colour = (1, 1, 1)
_MARGIN = 0.8
"""Ground around the outermost drones, in cells."""
_EYE = np.array([0.7, -1.0, 0.42])
"""Where the camera looks from: in front of row 1, a little to the right, from above."""
_FIELD_OF_VIEW_DEG = 28
_ROOM = 1.06
"""Of the view, for what the scene itself fills: the axes' labels need some."""
_TEXT = 0.045
"""Height of text, as a part of the scene's radius."""
_READABLE = 0.03
"""Height of text that can still be read, likewise."""
_NAME_WIDTH = 0.8
"""Of a drone's name, at most, in cells: the neighbour needs room for its own."""
_FADE = 25
"""Frames in which a drone that steps aside turns grey."""


def commands(scene: Scene) -> list[bytes]:
    """The packed commands that make meshcat's viewer show `scene` and play its flight once."""
    recorder = _drawn(scene)
    _animate(recorder, scene.drones)
    return recorder.commands


def still(scene: Scene) -> list[bytes]:
    """The same without the flight: every drone stays at home."""
    return _drawn(scene).commands


def path_of(number: int, name: str) -> str:
    """Where in meshcat's tree, below its root, the drone called `name` is: the scene's `number`-th, counted from 0.

    The number keeps paths apart, and away from names that mean something in JavaScript.
    """
    return f"drones/{number + 1} " + re.sub(r"[^\w.-]", "_", name)


def _drawn(scene: Scene) -> Recorder:
    recorder = Recorder()
    extent = _extent(scene)
    radius = float(np.linalg.norm(extent[1] - extent[0])) / 2
    _aim(recorder, extent, radius)
    _draw_ground(recorder, scene, extent)
    _draw_box(recorder, scene.axes)
    _label_axes(recorder, scene.axes, _TEXT * radius)
    _draw_drones(recorder, scene.drones, radius)
    return recorder


def _box(axes: Sequence[Axis]) -> _Corners:
    return np.array([[axis.low - 0.5 for axis in axes], [axis.high + 0.5 for axis in axes]])


def _extent(scene: Scene) -> _Corners:
    points = [point for drone in scene.drones for point in (drone.home, drone.place, drone.aside) if point]
    everything = np.array([*points, *_box(scene.axes)])
    margin = np.array([_MARGIN, _MARGIN, 0])
    return np.array([everything.min(axis=0) - margin, everything.max(axis=0) + margin])


def _aim(recorder: Recorder, extent: _Corners, radius: float) -> None:
    """Scale any scene to radius 1 around the origin, where the lights are, and have the camera see all of it."""
    x, y, z = (float(part) for part in -extent.mean(axis=0) / radius)
    recorder.place("", (x, y, z), (1 / radius, 1 / radius, 1 / radius))
    for default in ("/Grid", "/Axes"):
        recorder.set(default, "visible", value=False)
    corners = np.array([*product(*extent.T)]) - extent.mean(axis=0)
    x, y, z = (float(part) for part in _from_where_to_see(corners / radius))
    camera = "/Cameras/default/rotated/<object>"
    recorder.set(camera, "fov", _FIELD_OF_VIEW_DEG)
    recorder.set(camera, "position", [x, z, -y])  # the camera's own y is up


def _from_where_to_see(corners: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Where, in the direction of `_EYE`, a camera that looks at the origin just has all `corners` in a square view."""
    back: npt.NDArray[np.float64] = _EYE / np.linalg.norm(_EYE)
    right = np.cross([0, 0, 1], back)
    right /= np.linalg.norm(right)
    aside = np.abs(corners @ np.column_stack([right, np.cross(back, right)])).max(axis=1)
    distance = corners @ back + _ROOM * aside / math.tan(math.radians(_FIELD_OF_VIEW_DEG / 2))
    return back * float(distance.max())


def _draw_ground(recorder: Recorder, scene: Scene, extent: _Corners) -> None:
    """A plane, and on it each drone's pad in the colour of its row."""
    (left, front, _), (right, back, _) = extent
    corners = np.array([[left, front, 0], [right, front, 0], [right, back, 0], [left, back, 0]])
    plane = Shape(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.ones((4, 3)))
    recorder.mesh("ground/plane", plane, _GROUND, opacity=0.3)
    recorder.place("ground/plane", (0, 0, scene.ground - 0.02))
    if scene.drones:
        paint = _paint(scene.drones)
        pads = [disc(drone.home, 0.36, paint[drone.group]) for drone in scene.drones]
        recorder.mesh("ground/pads", joined(pads), _WHITE, opacity=0.45)
        recorder.place("ground/pads", (0, 0, -0.01))


def _draw_box(recorder: Recorder, axes: Sequence[Axis]) -> None:
    """The edges, the walls behind and below with their grid, and very faintly every cell."""
    low, high = _box(axes)
    walls = [np.arange(a, b + 0.5) for a, b in zip(low, high, strict=True)]
    parts = {
        "cells": (walls, 0.5 / max(map(len, walls))),
        "floor": ([*walls[:2], low[2:]], 0.35),
        "side": ([low[:1], *walls[1:]], 0.2),
        "back": ([walls[0], high[1:2], walls[2]], 0.2),
        "edges": ([wall[[0, -1]] for wall in walls], 0.9),
    }
    for name, (lines, opacity) in parts.items():
        recorder.segments(f"box/{name}", _lattice(lines), _LINE, opacity)


def _label_axes(recorder: Recorder, axes: Sequence[Axis], height: float) -> None:
    """Each named axis' name and numbers, beside the edge of the box that is nearest to the viewer."""
    low, high = _box(axes)
    middle = (low + high) / 2
    near = 1.2 * height
    beside = [
        np.array([middle[0], low[1] - near, low[2]]),
        np.array([high[0] + near, middle[1], low[2]]),
        np.array([low[0] - near, low[1], middle[2]]),
    ]
    for number, (axis, origin) in enumerate(zip(axes, beside, strict=True)):
        if not axis.name:
            continue
        for at, text in axis.ticks:
            spot = origin.copy()
            spot[number] = at
            _write(recorder, f"axes/{axis.name} {text}", text, spot, height)
        away = np.sign(origin - middle) * [1, 1, 0] * 2.2 * height
        _write(recorder, f"axes/{axis.name}", axis.name, origin + away, 1.2 * height)


def _lattice(walls: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Both ends of every line parallel to an axis, where walls meet."""
    ends = []
    for along in range(3):
        across = [walls[axis] if axis != along else walls[axis][[0, -1]] for axis in range(3)]
        mesh = np.stack(np.meshgrid(*across, indexing="ij"), axis=-1)
        if len(walls[along]) > 1:
            ends.append(np.moveaxis(mesh, along, 2).reshape(-1, 3))
    return np.concatenate(ends)


def _draw_drones(recorder: Recorder, drones: Sequence[Drone], radius: float) -> None:
    paint = _paint(drones)
    texts = _texts([drone.name for drone in drones], _READABLE * radius)
    for number, (drone, text) in enumerate(zip(drones, texts, strict=True)):
        path = path_of(number, drone.name)
        recorder.mesh(f"{path}/body", quadrotor(), paint[drone.group])
        height = min(_TEXT * radius, _NAME_WIDTH / label(text).aspect)
        _write(recorder, f"{path}/name", text, np.array([0, 0, 0.42]), height)
        recorder.place(path, drone.home)


def _animate(recorder: Recorder, drones: Sequence[Drone]) -> None:
    paint = _paint(drones)
    tracks = []
    for number, (drone, keys) in enumerate(zip(drones, flights(drones), strict=True)):
        path = path_of(number, drone.name)
        if keys:
            tracks.append(Track(path, "position", "vector3", keys))
        if drone.aside:
            tracks.append(_fading(f"{path}/body/<object>", keys, paint[drone.group]))
    if tracks:
        recorder.animate(tracks, FPS)


def _fading(path: str, keys: Sequence[Key], colour: Colour) -> Track:
    begin, end = keys[1][0], keys[-1][0]
    fade = [(0, colour), (begin, colour), (begin + _FADE, GREY), (end, GREY)]
    return Track(path, "material.color", "color", fade)


def _texts(names: Sequence[str], readable: float) -> list[str]:
    """What to write on the drones: their names; where those would be too small, the 3.1 of `Robot3.1`."""
    if all(_NAME_WIDTH / label(name).aspect >= readable for name in names):
        return list(names)
    word = re.split("[0-9]", names[0])[0]
    numbered = all(name.startswith(word) and name[len(word) :][:1].isdecimal() for name in names)
    return [name[len(word) :] for name in names] if numbered else list(names)


def _write(recorder: Recorder, path: str, text: str, at: npt.NDArray[np.float64], height: float) -> None:
    picture = label(text)
    x, y, z = (float(part) for part in at)
    recorder.sprite(path, picture.svg)
    recorder.place(path, (x, y, z), (height * picture.aspect, height, 1))


def _paint(drones: Sequence[Drone]) -> dict[int, Colour]:
    groups = sorted({drone.group for drone in drones})
    return dict(zip(groups, colours(len(groups)), strict=True))
