"""A robot's local problem as protocols see it: one compiled variable, and the constraints it has to check.

Paper, Section 4.1: every robot is one variable to a protocol. Its values are the robot's local solutions, seen from
the interface variables that neighbours know (`solver/domain.py`); the constraints it checks are those shared with
its parents (`solver/shared.py`).

Constraint checks are counted here, and only here: one check is one evaluation of one shared constraint for one
value of the own domain (Meisels, Kaplansky, Razgon and Zivan 2002). Private constraints are settled once, when
the domain is compiled, and are not counted; nor are look-ups of nogoods.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from robochoc.message import Value
from robochoc.problem import Robot, Team
from robochoc.solver.domain import CompiledDomain, compiled_domain
from robochoc.solver.shared import Conflict, OwnValues, SharedConstraint, in_order_of_lowest

if TYPE_CHECKING:
    from robochoc.solver.conflict_table import ConflictTable

LARGE = 64
"""From so many values on, conflicts are looked up for all of them at once, in numpy."""

Interfaces = Mapping[str, tuple[str, ...]]
"""The variables that each robot shows to its neighbours, by the robot's name."""


class LocalProblem:
    """What one robot knows: its compiled domain, its neighbours, and the constraints it has to check.

    `values[i]` is the i-th value as neighbours see it; `solution(i)` are the own variables' values behind it.
    `parents` and `children` are in priority order. `checks` counts constraint checks so far. Raises `Unsupported`
    when the robot has private constraints among its variables and comes without its compiled `domain`.
    """

    def __init__(
        self, robot: Robot, order: Sequence[str], interfaces: Interfaces, domain: CompiledDomain | None = None
    ) -> None:
        rank = {name: place for place, name in enumerate(order)}
        self.agent = robot.name
        self.parents = tuple(sorted((parent.name for parent in robot.parents), key=rank.__getitem__))
        self.children = tuple(sorted((child.name for child in robot.children), key=rank.__getitem__))
        self._domain = compiled_domain(robot) if domain is None else domain
        self.values: tuple[Value, ...] = self._domain.values
        self.checks = 0
        own = OwnValues(robot.interface, self._domain.values)
        shared = (SharedConstraint(constraint, robot, rank, interfaces) for constraint in robot.shared)
        self._constraints = in_order_of_lowest(shared, rank)
        for constraint in self._constraints:
            constraint.compile(own)
        self._table: ConflictTable | None = self._looked_up() if len(self.values) >= LARGE else None

    def solution(self, index: int) -> dict[str, int]:
        """Values of all own variables when the compiled variable takes `values[index]`."""
        return dict(zip(self._domain.variables, self._domain.solutions[index], strict=True))

    def conflict(self, index: int, view: Mapping[str, Value]) -> Conflict | None:
        """Why `values[index]` is against `view`: what the first constraint that it breaks sees, or None.

        Constraints whose other variables are not all known in `view` are passed over. The order is that of their
        lowest robot, the highest first, so the first conflict is also the one with the highest possible lowest
        variable. Of each robot only what the constraint looks at is named (`None` elsewhere).
        """
        if self._table is not None:
            checks, conflict = self._table.look(index, view)
            self.checks += checks
            return conflict
        for constraint in self._constraints:
            others = constraint.others(view)
            if others is None:
                continue
            self.checks += 1
            if not constraint.mask(others) >> index & 1:
                return constraint.conflict(others)
        return None

    def alike(self, value: Value) -> Sequence[int]:
        """The places of all own values that agree with `value` wherever that is not None.

        They are interchangeable to whoever looks at nothing else: neighbourhood partial interchangeability
        (Burke and Brown, "Applying interchangeability to complex local problems in distributed constraint
        reasoning", AAMAS workshop DCR 2006).
        """
        wanted = [(place, part) for place, part in enumerate(value) if part is not None]
        return [index for index, own in enumerate(self.values) if all(own[place] == part for place, part in wanted)]

    def _looked_up(self) -> ConflictTable:
        from robochoc.solver.conflict_table import ConflictTable  # noqa: PLC0415 - numpy is for large domains only

        return ConflictTable(self._constraints, len(self.values))


def interfaces(team: Team) -> dict[str, tuple[str, ...]]:
    """What every robot of `team` shows to its neighbours."""
    return {robot.name: robot.interface for robot in team.robots}
