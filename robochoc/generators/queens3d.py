"""3D N^2 queens: n x n robots, one per cell, each choosing its level so that no two attack each other.

Paper, Section 5.1, and Allison, Yee and McGaughey, TR 89/130 (1989). There are two models:

* `planar`, as in the XML of Figure 2: robots in a row or a column have different levels that are not on a diagonal;
  robots on a diagonal of the board (|di| = |dj|) have different levels.
* `full` adds the space diagonals (|di| = |dj| = |dk| is also an attack) for Allison's queen, with 26 directions.

The constraint C3 printed in the paper contradicts Figure 2, and is not used in either model.

The team has a robot for every cell, as in the paper, or one for every row. The latter is a complex agent that flies n
drones, with private constraints within the row.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import assert_never

from robochoc.formats import PREDEFINED
from robochoc.model.expression import Constant, Name, Type, parse
from robochoc.model.problem import Child, Constraint, Domain, Parent, Predicate, Robot, Team, Topic, Variable
from robochoc.system.suggestions import member

MAX_N = 49
"""2,401 robots with 191,296 constraints: the largest team within `draws.MAX_CONSTRAINTS`, as for other families."""

Cell = tuple[int, int]
"""Row and column, from 1."""


class QueensModel(StrEnum):
    """The directions in which a queen attacks: as in Figure 2, or as Allison's queen."""

    PLANAR = "planar"
    FULL = "full"


class QueensRobots(StrEnum):
    """The distribution of drones over robots: one robot for each cell, or one for each row."""

    CELLS = "cells"
    ROWS = "rows"


NOT_ATTACKING = Predicate(
    "p1",
    ("X", "Y", "i", "j"),
    parse("and(neq(X, Y), neq(abs(minus(X, Y)), abs(minus(i, j))))", ("X", "Y", "i", "j"), Type.BOOLEAN),
)
"""The predicate p1 in Figure 2: levels X and Y differ, and are not on a diagonal at the distance |i - j|."""


def queens3d(
    n: int, model: QueensModel | str = QueensModel.PLANAR, robots: QueensRobots | str = QueensRobots.CELLS
) -> Team:
    """Return the team for an n x n x n cube, in lexicographic priority order.

    Args:
        n: The size of the cube, at most `MAX_N`.
        model: The directions in which a queen attacks: as in Figure 2 (`planar`), or also along space diagonals
            (`full`).
        robots: The distribution of drones over robots: one robot for each cell (`cells`), or one for each row (`rows`).

    Raises:
        ValueError: `n` is not from 1 to `MAX_N`, or `model` or `robots` is unknown.

    Example:
        >>> from robochoc.generators.queens3d import queens3d
        >>> len(queens3d(4).robots)
        16
    """
    if not 1 <= n <= MAX_N:
        raise ValueError(f"n is {n}; it must be from 1 to {MAX_N}")
    model = member(QueensModel, "model", model)
    robots = member(QueensRobots, "robots", robots)
    levels = Domain("D1", (range(1, n + 1),))
    numbers = range(1, n + 1)
    match robots:
        case QueensRobots.CELLS:
            crews = {_robot_name(cell): [cell] for cell in itertools.product(numbers, numbers)}
        case QueensRobots.ROWS:
            crews = {f"Robot{row}": [(row, column) for column in numbers] for row in numbers}
        case never:
            assert_never(never)
    flown_by = {cell: name for name, cells in crews.items() for cell in cells}
    suffix = "" if robots == QueensRobots.CELLS else f"-{robots}"
    team = (_robot(name, cells, flown_by, levels, model) for name, cells in crews.items())
    return Team(f"queens3d-{n}{suffix}", tuple(team))


def _robot(name: str, cells: Sequence[Cell], flown_by: Mapping[Cell, str], levels: Domain, model: QueensModel) -> Robot:
    """Return the robot that flies the drones of `cells`, with their constraints."""
    n = len(levels)
    private, above, below = [], dict[str, list[Constraint]](), dict[str, list[str]]()
    for cell in cells:
        for other in _attackable(cell, n):
            owner = flown_by[other]
            if owner == name:
                if other < cell:
                    private.append(replace(_apart(other, cell, model), model=None))
            elif other < cell:
                above.setdefault(owner, []).append(_apart(other, cell, model))
            elif _variable(cell) not in below.setdefault(owner, []):
                below[owner].append(_variable(cell))
    return Robot(
        name=name,
        variables=tuple(Variable(_variable(cell), levels) for cell in cells),
        private=tuple(private),
        parents=tuple(Parent(owner, tuple(shared)) for owner, shared in above.items()),
        children=tuple(Child(owner, tuple(seen)) for owner, seen in below.items()),
        topics=tuple(_topic(cell) for cell in cells),
    )


def _topic(cell: Cell) -> Topic:
    row, column = cell
    name = f"/drone{row}.{column}/waypoint{row}.{column}"
    return Topic(name, x=Constant(row), y=Constant(column), z=Name(_variable(cell)))


def _attackable(cell: Cell, n: int) -> Iterator[Cell]:
    """Yield the cells in the same column, row or diagonal of the board as `cell`, in the order of Figure 2."""
    row, column = cell
    yield from ((i, column) for i in range(1, n + 1) if i != row)
    yield from ((row, j) for j in range(1, n + 1) if j != column)
    for i in range(1, n + 1):
        for j in range(1, n + 1):
            if i != row and abs(i - row) == abs(j - column):
                yield i, j


def _apart(parent: Cell, child: Cell, model: QueensModel) -> Constraint:
    """Return the constraint between two cells. In p1, i and j are the coordinates in which the cells differ."""
    names = (_variable(parent), _variable(child))
    diagonal = parent[0] != child[0] and parent[1] != child[1]
    if diagonal and model == QueensModel.PLANAR:
        return Constraint("C5", PREDEFINED["neq"], names, names)
    axis = 1 if parent[0] == child[0] else 0
    terms = (*names, parent[axis], child[axis])
    return Constraint("C5", NOT_ATTACKING, terms, terms)


def _robot_name(cell: Cell) -> str:
    return f"Robot{cell[0]}.{cell[1]}"


def _variable(cell: Cell) -> str:
    return f"V{cell[0]}.{cell[1]}"
