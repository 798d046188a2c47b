"""The places that values of a team on a map stand for, in metres of the map's frame.

Robots' files say where a robot goes by a formula over its variables, its waypoint, in cells of the map (`topics`); the
map beside them says how long a cell is. A robot that plans several visits has a waypoint for the first one only. Its
other variables stand for places by the same formula, if all their values are places of somebody's waypoint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from robochoc.maps.ground_map import GroundMap
from robochoc.model.expression import Expression, UndefinedValueError, evaluate, names
from robochoc.model.problem import Robot, Team

Place = tuple[float, ...]
"""An x and a y in metres; on a three-dimensional map a z, too."""
_Formulas = tuple[Expression, ...]
_VALUES_MAX = 1_000_000
"""Of teams with more values, of all variables together, only the waypoints themselves are told."""
_PLACES = 6
"""Decimal places: what floating point adds beyond is none of the map's."""


class MapPlaces:
    """The places that values stand for.

    Args:
        team: The team.
        ground: Its map. None, or one that does not say how long a cell is: nothing is known of places.
    """

    def __init__(self, team: Team, ground: GroundMap | None) -> None:
        self._scale = ground.scale if ground else None
        self._formulas: dict[str, tuple[str, _Formulas]] = {}
        if ground is None or self._scale is None:
            return
        for robot in team.robots:
            self._formulas.update(_waypoints(robot, has_height=ground.volume is not None))
        self._formulas |= dict(self._later_visits(team))

    def of(self, assignment: Mapping[str, int]) -> dict[str, Place]:
        """Return the place of each variable whose value stands for one, in the order of `assignment`."""
        found = {}
        for name, value in assignment.items():
            if name in self._formulas and self._scale is not None:
                variable, formulas = self._formulas[name]
                try:
                    cell = [evaluate(one, {variable: value}) for one in formulas]
                    found[name] = tuple(round(part * self._scale, _PLACES) + 0.0 for part in cell)
                except (UndefinedValueError, OverflowError):
                    continue
        return found

    def _later_visits(self, team: Team) -> Iterator[tuple[str, tuple[str, _Formulas]]]:
        """Yield the other variables of robots with one waypoint, if their values are places, with its formulas."""
        domains = {name: variable.domain for name, variable in team.variables.items()}
        if sum(map(len, domains.values())) > _VALUES_MAX:
            return
        known = {value for name in self._formulas for value in domains[name]}
        for robot in team.robots:
            own = [variable.name for variable in robot.variables]
            found = [self._formulas[name] for name in own if name in self._formulas]
            for name in own if len(found) == 1 else ():
                if name not in self._formulas and known.issuperset(domains[name]):
                    yield name, found[0]


def _waypoints(robot: Robot, *, has_height: bool) -> Iterator[tuple[str, tuple[str, _Formulas]]]:
    """Yield the variables of a robot that are, one each, all that a waypoint depends on, with its formulas."""
    own = {variable.name for variable in robot.variables}
    for topic in robot.topics:
        formulas = tuple(part for part in (topic.x, topic.y, topic.z)[: 3 if has_height else 2] if part is not None)
        over = {name for part in formulas for name in names(part)}
        if len(formulas) == (3 if has_height else 2) and len(over) == 1 and over <= own:
            (name,) = over
            yield name, (name, formulas)
