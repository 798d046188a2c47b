"""The lengths of ways between the places of a list: along streets, straight, or around the walls of a map."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from fractions import Fraction
from math import floor
from pathlib import Path
from typing import TYPE_CHECKING

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, shortened
from robochoc.model.allocation import Distance, distance_between
from robochoc.system.lazy_dataclass import dataclass
from robochoc.tasks.entries import Point, RobotEntry, TaskEntry

if TYPE_CHECKING:
    from robochoc.maps.ground_map import GroundMap
    from robochoc.maps.map_file import Map
    from robochoc.maps.reachability.travel import TravelSpace

_HALF = Fraction(1, 2)
MAX_STEPS = 4_000_000_000
"""The maximum number of pixels of a map, times the number of places: the search for ways takes about a minute."""


class Ways(ABC):
    """Measures ways between places."""

    @abstractmethod
    def length(self, start: Point, end: Point, places: int, radius: Fraction) -> int | None:
        """Return the length of the shortest way of a robot between two places, in units of 10**-places.

        It is rounded half up. None: the robot cannot reach the end.
        """


@dataclass(frozen=True)
class PlainWays(Ways):
    """Ways without obstacles."""

    distance: Distance

    def length(self, start: Point, end: Point, places: int, radius: Fraction) -> int | None:  # noqa: ARG002 - no walls
        """Return the distance."""
        return distance_between(start, end, self.distance, places)


class MapWays(Ways):
    """Ways around the walls of a map. Those from a place are searched when the first of them is asked for.

    Args:
        grid: The map.
        robots: The robots of the list.
        tasks: The tasks of the list.
    """

    def __init__(self, grid: Map, robots: Mapping[str, RobotEntry], tasks: Mapping[str, TaskEntry]) -> None:
        self._grid = grid
        self._spaces: dict[Fraction, TravelSpace] = {}
        self._ends = [*dict.fromkeys(one.at for one in tasks.values() if one.at)]
        self._found: dict[tuple[Fraction, Point], dict[Point, Fraction | None]] = {}
        self._robots = robots
        self._tasks = tasks

    def check(self, mistakes: DiagnosticCollector) -> None:
        """Report places outside the map or in walls, and robots that do not fit at their places."""
        from robochoc.maps.reachability.travel import PlaceError  # noqa: PLC0415 - start-up

        for kind, entries in (("robot", self._robots), ("task", self._tasks)):
            for name, one in entries.items():
                radius = one.radius if isinstance(one, RobotEntry) else Fraction(0)
                subject = f"the {kind} '{shortened(name)}'"
                with mistakes.at(one.line):
                    try:
                        space = self._space(radius)
                        if one.at:
                            space.check(subject, one.at)
                    except PlaceError as error:
                        what, _, hint = str(error).partition(": ")
                        raise MistakeError(what, hint or "move it, or use another map") from None
                    if one.at and not space.fits(one.at):
                        what = f"{subject} does not fit at its place: an obstacle is nearer than its radius"
                        raise MistakeError(what, f"move it, or write a radius below {float(radius):g}")
        places = len({*self._ends, *(one.at for one in self._robots.values())})
        if places * self._grid.free.size > MAX_STEPS:
            what = f"has {places:,} places on a map with {self._grid.free.size:,} pixels"
            raise MistakeError(what, "use a map with a larger resolution, or fewer places")

    def length(self, start: Point, end: Point, places: int, radius: Fraction) -> int | None:
        """Return the length of the way."""
        found = self._found.get((radius, start))
        if found is None:
            lengths = self._space(radius).lengths(start, self._ends)
            found = self._found[radius, start] = dict(zip(self._ends, lengths, strict=True))
        metres = found[end]
        return None if metres is None else floor(metres * 10**places + _HALF)

    def ground(self, starts: Mapping[str, Point], unit: Fraction) -> GroundMap:
        """Return the map for `map.json`. It has the largest radius, and the lowest speed of the robots.

        Raises:
            ValueError: Too many cells of a three-dimensional map are blocked.
        """
        from robochoc.maps.reachability.ground import ground_on  # noqa: PLC0415 - start-up
        from robochoc.maps.reachability.travel import TravelSpace  # noqa: PLC0415 - the same

        robots = self._robots.values()
        radius, speed = max(one.radius for one in robots), min(one.speed for one in robots)
        return ground_on(TravelSpace(self._grid, radius, unit).cells, starts, radius, speed)

    def _space(self, radius: Fraction) -> TravelSpace:
        from robochoc.maps.reachability.travel import TravelSpace  # noqa: PLC0415 - start-up

        if radius not in self._spaces:
            self._spaces[radius] = TravelSpace(self._grid, radius)
        return self._spaces[radius]


def map_at(name: str, folder: Path, line: int) -> Map:
    """Return the map in the file `name`, relative to the folder of the list.

    Raises:
        MistakeError: The file does not exist.
        InvalidInputError: The file is not a valid map.
    """
    from robochoc.maps.map_file import read_map  # noqa: PLC0415 - start-up

    path = folder / name
    if "\0" in name or not path.exists():
        what = f"the map {shortened(name)} does not exist"
        raise MistakeError(what, "write its path relative to the folder of this file", line)
    return read_map(path)
