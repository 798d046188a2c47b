"""Points: the values of a robot anywhere in the intervals of its real variables, for continuous protocols.

A position has a coordinate for each variable of the robot: steps of the precision above the lower end of a real
interval, or the index in another domain. A robot that may only choose values on grids has one coordinate, the index of
its value. Costs are computed for rounded coordinates only, so they are exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from robochoc.model.problem import Value
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import Cost, cost_function

Position = Sequence[float]
"""A coordinate for each axis. Coordinates need not be integers."""


class Point(NamedTuple):
    """A choice of a robot.

    Attributes:
        value: The values of the interface variables.
        solution: The values of all variables, in their order.
        charges: The private costs.
        place: The index of the value in `LocalProblem.values`. None: the point may be between these values.
    """

    value: Value
    solution: tuple[int, ...]
    charges: tuple[Cost, ...]
    place: int | None = None


class Points:
    """The positions of a robot.

    Attributes:
        is_real: True if the robot may choose any step of real variables.
        highest: The highest coordinate on each axis; the lowest is 0.
        nearby: The distance of neighbouring values on each axis: 1 in an interval; any two other values are neighbours.
    """

    def __init__(self, part: AgentProblem, values: Sequence[Value], charges: Sequence[Cost]) -> None:
        robot = part.robot
        self.is_real = any(one.domain.real and one.domain.real.any_step for one in robot.variables)
        self._values = values
        self._charges = charges
        self._solutions = part.domain.solutions
        self._axes: list[Sequence[int]] = []
        self._prices = []
        if self.is_real:
            names = [one.name for one in robot.variables]
            possible = [one.domain.possible for one in robot.variables]
            self._axes = [one if isinstance(one, range) else tuple(one) for one in possible]
            self._shown = [names.index(name) for name in robot.interface]
            self._prices = [cost_function(constraint, names) for constraint in robot.private]
        self.highest = tuple([len(axis) - 1 for axis in self._axes or [range(len(values) or 1)]])
        is_interval = [isinstance(axis, range) for axis in self._axes] or [False]
        self.nearby = tuple([1 if one else most for one, most in zip(is_interval, self.highest, strict=True)])

    def nearest(self, position: Position) -> Point:
        """Return the point whose coordinates are the rounded ones of `position`."""
        places = [min(max(round(one), 0), most) for one, most in zip(position, self.highest, strict=True)]
        if not self.is_real:
            (place,) = places
            solution = self._solutions[place] if place < len(self._solutions) else ()  # the last one may be withdrawal
            return Point(self._values[place], solution, (self._charges[place],), place)
        solution = tuple([axis[place] for axis, place in zip(self._axes, places, strict=True)])
        charges = tuple([price(solution) for price in self._prices])
        return Point(tuple([solution[place] for place in self._shown]), solution, charges)

    def position(self, place: int) -> Position:
        """Return the position of the value at the index `place` of `LocalProblem.values`."""
        if not self.is_real:
            return (place,)
        return [axis.index(one) for axis, one in zip(self._axes, self._solutions[place], strict=True)]
