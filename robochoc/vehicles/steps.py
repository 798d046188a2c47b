"""Routes cut into steps, and the dependencies of each step on the steps of other vehicles.

The legs from `route_planner.py` are safe one after the other. So a step may begin as soon as all steps in earlier legs
that are nearer to it than the distance have been flown. Since steps wait only for earlier legs, there are no cyclic
waits, and the distance is kept even if a vehicle is late. This is the dependency graph for executing plans with delays
(W. Hoenig et al., "Persistent and Robust Execution of MAPF Schedules in Warehouses", IEEE Robotics and Automation
Letters 4(2), 2019, section IV), where the order of events is that of the legs.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import field
from enum import Enum, auto

import numpy as np

from robochoc.flight.layout import Point
from robochoc.maps.routes.distances import SLACK_M, Array, line_distances, squashed
from robochoc.system.lazy_dataclass import dataclass
from robochoc.vehicles.route_planner import PlannedLeg

_PARTS = 32
"""The maximum number of steps in a straight piece."""


class StepKind(Enum):
    """The kind of a step. Climbs and landings are executed by the vehicle's autopilot."""

    CLIMB = auto()
    FLY = auto()
    LAND = auto()


@dataclass
class RouteStep:
    """A straight step of a vehicle's route, in metres."""

    kind: StepKind
    begin: Point
    end: Point
    is_corner: bool
    """True if this is the last step of its straight piece."""
    needs: dict[str, int] = field(default_factory=dict)
    """The number of steps that other vehicles must have completed before this step, by vehicle name."""


@dataclass(frozen=True)
class _Piece:
    name: str
    leg: int
    first: int
    begins: Array
    ends: Array

    @property
    def line(self) -> tuple[Array, Array]:
        return self.begins[0], self.ends[-1]


def steps_of(
    legs: Sequence[PlannedLeg], climbing: Collection[str], landing: Collection[str], distance_m: float, downwash: float
) -> dict[str, list[RouteStep]]:
    """Return the steps of each vehicle that has legs.

    Args:
        legs: Legs in an order in which each leg is safe.
        climbing: Vehicles whose first leg is flown by the autopilot.
        landing: Vehicles that land at the end of their last leg.
        distance_m: The smallest distance between two vehicles.
        downwash: The number by which heights are divided in distances.
    """
    steps: dict[str, list[RouteStep]] = {}
    pieces: list[_Piece] = []
    last = {leg.name: number for number, leg in enumerate(legs)}
    for number, leg in enumerate(legs):
        mine = steps.setdefault(leg.name, [])
        lands = leg.name in landing and last[leg.name] == number
        path = _closed(leg.path) if lands else leg.path
        for begin, end, left in zip(path[:-1], path[1:], range(len(path) - 2, -1, -1), strict=True):
            kind = StepKind.CLIMB if leg.name in climbing and not mine else StepKind.FLY
            kind = StepKind.LAND if lands and not left else kind
            pieces.append(_piece(leg.name, number, mine, (kind, begin, end), distance_m))
    for later, piece in enumerate(pieces):
        for earlier in pieces[:later]:
            if earlier.name != piece.name and earlier.leg != piece.leg:
                _add_waits(steps[piece.name], piece, earlier, distance_m, downwash)
    return steps


def _closed(path: Array) -> Array:
    """Return a path whose last piece leads straight down, possibly with length 0, and is flown by the autopilot."""
    down = (path[-1, :2] == path[-2, :2]).all() and path[-1, 2] <= path[-2, 2]
    return path if down else np.vstack((path, path[-1]))


def _piece(
    name: str, leg: int, steps: list[RouteStep], what: tuple[StepKind, Array, Array], distance_m: float
) -> _Piece:
    kind, begin, end = what
    length = math.dist(begin, end)
    parts = max(1, min(_PARTS, math.ceil(2 * length / distance_m))) if kind is StepKind.FLY else 1
    points = begin + (end - begin) * (np.arange(parts + 1) / parts)[:, None]
    first = len(steps)
    steps += [
        RouteStep(kind, _point(points[number]), _point(points[number + 1]), number == parts - 1)
        for number in range(parts)
    ]
    return _Piece(name, leg, first, points[:-1], points[1:])


def _add_waits(steps: list[RouteStep], piece: _Piece, earlier: _Piece, distance_m: float, downwash: float) -> None:
    """Add the dependencies on steps in an earlier piece to the steps of a piece."""
    least = distance_m - SLACK_M
    mine, theirs = _flat(piece.line, downwash), _flat(earlier.line, downwash)
    if line_distances(mine, theirs) >= least:
        return
    mine = _flat((piece.begins[:, None], piece.ends[:, None]), downwash)
    theirs = _flat((earlier.begins[None], earlier.ends[None]), downwash)
    near = line_distances(mine, theirs) < least
    for number in np.flatnonzero(near.any(axis=1)).tolist():
        needs = steps[piece.first + number].needs
        done = earlier.first + int(np.flatnonzero(near[number])[-1]) + 1
        needs[earlier.name] = max(needs.get(earlier.name, 0), done)


def _flat(line: tuple[Array, Array], downwash: float) -> tuple[Array, Array]:
    return squashed(line[0], downwash), squashed(line[1], downwash)


def _point(row: Array) -> Point:
    x, y, z = row.tolist()
    return x, y, z


def length_along(begin: Point, end: Point, place: Point) -> float:
    """Return the distance from the beginning of a line to the projection of a place onto the line, in metres."""
    length = math.dist(begin, end)
    if not length:
        return 0.0
    return sum((e - b) * (p - b) for b, e, p in zip(begin, end, place, strict=True)) / length


def on_line(begin: Point, end: Point, length: float) -> Point:
    """Return the point on a line at a distance from its beginning, in metres."""
    share = length / (math.dist(begin, end) or 1.0)
    x, y, z = (b + share * (e - b) for b, e in zip(begin, end, strict=True))
    return x, y, z
