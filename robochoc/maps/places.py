"""The places on a map that are represented by values of variables, in metres in the map's frame.

A robot's file has the robot's waypoint as a formula over its variables, in cells of the map (`topics`); the map has the
length of a cell. A robot that plans several visits has a waypoint only for the first visit. The formula also applies to
the robot's other variables if all their values are places of some robot's waypoint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from robochoc.model.expression import Apply, Expression, names
from robochoc.model.problem import Robot, Team
from robochoc.model.waypoints import coordinate

if TYPE_CHECKING:
    from robochoc.maps.ground_map import GroundMap

Place = tuple[float, ...]
"""The x and y of a place, and the z on a three-dimensional map, in metres."""
_Formulas = tuple[tuple[Expression, int], ...]
"""The expression of each coordinate, and its decimal places."""
_VALUES_MAX = 1_000_000
"""In teams whose variables have more values in total, only variables of waypoints have places."""
_PLACES = 6
"""The decimal places of coordinates; further decimals are rounding errors."""


class MapPlaces:
    """The places that values represent.

    Args:
        team: The team.
        ground: The map of the team. Without a map, or with a map without a scale, values have no places.
    """

    def __init__(self, team: Team, ground: GroundMap | None) -> None:
        self._scale = ground.scale if ground else None
        self._formulas: dict[str, tuple[str, _Formulas]] = {}
        if ground is None or self._scale is None:
            return
        for robot in team.robots:
            self._formulas.update(_waypoints(robot, has_height=ground.volume is not None))
        self._formulas |= dict(self._later_visits(team))

    def places_of(self, assignment: Mapping[str, int]) -> dict[str, Place]:
        """Return the place of each variable whose value represents a place, in the order of `assignment`."""
        found = {}
        for name, value in assignment.items():
            if name in self._formulas and self._scale is not None:
                variable, formulas = self._formulas[name]
                cell = [coordinate(one, places, {variable: value}) for one, places in formulas]
                known = [round(part * self._scale, _PLACES) + 0.0 for part in cell if part is not None]
                if len(known) == len(cell):
                    found[name] = tuple(known)
        return found

    def _later_visits(self, team: Team) -> Iterator[tuple[str, tuple[str, _Formulas]]]:
        """Yield other variables of robots with one waypoint, and its formulas, if the variables' values are places."""
        domains = {name: variable.domain for name, variable in team.variables.items()}
        if sum(map(len, domains.values())) > _VALUES_MAX:
            return
        known = {value for name in self._formulas for value in domains[name]}
        for robot in team.robots:
            own = [variable.name for variable in robot.variables]
            found = [self._formulas[name] for name in own if name in self._formulas]
            found = [one for one in found if not _has_cases(one[1])]  # cases are about one task
            for name in own if len(found) == 1 else ():
                if name not in self._formulas and known.issuperset(domains[name]):
                    yield name, found[0]


def _waypoints(robot: Robot, *, has_height: bool) -> Iterator[tuple[str, tuple[str, _Formulas]]]:
    """Yield each variable of a robot that alone determines a waypoint, with the formulas of the waypoint."""
    own = {variable.name for variable in robot.variables}
    for topic in robot.topics:
        given = (topic.x, topic.y, topic.z)[: 3 if has_height else 2]
        formulas = tuple((part, topic.places) for part in given if part is not None)
        over = {name for part, _ in formulas for name in names(part)}
        if len(formulas) == (3 if has_height else 2) and len(over) == 1 and over <= own:
            (name,) = over
            yield name, (name, formulas)


def _has_cases(formulas: _Formulas) -> bool:
    """Return whether formulas distinguish cases, and are thus about the values of their own variable only."""
    return any(_is_conditional(part) for part, _ in formulas)


def _is_conditional(formula: Expression) -> bool:
    return isinstance(formula, Apply) and (formula.operator == "if" or any(map(_is_conditional, formula.arguments)))
