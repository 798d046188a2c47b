"""The stops of a list's robots, for `map.json`: the places of a robot's tasks, in the order of its way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robochoc.maps.stops import FAR, RobotStops, Stop
from robochoc.tasks.tours import Tour
from robochoc.tasks.waypoints import Cells

MAX_STOPS = 200_000
"""The maximum number of stops in the orders of all tours."""


def stops_of_choice(variable: str, places: Mapping[int, Cells]) -> RobotStops:
    """Return the stops of a robot with at most one task: the value of `variable`."""
    return RobotStops(tuple(Stop(variable, _in_space(at), task) for task, at in places.items()))


def stops_of_tours(
    names: Mapping[int, str], places: Mapping[int, Cells], nearest: Sequence[int], variable: str, tours: Sequence[Tour]
) -> RobotStops:
    """Return the stops of a robot with several tasks.

    Args:
        names: The variable that is 1 if the robot does a task, by the number of the task.
        places: The places of tasks that have one.
        nearest: The tasks with a place, the nearest first: the order of a robot without tours.
        variable: The variable with the number of the tour.
        tours: The tours, from number 1 on; empty: the robot has no tours.
    """
    index = {task: number for number, task in enumerate(nearest)}
    stops = tuple(Stop(names[task], _in_space(places[task])) for task in nearest)
    if not tours:
        return RobotStops(stops)
    orders = ((), *(tuple(index[task] for task in one.order if task in index) for one in tours))
    return RobotStops(stops, variable, orders)


def within_limit(found: Mapping[str, RobotStops]) -> bool:
    """Return whether the stops are near enough for the file, and the orders of all tours have at most `MAX_STOPS`."""
    stops = sum(len(order) for one in found.values() for order in one.orders)
    return stops <= MAX_STOPS and all(
        abs(part) <= FAR for one in found.values() for stop in one.stops for part in stop.at
    )


def _in_space(at: Cells) -> tuple[int, int, int]:
    x, y, *z = at
    return x, y, z[0] if z else 0
