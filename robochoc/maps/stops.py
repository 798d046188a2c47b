"""The stops of a robot that does tasks at several places: in `map.json`, since a topic has one place."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import msgspec

FAR = 10**15
"""The largest coordinate of a stop, in units."""
_Units = Annotated[int, msgspec.Meta(ge=-FAR, le=FAR)]
_Index = Annotated[int, msgspec.Meta(ge=0)]


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A place to which a robot goes if it does a task.

    Attributes:
        variable: The variable that is `value` if the robot does the task.
        value: The value.
        at: The x, y and z of the place, in units of topics.
    """

    variable: str
    at: tuple[_Units, _Units, _Units]
    value: int = 1


class RobotStops(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The stops of one robot.

    Attributes:
        stops: All possible stops; without tours, in the order of the robot's way.
        tour: The variable with the number of the tour; empty: there are no tours.
        orders: The indices of the stops of each tour, by its number.
    """

    stops: tuple[Stop, ...]
    tour: str = ""
    orders: tuple[tuple[_Index, ...], ...] = ()

    def of(self, assignment: Mapping[str, int]) -> list[Stop]:
        """Return the stops in the order of the robot's way; empty if the assignment has none."""
        if not self.tour:
            return [one for one in self.stops if assignment.get(one.variable) == one.value]
        number = assignment.get(self.tour, 0)
        order = self.orders[number] if 0 <= number < len(self.orders) else ()
        return [self.stops[index] for index in order if index < len(self.stops)]
