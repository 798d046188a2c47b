"""Who moves when: first those who step aside, then row by row the others rise to their places.

Times are in frames, `FPS` a second.
"""

from __future__ import annotations

from collections.abc import Sequence

from robochoc.ros.layout import Point
from robochoc.view.scene import Drone

FPS = 30

Key = tuple[int, Point]
"""A frame, and where the drone is then."""

_LOOK = 30
"""Everybody still on the ground, for the eye to take it in."""
_STEP = 50
"""How long one drone takes to step aside."""
_RISE = 60
"""How long one takes to its place."""
_STAGGER = 10
"""From one start to the next, of rows that rise as of drones that step aside."""
_STAGGER_IN_ALL = 60
"""From the first start to the last, at most."""
_SAMPLES = 16
"""Straight pieces of a flight: enough to look smooth."""
_HOP = 0.45
"""How high drones step aside, in cells: above those that stand, below the box."""


def flights(drones: Sequence[Drone]) -> list[list[Key]]:
    """The key frames of each drone, in the same order: from its home to where it ends. None for those that stay.

    All flights last equally long, so that a player's slider means the same to each.
    """
    steps = _starts(sum(drone.aside is not None for drone in drones), _LOOK)
    clear = steps[-1] + _STEP if steps else _LOOK
    rows = sorted({drone.group for drone in drones if drone.place})
    rises = dict(zip(rows, _starts(len(rows), clear), strict=True))
    end = rises[rows[-1]] + _RISE if rows else clear
    step = iter(steps)
    keys: list[list[Key]] = []
    for drone in drones:
        if drone.place:
            keys.append(_flight(drone.home, drone.place, rises[drone.group], _RISE, end))
        elif drone.aside:
            keys.append(_flight(drone.home, drone.aside, next(step), _STEP, end, hop=_HOP))
        else:
            keys.append([])
    return keys


def _starts(count: int, first: int) -> list[int]:
    """When each of `count` begins, one after the other but none too late."""
    stagger = min(_STAGGER, _STAGGER_IN_ALL / max(count - 1, 1))
    return [first + round(index * stagger) for index in range(count)]


def _flight(start: Point, stop: Point, begin: int, frames: int, end: int, hop: float = 0) -> list[Key]:
    """From `start` to `stop` in `frames`, standing before and after; with a `hop`, up, across and down."""
    keys = [(0, start), (begin, start)]
    for sample in range(1, _SAMPLES):
        time = sample / _SAMPLES
        across = _eased(1.6 * time - 0.3) if hop else _eased(time)
        up = hop * _eased(4 * min(time, 1 - time))
        x, y, z = (a + (b - a) * across for a, b in zip(start, stop, strict=True))
        keys.append((begin + round(frames * time), (x, y, z + up)))
    keys.append((begin + frames, stop))
    if begin + frames < end:
        keys.append((end, stop))
    return keys


def _eased(time: float) -> float:
    """0 to 1, starting and stopping gently."""
    time = min(max(time, 0.0), 1.0)
    return time * time * time * (time * (6 * time - 15) + 10)
