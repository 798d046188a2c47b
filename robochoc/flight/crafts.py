"""Crafts: one drone per robot, or one per place for a robot that decides about several places.

A craft's cell and level are derived from the first applicable source: the coordinates of its topic under the
assignment; the two numbers at the end of its name (`Robot3.1`, `V3.1`), with its first value as the level; its first
value alone. Coordinates over real variables are not whole numbers: such a craft is not bound to cells.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from itertools import product, zip_longest
from math import prod

from robochoc.model.expression import names
from robochoc.model.problem import Assignment, Domain, Robot, Topic, Variable
from robochoc.model.waypoints import position, value_as_coordinate
from robochoc.system.lazy_dataclass import dataclass

Cell = tuple[float, float]
"""Row and column, or the x and y of a topic. They are integers, unless they depend on real variables."""

# Longer numbers are dates or serial numbers, not rows or columns.
_ROW_AND_COLUMN = re.compile(r"(?<![0-9])([0-9]{1,4})[._,:;-]([0-9]{1,4})$")

_DECISIONS_MAX = 1_000
"""The possible places of a robot with more decisions are not listed."""


@dataclass(frozen=True)
class Craft:
    """A drone without a place in the layout yet. It flies if it has a level."""

    name: str
    cell: Cell | None = None
    level: float | None = None
    robot: str = ""
    """The robot that decides about the craft; empty if only a variable is known."""
    topic: Topic | None = None
    """The topic of its waypoints, if its file has one."""
    decided_by: tuple[str, ...] = field(default=(), compare=False)
    """The variables on which its place depends."""

    @property
    def is_exact(self) -> bool:
        """True if its place depends on real variables, and must not be moved to a cell."""
        return bool(self.topic and self.topic.places)


def row_and_column(name: str) -> Cell | None:
    """Return the row and the column at the end of a name such as `Robot3.1`."""
    found = _ROW_AND_COLUMN.search(name)
    return (int(found[1]), int(found[2])) if found else None


def craft_of_variable(variable: str, values: Assignment) -> Craft:
    """Return the craft of `variable`, whose robot is not known."""
    return _craft(variable, [Variable(variable, Domain("", ()))], None, values)


def crafts_of(robot: Robot, values: Assignment) -> list[Craft]:
    """Return one craft per topic with coordinates, else one per variable that names a cell, else one for the robot."""
    own = robot.variables
    topics = [topic for topic in robot.topics if topic.x is not None and topic.y is not None]
    if len(topics) > 1:
        named = zip(_short_names(topics), topics, strict=True)
        crafts = [_craft(name, own, topic, values) for name, topic in named]
    elif not topics and len(own) > 1 and all(row_and_column(one.name) for one in own):
        topics = [topic for topic in robot.topics[: len(own)] if len(robot.topics) == len(own)]
        crafts = [_craft(one.name, [one], topic, values) for one, topic in zip_longest(own, topics)]
    else:
        topics = topics or [*robot.topics[:1]]
        crafts = [_craft(robot.name, own, topics[0] if topics else None, values)]
    return [replace(craft, robot=robot.name) for craft in crafts]


def possible_crafts(robot: Robot) -> Iterator[Craft]:
    """Yield the crafts of `robot` for all possible decisions; nothing if there are too many."""
    if 0 < prod(len(own.domain) for own in robot.variables) <= _DECISIONS_MAX:
        names = [own.name for own in robot.variables]
        for decided in product(*(own.domain for own in robot.variables)):
            yield from crafts_of(robot, dict(zip(names, decided, strict=True)))


def _craft(name: str, variables: Sequence[Variable], topic: Topic | None, values: Assignment) -> Craft:
    """Return the craft `name`. Its cell is from its topic, else from its name, or the name of its first variable."""
    x, y, height = position(topic, values) if topic else (None, None, None)
    named = (row_and_column(one) for one in (name, *(one.name for one in variables[:1])))
    cells = [None if x is None or y is None else (x, y), *named]
    level = value_as_coordinate(variables, values)
    if level is not None and height is not None:
        level = height
    decided_by = _decided_by(topic, variables)
    return Craft(name, next(filter(None, cells), None), level, topic=topic, decided_by=decided_by)


def _decided_by(topic: Topic | None, variables: Sequence[Variable]) -> tuple[str, ...]:
    """Return the variables in the coordinates of `topic`, and the variable of the level if the topic has no z."""
    across = [topic.x, topic.y] if topic else []
    height = topic.z if topic else None
    given = [*(across if None not in across else []), height]
    found = [name for expression in given if expression is not None for name in names(expression)]
    return tuple(dict.fromkeys([*found, *(one.name for one in variables[:1] if height is None)]))


def _short_names(topics: Sequence[Topic]) -> list[str]:
    """Return short names such as `drone3.1` for `/drone3.1/waypoint3.1`; the whole topics if these are not unique."""
    first = [topic.name.strip("/").partition("/")[0] for topic in topics]
    return first if len(set(first)) == len(topics) else [topic.name for topic in topics]
