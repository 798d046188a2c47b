"""The waypoints of a list's robots: formulas for the place to which a robot goes first, given its tasks.

A robot without tasks stays at its position, and so does a robot whose tasks have no position. Coordinates are integers
in a unit that divides all coordinates of the list; `map.json` has its length.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import Topic
from robochoc.tasks.entries import Point

Cells = tuple[int, ...]
"""A place, in units."""


def unit_of(points: Iterable[Point]) -> Fraction:
    """Return the length of a unit: 1 if all coordinates are integers, else the largest that divides them all."""
    parts = [part for point in points for part in point]
    below = math.lcm(*(part.denominator for part in parts))
    return Fraction(1) if below == 1 else Fraction(math.gcd(*(int(part * below) for part in parts)), below)


def in_units(point: Point, unit: Fraction) -> Cells:
    """Convert a place to units."""
    return tuple(int(part / unit) for part in point)


def waypoint_topic(name: str, formulas: Sequence[Expression]) -> Topic:
    """Return the topic for a place in the plane, at the height 0, or in space."""
    x, y, *z = formulas
    return Topic(name, x=x, y=y, z=z[0] if z else Constant(0))


def of_choice(variable: str, places: Mapping[int, Cells], home: Cells) -> tuple[Expression, ...]:
    """Return the formulas of the place of the chosen task, for a symbolic variable.

    Args:
        variable: The variable.
        places: The place of each task with a position, by value.
        home: The place of a robot with another value.
    """

    def tree(values: Sequence[int], axis: int) -> Expression:
        if len(values) == 1:
            return Constant(places[values[0]][axis])
        half = len(values) // 2
        return Apply("if", (_is_one_of(variable, values[:half]), tree(values[:half], axis), tree(values[half:], axis)))

    away = sorted(places, key=lambda value: places[value])
    if not away:
        return tuple(map(Constant, home))
    return tuple(
        Apply("if", (_is_one_of(variable, away), tree(away, axis), Constant(home[axis]))) for axis in range(len(home))
    )


def of_nearest(places: Sequence[tuple[str, Cells]], home: Cells) -> tuple[Expression, ...]:
    """Return the formulas of the place of the first task that is done.

    Args:
        places: The variables that are 1 if their tasks are done, with the places of these tasks, the nearest first.
        home: The place of a robot without such a task.
    """

    def tree(some: Sequence[tuple[str, Cells]], axis: int) -> Expression:
        if len(some) == 1:
            return Constant(some[0][1][axis])
        half = len(some) // 2
        return Apply("if", (_is_any_done(some[:half]), tree(some[:half], axis), tree(some[half:], axis)))

    if not places:
        return tuple(map(Constant, home))
    return tuple(
        Apply("if", (_is_any_done(places), tree(places, axis), Constant(home[axis]))) for axis in range(len(home))
    )


def of_tours(variable: str, first: Sequence[Cells], dimensions: int) -> tuple[Expression, ...]:
    """Return the formulas of the first place of a tour.

    Args:
        variable: The variable with the number of the tour.
        first: The first place of each tour, by number.
        dimensions: The number of coordinates.
    """

    def tree(parts: Sequence[tuple[int, int]]) -> Expression:
        """Return the formula for the parts of the numbers, each with its first number, and its coordinate."""
        if len(parts) == 1:
            return Constant(parts[0][1])
        half = len(parts) // 2
        before = Apply("lt", (Name(variable), Constant(parts[half][0])))
        return Apply("if", (before, tree(parts[:half]), tree(parts[half:])))

    found = []
    for axis in range(dimensions):
        numbered = [(number, place[axis]) for number, place in enumerate(first)]
        found.append(tree([one for one in numbered if one[0] == 0 or one[1] != numbered[one[0] - 1][1]]))
    return tuple(found)


def _is_one_of(variable: str, values: Sequence[int]) -> Expression:
    members = tuple(map(Constant, values))
    return Apply("eq" if len(values) == 1 else "in", (Name(variable), *members))


def _is_any_done(some: Sequence[tuple[str, Cells]]) -> Expression:
    terms: tuple[Expression, ...] = tuple(Name(name) for name, _ in some)
    return Apply("gt", (terms[0] if len(terms) == 1 else Apply("add", terms), Constant(0)))
