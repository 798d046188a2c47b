"""The map of a list for `map.json`: the robots' positions, the length of a unit of waypoints, and the map's walls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from robochoc.maps.ground_map import SIDE_MAX, GroundMap
from robochoc.tasks.entries import Point
from robochoc.tasks.waypoints import in_units


def plain_ground(robots: Mapping[str, Point], places: Sequence[Point], unit: Fraction) -> GroundMap | None:
    """Return a map without walls that contains all places; None if the places are too far apart, or from the origin.

    Args:
        robots: The position of each robot that has one, by its name in the team.
        places: All positions in the list.
        unit: The length of a unit of waypoints.
    """
    cells = [in_units(place, unit) for place in places]
    low, high = ([pick(parts) for parts in zip(*cells, strict=True)][:2] for pick in (min, max))
    columns, rows = (end - begin + 1 for begin, end in zip(low, high, strict=True))
    if max(columns, rows, *map(abs, low)) > SIDE_MAX:
        return None
    starts = {name: in_units(at, unit) for name, at in robots.items()}
    return GroundMap(
        columns,
        rows,
        {name: (at[0] - low[0] + 1, at[1] - low[1] + 1) for name, at in starts.items()},
        first=(low[0], low[1]),
        scale=float(unit),
        places={name: (float(at[0]), float(at[1])) for name, at in robots.items()},
    )
