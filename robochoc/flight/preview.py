"""A preview flight: a mission flown in calm air, to be shown. It is refused where it would take minutes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from robochoc.flight.flight import fly
from robochoc.flight.layout import Axis, Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Mission, in_cells

_NO_FLIGHT = (ValueError, ArithmeticError, MemoryError)
"""The errors of an impossible flight: places too close to each other, no way between them, numbers beyond all bounds.
The rest can still be shown."""
_DRONES_MAX = 500
"""To plan the routes of more drones takes minutes."""
_FLIGHTS_MAX = 2_000
"""The product of drones and epochs; likewise."""
_LEGS_MAX = 60
"""Each leg takes a fifth of a second, however few drones there are."""
_CELL_MIN_M = 0.25
"""A drone does not fit into a smaller cell."""
_CELL_MAX_M = 4.0
"""A drone flies for minutes where cells are larger."""
_OFFSET_MAX_M = 1e6
"""A place further from the origin is flown near the origin."""


@dataclass(frozen=True)
class Preview:
    """A mission and how it was flown, or why it was not.

    `mission` is the one that was flown. It is not to scale where cells of the mission that was asked for are smaller
    than drones, or vast.
    """

    mission: Mission
    flown: FlightLog | None = None
    why_not: str = ""


def preview_of(mission: Mission, progress: Callable[[str], None] | None = None) -> Preview:
    """Return how the drones fly `mission` in calm air. If no drone has a goal, or they cannot fly, nothing was flown.

    Args:
        mission: What the drones are asked to do.
        progress: Called now and then with what is being done, in words.
    """
    scaled = _with_flyable_cells(mission)
    if not any(leg.goals for leg in mission.legs):
        return Preview(scaled)
    drones, legs = len(mission.drones), len(mission.legs)
    if drones > _DRONES_MAX or drones * legs > _FLIGHTS_MAX or legs > _LEGS_MAX:
        many = f"{_counted(drones, 'drone')} in {_counted(legs, 'epoch')}"
        return Preview(scaled, why_not=f"{many} are more than are flown for a picture")
    try:
        return Preview(scaled, fly(scaled, progress=progress))
    except _NO_FLIGHT as error:
        return Preview(scaled, why_not=str(error) or type(error).__name__)


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _with_flyable_cells(mission: Mission) -> Mission:
    """Return `mission`; where its cells are smaller than drones, or vast, the same in a box whose cells are metres."""
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


def _cell_m(axis: Axis) -> float:
    """Return how many units of the problem a cell of `axis` is long."""
    return (axis.last - axis.first) / (axis.high - axis.low) if axis.high > axis.low else 1.0
