"""The contents of a robot's local problem: its values, and its constraints compiled for them (see `compiled.py`).

Constraints are sorted by their lowest robot, so that those with the robots above a place in the order come first. Each
is looked up in one place, and its check is counted there.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from robochoc.model.message import Value
from robochoc.model.problem import INFINITE, ConstraintModel, WhenAbsent
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import Cost
from robochoc.solver.explanation import KeyedConstraint, held_above, held_below
from robochoc.solver.filters import Filters
from robochoc.solver.shared_constraint import (
    UNKNOWN,
    OtherValues,
    OwnValues,
    SharedConstraint,
    by_robot,
    sorted_by_lowest_agent,
)

if TYPE_CHECKING:
    from robochoc.solver.conflict_table import ConflictTable

MIN_TABLE_VALUES = 64
"""The number of values from which conflicts are looked up for all of them at once, in numpy."""


class LocalConstraints:
    """The compiled domain of one robot, and the constraints that it checks, the highest lowest robot first.

    The attributes are those of `LocalProblem`. `_depths` are the places of the constraints' lowest robots in the order.
    """

    def __init__(self, part: AgentProblem) -> None:
        robot = part.robot
        rank = part.known.rank
        self.agent = robot.name
        self.parents = tuple(sorted((parent.name for parent in robot.parents), key=rank.__getitem__))
        self.children = tuple(sorted((child.name for child in robot.children), key=rank.__getitem__))
        self._domain = part.domain
        self.values: tuple[Value, ...] = self._domain.values
        self.charges: tuple[Cost, ...] = self._domain.costs
        # Values must be distinct: a robot that shows nothing looks the same when withdrawn, which is never cheaper.
        if part.parameters.withdrawal_cost is not None and (robot.interface or not self.values):
            self.values = (*self.values, (None,) * len(robot.interface))
            must_stay = any(one.when_absent == WhenAbsent.FAIL for one in robot.private)
            aside = INFINITE if must_stay else part.parameters.withdrawal_cost * robot.weight
            self.charges = (*self.charges, aside)
        self.checks = 0
        self._places: dict[Value, int] | None = None
        self._rank = rank
        self._part = part
        self._set_constraints(part, OwnValues(robot.interface, self.values))

    def _set_constraints(self, part: AgentProblem, own: OwnValues) -> None:
        """Compile the constraints of `part` for the values `own`, and set all that depends on them."""
        robot, rank = part.robot, self._rank

        def ready(known: KeyedConstraint) -> SharedConstraint:
            constraint = SharedConstraint(known.key, known.constraint, part.known, self.agent)
            constraint.compile(own)
            return constraint

        above = [(known.constraint.model, ready(known)) for known in held_above(robot)]
        copies = [ready(known) for known in part.copies]
        below = [ready(known) for _, known in held_below(robot)]
        shared = [*(constraint for _, constraint in above), *copies, *below]
        if part.parameters.withdrawal_cost is not None:
            for constraint in shared:
                constraint.allow_absence()
        self._constraints = sorted_by_lowest_agent(shared, rank)
        self._depths = [rank[constraint.agents[-1]] if constraint.agents else -1 for constraint in self._constraints]
        met = {agent for constraint in shared for agent in constraint.agents}
        self.neighbours = tuple(sorted({*self.parents, *self.children, *met}, key=rank.__getitem__))
        self._table: ConflictTable | None = self._looked_up() if len(self.values) >= MIN_TABLE_VALUES else None
        self._below = by_robot(below)
        parts_above = [constraint for model, constraint in above if model == ConstraintModel.PKC]
        secretive = {*part.pkc_holders, *by_robot(parts_above)}
        self.pkc_parents = tuple(parent for parent in self.parents if parent in secretive)
        self._parts = by_robot([*parts_above, *below])
        self._filtering = by_robot([*copies, *below, *parts_above])
        self._made_filters: Filters | None = None

    def allow_undeclared(self) -> None:
        """From now on evaluate constraints for whatever values others have: some may have lost a value since."""
        for constraint in self._constraints:
            constraint.allow_undeclared()

    def declared_count(self, robot: str) -> int:
        """Return how many values `declared` returns; nothing is allocated."""
        domains, names = self._part.known.domains, self._part.known.interfaces[robot]
        return math.prod(len(domains[name]) for name in names) + self._may_look_withdrawn(names)

    def declared(self, robot: str) -> list[Value]:
        """Return all values that the files declare for `robot`; the last is withdrawal where robots may withdraw.

        It need not be able to take each: what its private constraints forbid is among them.
        """
        names = self._part.known.interfaces[robot]
        values: list[Value] = [*itertools.product(*(self._part.known.domains[name] for name in names))]
        return [*values, (None,) * len(names)] if self._may_look_withdrawn(names) else values

    def _may_look_withdrawn(self, names: Sequence[str]) -> bool:
        """Return whether withdrawal is a value of its own for a robot that shows `names`."""
        return self._part.parameters.withdrawal_cost is not None and bool(names)

    def _known(self, view: Mapping[str, Value]) -> list[tuple[SharedConstraint, OtherValues]]:
        """Return each constraint whose other variables are all known, and their values. Count a check each."""
        known = [(c, others) for c in self._constraints if (others := c.other_values(view)) is not None]
        self.checks += len(known)
        return known

    def _paid(self, view: Mapping[str, Value]) -> list[list[Cost]]:
        """Return what each own value pays for each constraint whose other variables are all known. Counts nothing."""
        return [prices for c in self._constraints if (prices := c.costs_in(view)) is not None]

    def _since(self, place: int) -> Sequence[SharedConstraint]:
        """Return the constraints whose lowest robot does not stand higher in the order than `place`."""
        return self._constraints if place < 0 else self._constraints[bisect_left(self._depths, place) :]

    def _broken(self, index: int, view: Mapping[str, Value], since: int) -> SharedConstraint | None:
        """Return the first constraint that `values[index]` breaks in `view`."""
        if self._table is not None:
            checks, broken = self._table.look(index, view, bisect_left(self._depths, since))
            self.checks += checks
            return broken
        for constraint in self._since(since):
            mask = constraint.look(view)
            if mask != UNKNOWN:
                self.checks += 1
                if not mask >> index & 1:
                    return constraint
        return None

    @property
    def _place_of(self) -> dict[Value, int]:
        if self._places is None:
            self._places = {value: index for index, value in enumerate(self.values)}
        return self._places

    @property
    def _filters(self) -> Filters:
        if self._made_filters is None:
            self._made_filters = Filters(self._part, self.values, self._filtering)
        return self._made_filters

    def _looked_up(self) -> ConflictTable:
        from robochoc.solver.conflict_table import ConflictTable  # noqa: PLC0415 - numpy is for large domains only

        return ConflictTable(self._constraints, len(self.values))
