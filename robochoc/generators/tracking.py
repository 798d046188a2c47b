"""Target tracking by mobile sensors: robots choose their cells so that they cover targets.

This is one step of DCOP_MST: Zivan, Yedidsion, Okamoto, Glinton and Sycara, "Distributed constraint optimization for
teams of mobile sensing agents", JAAMAS 29 (2015); first in Zivan, Glinton and Sycara, "Distributed constraint
optimization for large teams of mobile sensing agents", IAT 2009. A robot's variable is its cell in the field, within
its mobility. A target has a coverage requirement; each robot within the sensing range covers an amount equal to its
credibility. The sum of the uncovered remainders is minimised; each target has one cost function over all robots that
can get near enough.

Cells are numbered row by row from 0; distances between cells are Euclidean.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import prod
from random import Random

from robochoc.generators.draws import MAX_AGENTS, check_bounds, limited, random_integer, sample, seeded
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Constant, Expression, Name, total
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Team, Variable
from robochoc.system.lazy_dataclass import dataclass

MAX_SIDE = 100
MAX_REQUIREMENT = 1000
MAX_CELLS = 1_000_000
"""The maximum number of cells that robots can reach, summed over all robots."""
MAX_COMBINATIONS = 1_000_000
"""The maximum number of combinations of cells of the robots near a target."""


@dataclass(frozen=True)
class Field:
    """The robots and the targets in the field.

    Attributes:
        side: The number of rows, and of columns.
        starts: The initial cell of each robot.
        credibility: The amount of coverage by each robot.
        targets: The cell of each target.
        mobility: The maximum distance that robots can travel, in cells.
        sensing: The distance at which robots see targets, in cells.
    """

    side: int
    starts: list[int]
    credibility: list[int]
    targets: list[int]
    mobility: int
    sensing: int

    def near(self, one: int, other: int, distance: int) -> bool:
        """Return whether two cells are at most `distance` apart."""
        (i, j), (k, m) = divmod(one, self.side), divmod(other, self.side)
        return (i - k) ** 2 + (j - m) ** 2 <= distance**2

    def cells(self, robot: int) -> list[int]:
        """Return the cells that a robot can reach."""
        start, side, reach = self.starts[robot], self.side, self.mobility
        rows, columns = (range(max(0, at - reach), min(side, at + reach + 1)) for at in divmod(start, side))
        return [
            row * side + column for row in rows for column in columns if self.near(row * side + column, start, reach)
        ]


def tracking(
    agents: int,
    targets: int,
    side: int,
    seed: int = 0,
    *,
    mobility: int = 1,
    sensing: int = 2,
    requirement: int = 100,
    credibility: int = 30,
) -> Team:
    """Return a random problem of tracking `targets` in a field of side x side cells.

    `Robot3` owns `V3`. All robots start in different cells, and all targets are in different cells.

    Args:
        agents: The number of robots.
        targets: The number of targets.
        side: The number of rows and columns of the field.
        seed: The same seed gives the same problem on every machine.
        mobility: The maximum distance that a robot can travel, in cells.
        sensing: The distance at which a robot sees a target, in cells.
        requirement: The required coverage of each target.
        credibility: The maximum coverage by a robot; its coverage is uniformly random from 1 to this value.

    Raises:
        ValueError: A number is out of bounds, or too many robots can get near one target.
    """
    check_bounds({"side": (side, 1, MAX_SIDE), "agents": (agents, 1, min(MAX_AGENTS, side**2))})
    check_bounds({"targets": (targets, 1, side**2), "mobility": (mobility, 0, side), "sensing": (sensing, 0, side)})
    check_bounds({"requirement": (requirement, 1, MAX_REQUIREMENT), "credibility": (credibility, 1, MAX_REQUIREMENT)})
    field = drawn_field(seeded(seed), (agents, targets, side), credibility, mobility, sensing)
    reached = min(side, 2 * mobility + 1) ** 2
    if agents * reached > MAX_CELLS:
        raise ValueError(
            f"{agents:,} robots can go to {reached:,} cells each, more than {MAX_CELLS:,} together;"
            " use fewer robots, a smaller side, or less mobility"
        )
    cells = [field.cells(robot) for robot in range(agents)]
    lost = 0
    constraints = []
    for number, target in enumerate(field.targets, 1):
        within = [robot for robot in range(agents) if field.near(field.starts[robot], target, mobility + sensing)]
        near = [robot for robot in within if any(field.near(cell, target, sensing) for cell in cells[robot])]
        if prod(len(cells[robot]) for robot in near) > MAX_COMBINATIONS:
            raise ValueError(
                f"{len(near)} robots can get near target {number}, in more than {MAX_COMBINATIONS:,} ways;"
                " use fewer robots, a larger side, or less mobility or sensing"
            )
        if near:
            constraints.append(_uncovered(number, field, near, requirement))
        else:
            lost += requirement
    numbers = f"{mobility}-{sensing}-{requirement}-{credibility}"
    return assemble(
        f"tracking-{agents}-{targets}-{side}x{side}-{numbers}-{seed}",
        {
            f"Robot{robot + 1}": [Variable(f"V{robot + 1}", Domain(f"Cells{robot + 1}", tuple(_ranges(one))))]
            for robot, one in enumerate(cells)
        },
        limited(constraints),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(constant=lost),
    )


def drawn_field(chance: Random, numbers: tuple[int, int, int], credibility: int, mobility: int, sensing: int) -> Field:
    """Return a random field; `numbers` are the numbers of robots, targets and rows."""
    agents, targets, side = numbers
    starts = sample(chance, side**2, agents)
    credible = [random_integer(chance, 1, credibility) for _ in range(agents)]
    return Field(side, starts, credible, sample(chance, side**2, targets), mobility, sensing)


def _uncovered(number: int, field: Field, near: list[int], requirement: int) -> Constraint:
    """Return the uncovered remainder of a target's requirement, as a function of the cells of the robots `near`."""
    row, column = divmod(field.targets[number - 1], field.side)
    covered = (
        Apply("if", (_sees(Name(f"X{robot + 1}"), row, column, field), Constant(field.credibility[robot]), Constant(0)))
        for robot in near
    )
    body = Apply("max", (Constant(0), Apply("sub", (Constant(requirement), total(covered)))))
    scope = tuple(f"V{robot + 1}" for robot in near)
    function = Function(f"uncovered{number}", tuple(f"X{robot + 1}" for robot in near), body)
    return Constraint(f"Target{number}", function, scope, scope)


def _sees(cell: Expression, row: int, column: int, field: Field) -> Expression:
    """Return the condition that `cell` is within the sensing range of the cell in `row` and `column`."""
    side = Constant(field.side)
    away = [Apply("sub", (Apply(name, (cell, side)), Constant(at))) for name, at in (("div", row), ("mod", column))]
    squares = Apply("add", tuple(Apply("mul", (one, one)) for one in away))
    return Apply("le", (squares, Constant(field.sensing**2)))


def _ranges(cells: list[int]) -> Iterator[range]:
    return (range(cell, cell + 1) for cell in cells)
