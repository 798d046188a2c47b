"""Preview flights: missions flown in calm air, for pictures. Missions that would take minutes are rejected."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robochoc.flight.flight import fly
from robochoc.flight.layout import BoxAxis, Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Mission, in_cells
from robochoc.system.lazy_dataclass import dataclass

_NO_FLIGHT = (ValueError, ArithmeticError, MemoryError)
"""The errors of an impossible flight: places too close to each other, no routes, or numbers out of range.
The mission can still be shown."""
_DRONES_MAX = 500
"""The maximum number of drones, since planning routes for more drones takes minutes."""
_FLIGHTS_MAX = 2_000
"""The maximum product of the numbers of drones and epochs; larger flights take minutes."""
_LEGS_MAX = 60
"""The maximum number of legs, each of which takes a fifth of a second even for few drones."""
_CELL_MIN_M = 0.25
"""The smallest cell into which a drone fits."""
_CELL_MAX_M = 4.0
"""The largest cell; with larger cells, drones would fly for minutes."""
_OFFSET_MAX_M = 1e6
"""Missions with places further from the origin are moved near the origin."""


@dataclass(frozen=True)
class Preview:
    """The flown mission and its log, or the reason why it was not flown.

    `mission` is not to scale if cells in the given mission are smaller than drones, or very large.
    """

    mission: Mission
    flown: FlightLog | None = None
    why_not: str = ""


def preview_of(mission: Mission, progress: Callable[[str], None] | None = None) -> Preview:
    """Fly `mission` in calm air. Nothing is flown if no drone has a goal, or the flight is impossible.

    Args:
        mission: The mission.
        progress: Called regularly with a description of the progress.
    """
    scaled = _with_flyable_cells(mission)
    if not any(leg.goals for leg in mission.legs):
        return Preview(scaled)
    drones, legs = len(mission.drones), len(mission.legs)
    if drones > _DRONES_MAX or drones * legs > _FLIGHTS_MAX or legs > _LEGS_MAX:
        many = f"{_counted(drones, 'drone')} in {_counted(legs, 'epoch')}"
        return Preview(scaled, why_not=f"{many} are too many for a preview flight")
    try:
        return Preview(scaled, fly(scaled, progress=progress))
    except _NO_FLIGHT as error:
        return Preview(scaled, why_not=str(error) or type(error).__name__)


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _with_flyable_cells(mission: Mission) -> Mission:
    """Return `mission`; if its cells are smaller than drones, or very large, with cells of one metre."""
    cells_m = [_cell_m(axis) * mission.scale for axis in mission.axes]
    ends_m = [abs(end) * mission.scale for axis in mission.axes for end in (axis.first, axis.last)]
    if min(cells_m) >= _CELL_MIN_M and max(cells_m) <= _CELL_MAX_M and max(ends_m) <= _OFFSET_MAX_M:
        return mission

    def moved(point: Point) -> Point:
        x, y, z = in_cells(mission, np.array(point)).tolist()
        return x, y, z

    rows, columns, levels = (replace(axis, first=axis.low, last=axis.high) for axis in mission.axes)
    return replace(
        mission,
        drones=tuple(replace(drone, home=moved(drone.home)) for drone in mission.drones),
        legs=tuple(
            replace(leg, goals={number: replace(goal, at=moved(goal.at)) for number, goal in leg.goals.items()})
            for leg in mission.legs
        ),
        axes=(rows, columns, levels),
        scale=1.0,
        blocks=tuple(replace(block, at=moved(block.at)) for block in mission.blocks),
        walls=mission.walls and mission.walls.moved(moved((0.0, 0.0, 0.0)), 1 / mission.scale),
    )


def _cell_m(axis: BoxAxis) -> float:
    """Return the length of a cell of `axis`, in units of the problem."""
    return (axis.last - axis.first) / (axis.high - axis.low) if axis.high > axis.low else 1.0
