"""3D N^2 queens: n x n robots, one a cell, each choosing its level so that no two attack each other.

Paper, Section 5.1, and Allison, Yee and McGaughey, TR 89/130 (1989). Two models:

* `planar`, what the XML of Figure 2 says: robots of a row or a column take different levels and stand on no
  diagonal; robots on a diagonal of the board (|di| = |dj|) take different levels.
* `full` adds the space diagonals (|di| = |dj| = |dk| attacks too): Allison's queen, which moves in 26 directions.

The constraint C3 printed in the paper contradicts its own Figure 2 and is neither.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

from robochoc.expression import Constant, Name, Type, parse
from robochoc.formats import PREDEFINED
from robochoc.problem import Child, Constraint, Domain, Parent, Predicate, Robot, Team, Topic, Variable

LARGEST_N = 64
"""4,096 robots; beyond that a folder of files is no longer a sensible form."""

Cell = tuple[int, int]
"""Row and column, from 1."""


class QueensModel(StrEnum):
    """Whose queen it is: Figure 2's, or Allison's."""

    PLANAR = "planar"
    FULL = "full"


NOT_ATTACKING = Predicate(
    "p1",
    ("X", "Y", "i", "j"),
    parse("and(neq(X, Y), neq(abs(minus(X, Y)), abs(minus(i, j))))", ("X", "Y", "i", "j"), Type.BOOLEAN),
)
"""Figure 2's p1: levels X and Y differ, and are no diagonal at the distance |i - j|."""


def queens3d(n: int, model: QueensModel | str = QueensModel.PLANAR) -> Team:
    """The team for an n x n x n cube, in lexicographic priority order.

    Raises `ValueError` unless 1 <= n <= `LARGEST_N` and the model is known.
    """
    if not 1 <= n <= LARGEST_N:
        raise ValueError(f"n is {n}; it must be from 1 to {LARGEST_N}")
    model = QueensModel(model)
    levels = Domain("D1", (range(1, n + 1),))
    cells = [(row, column) for row in range(1, n + 1) for column in range(1, n + 1)]
    robots = tuple(_robot(cell, n, levels, model) for cell in cells)
    return Team(f"queens3d-{n}", robots)


def _robot(cell: Cell, n: int, levels: Domain, model: QueensModel) -> Robot:
    row, column = cell
    near = list(_attackable(cell, n))
    topic = Topic(
        f"/drone{row}.{column}/waypoint{row}.{column}", x=Constant(row), y=Constant(column), z=Name(_variable(cell))
    )
    return Robot(
        name=_robot_name(cell),
        variables=(Variable(_variable(cell), levels),),
        parents=tuple(Parent(_robot_name(other), (_apart(other, cell, model),)) for other in near if other < cell),
        children=tuple(Child(_robot_name(other), (_variable(cell),)) for other in near if other > cell),
        topics=(topic,),
    )


def _attackable(cell: Cell, n: int) -> Iterator[Cell]:
    """Cells that share a line of the board with `cell`: its column, its row, its diagonals (Figure 2's order)."""
    row, column = cell
    yield from ((i, column) for i in range(1, n + 1) if i != row)
    yield from ((row, j) for j in range(1, n + 1) if j != column)
    for i in range(1, n + 1):
        for j in range(1, n + 1):
            if i != row and abs(i - row) == abs(j - column):
                yield i, j


def _apart(parent: Cell, child: Cell, model: QueensModel) -> Constraint:
    """What two robots owe each other; p1's i and j are the coordinates in which the cells differ."""
    names = (_variable(parent), _variable(child))
    diagonal = parent[0] != child[0] and parent[1] != child[1]
    if diagonal and model is QueensModel.PLANAR:
        return Constraint("C5", PREDEFINED["neq"], names, names)
    axis = 1 if parent[0] == child[0] else 0
    terms = (*names, parent[axis], child[axis])
    return Constraint("C5", NOT_ATTACKING, terms, terms)


def _robot_name(cell: Cell) -> str:
    return f"Robot{cell[0]}.{cell[1]}"


def _variable(cell: Cell) -> str:
    return f"V{cell[0]}.{cell[1]}"
