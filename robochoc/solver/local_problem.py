"""A robot's local problem for protocols: one compiled variable, and the constraints that it checks.

Paper, Section 4.1: every robot is one variable to a protocol. Its values are the robot's local solutions, projected on
the interface variables that neighbours know (`solver/compiled_domain.py`). The robot checks the constraints shared with
its parents (`solver/shared_constraint.py`), and its parts of partially known constraints (PKC), also those with its
children.

Constraint checks are counted here, and only here (CompAPO adds checks of tables that others send): one check is one
evaluation of one shared constraint for one value of this robot (Meisels, Kaplansky, Razgon and Zivan 2002). Private
constraints, evaluated once when the domain is compiled, are not counted; look-ups of nogoods and filters are not
counted either.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from copy import copy, deepcopy
from typing import TYPE_CHECKING, NamedTuple

from robochoc.model.constraint import nameless
from robochoc.model.problem import INFINITE, ConstraintModel, ProblemKind, Value, WhenAbsent
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import Cost
from robochoc.solver.errors import TooLargeError
from robochoc.solver.explanation import KeyedConstraint, constraints_above, parts_below
from robochoc.solver.filters import Filters
from robochoc.solver.points import Point, Points
from robochoc.solver.shared_constraint import (
    UNKNOWN,
    Conflict,
    Gap,
    OtherValues,
    OwnValues,
    SharedConstraint,
    by_robot,
    refuse_large,
    sorted_by_lowest_agent,
)

if TYPE_CHECKING:
    from robochoc.solver.conflict_table import ConflictTable
    from robochoc.solver.constraint_arrays import ConstraintRows
    from robochoc.solver.cost_table import CostTable
    from robochoc.solver.exclusions import SharedTask

LexicographicCost = tuple[int, Cost]
"""The number of constraints that a value violates, and the cost of all other constraints. Pairs compare as tuples: a
violated constraint weighs more than any cost, and differences are never `inf - inf`."""


class Charged(NamedTuple):
    """The costs of this robot's values in one constraint.

    Attributes:
        number: The constraint's index in `LocalProblem`.
        others: The values of the other robots' variables.
        codes: A code for each own value; values that the constraint does not distinguish have the same code.
        costs: The cost of each own value.
    """

    number: int
    others: OtherValues
    codes: Sequence[int]
    costs: Sequence[Cost]


class TableScope(NamedTuple):
    """The axes of a constraint's table, before the table is made (`CostTable`).

    Attributes:
        agents: The other robots, in priority order.
        places: For each of them, then for this robot: its variables in the constraint, among its interface variables.
            None: all interface variables.
        max_cost: The constraint's maximum finite cost.
    """

    agents: tuple[str, ...]
    places: tuple[tuple[int, ...], ...] | None
    max_cost: Cost


class AllowedValues(NamedTuple):
    """The values that one constraint allows, as bit masks.

    Attributes:
        key: The constraint's name in explanations.
        agents: The other robots, in priority order.
        codes: For each of `agents`, and last for this robot, the code of each value: as in a `CostTable`.
        masks: The values of this robot (bit i for the i-th) that are consistent with each combination of the others'
            codes, in the order of `itertools.product`.
    """

    key: str
    agents: tuple[str, ...]
    codes: tuple[Sequence[int], ...]
    masks: Sequence[int]

    @property
    def sizes(self) -> list[int]:
        """The number of codes of each of `agents`."""
        return [max(codes, default=-1) + 1 for codes in self.codes[:-1]]

    def joined(self) -> Sequence[int]:
        """Return a mask for each combination of the others' values instead of codes.

        Raises:
            TooLargeError: if there are too many combinations.
        """
        others = self.codes[:-1]
        if self.sizes == [*map(len, others)]:  # codes are numbered from 0, so they are the indices of the values
            return self.masks
        refuse_large(self.key, math.prod(map(len, self.codes)))
        chosen = itertools.product(*steps_of(others, self.sizes))
        return [self.masks[sum(steps)] for steps in chosen]


def steps_of(codes: Sequence[Sequence[int]], sizes: Sequence[int]) -> list[list[int]]:
    """Return, for each robot's `codes`, their parts of an index in `itertools.product`, which is the sum of all parts.

    `sizes` are the numbers of codes.
    """
    lower = [math.prod(sizes[place + 1 :]) for place in range(len(sizes))]
    return [[code * step for code in coded] for coded, step in zip(codes, lower, strict=True)]


MIN_TABLE_VALUES = 64
"""The number of values from which numpy computes the conflicts of all values at once."""

MAX_BOUNDED_ROWS = 65_536
"""The maximum number of combinations of values for which a constraint's minimum cost is computed."""


class LocalProblem:
    """The local problem of one robot: its compiled domain, its neighbours, and the constraints that it checks.

    Constraints are sorted by their lowest robot, the highest first, so the constraints with robots above a given rank
    are a prefix. If robots may withdraw, the last value means withdrawal: all its parts are None, and constraints with
    it are restated or dropped (`model/absence.py`).

    Attributes:
        values: The values of the interface variables. `solution(i)` has the values of all variables for `values[i]`.
        charges: The private cost of each value.
        parents: The parents in the file, in priority order.
        children: The children in the file, in priority order.
        neighbours: The parents, children, and all robots in a constraint that this robot knows, in priority order.
        pkc_parents: The parents that share a partially known constraint with this robot, and so need this robot's value
            too.
        checks: The number of constraint checks so far.
        allows_undeclared: True after `allow_undeclared`.
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
        # Values must be distinct: without interface variables, withdrawal is the same value, and never cheaper.
        if part.parameters.withdrawal_cost is not None and (robot.interface or not self.values):
            self.values = (*self.values, (None,) * len(robot.interface))
            must_stay = any(one.when_absent == WhenAbsent.FAIL for one in robot.private)
            aside = INFINITE if must_stay else part.parameters.withdrawal_cost * robot.weight
            self.charges = (*self.charges, aside)
        self.checks = 0
        self.allows_undeclared = False
        self._places: dict[Value, int] | None = None
        self._adopted: dict[int, Point] = {}
        self._rank = rank
        self._part = part
        self._set_constraints(part, OwnValues(robot.interface, self.values))

    def __deepcopy__(self, memo: dict[int, object]) -> LocalProblem:
        """Return a copy that counts its own checks. What is known about the team is shared."""
        twin = copy(self)
        memo |= {id(self._part): self._part, id(self._domain): self._domain, id(self._rank): self._rank}
        vars(twin).update({name: deepcopy(value, memo) for name, value in vars(self).items()})
        return twin

    def _set_constraints(self, part: AgentProblem, own: OwnValues) -> None:
        """Compile the constraints in `part` for the values `own`, and set all attributes that depend on them."""
        robot, rank = part.robot, self._rank

        def ready(known: KeyedConstraint) -> SharedConstraint:
            constraint = SharedConstraint(known.key, known.constraint, part.known, self.agent)
            constraint.compile(own)
            return constraint

        above = [(known.constraint.model, ready(known)) for known in constraints_above(robot)]
        copies = [ready(known) for known in part.copies]
        below = [ready(known) for _, known in parts_below(robot)]
        shared = [*(constraint for _, constraint in above), *copies, *below]
        if part.parameters.withdrawal_cost is not None:
            for constraint in shared:
                constraint.allow_absence()
        self._constraints = sorted_by_lowest_agent(shared, rank)
        self._depths = [rank[constraint.agents[-1]] if constraint.agents else -1 for constraint in self._constraints]
        met = {agent for constraint in shared for agent in constraint.agents}
        self.neighbours = tuple(sorted({*self.parents, *self.children, *met}, key=rank.__getitem__))
        self._table: ConflictTable | None = self._conflict_table() if len(self.values) >= MIN_TABLE_VALUES else None
        self._below = by_robot(below)
        parts_above = [constraint for model, constraint in above if model == ConstraintModel.PKC]
        secretive = {*part.pkc_holders, *by_robot(parts_above)}
        self.pkc_parents = tuple(parent for parent in self.parents if parent in secretive)
        self._parts = by_robot([*parts_above, *below])
        self._filtering = by_robot([*copies, *below, *parts_above])
        self._made_filters: Filters | None = None

    @property
    def start(self) -> int | None:
        """The index of the value from which the search begins; None: no start value is known, or it is not possible.

        If the values of some variables are known, it is the cheapest of the values that contain them.
        """
        given, names = self._part.parameters.start, self._part.robot.interface
        known = [(place, given[name]) for place, name in enumerate(names) if name in given]
        if len(known) == len(names):
            return self._place_of.get(tuple([part for _, part in known])) if known else None
        fitting = [i for i, own in enumerate(self.values) if known and all(own[place] == part for place, part in known)]
        return min(fitting, key=self.charges.__getitem__, default=None)

    @property
    def upper_bound(self) -> Cost:
        """The cost that a solution must stay below; infinite if no bound is known. See `RunParameters`."""
        bound = self._part.parameters.upper_bound
        return INFINITE if bound is None else bound

    def allow_undeclared(self) -> None:
        """Evaluate constraints for undeclared values of others from now on, because domains may have changed."""
        self.allows_undeclared = True
        for constraint in self._constraints:
            constraint.allow_undeclared()

    def declared_count(self, robot: str) -> int:
        """Return the number of values that `declared` returns, without computing them."""
        domains, names = self._part.known.domains, self._part.known.interfaces[robot]
        return math.prod(len(domains[name]) for name in names) + self._may_look_withdrawn(names)

    def declared(self, robot: str) -> list[Value]:
        """Return all declared values of `robot`; the last is withdrawal if robots may withdraw.

        The private constraints of `robot` may forbid some of them.
        """
        names = self._part.known.interfaces[robot]
        values: list[Value] = [*itertools.product(*(self._part.known.domains[name] for name in names))]
        return [*values, (None,) * len(names)] if self._may_look_withdrawn(names) else values

    @property
    def behind(self) -> Sequence[int]:
        """The number of cheapest local solutions of each own value; 1 for withdrawal."""
        return (*self._domain.cheapest, *(1 for _ in self.values[len(self._domain.values) :]))

    def solution(self, index: int) -> dict[str, int]:
        """Return the values of all variables of this robot for `values[index]`. Empty if the robot is withdrawn."""
        point = self._adopted.get(index)
        if point is not None:
            return dict(zip(self._domain.variables, point.solution, strict=True))
        return self._domain.solution(index)

    def points(self) -> Points:
        """Return the positions of this robot in the whole intervals of its real variables."""
        return Points(self._part, self.values, self.charges)

    def cost_at(self, point: Point, view: Mapping[str, Value]) -> LexicographicCost:
        """Return the cost of `point` in `view`; each constraint without unknown variables is one check.

        The values in `view` must be possible (`refuse_value`).
        """
        paid = [
            one.cost_at(others, point.value)
            for one in self._constraints
            if (others := one.other_values(view)) is not None
        ]
        self.checks += len(paid)
        return _lexicographic_cost([*point.charges, *paid])

    def adopt(self, point: Point) -> int:
        """Return the index of `point` in `values`; a point between the values becomes the last one.

        The costs of such a value are known only to `cost_at`.
        """
        if point.place is not None:
            return point.place
        if self._adopted.get(len(self.values) - 1) != point:
            self._adopted[len(self.values)] = point
            self.values = (*self.values, point.value)
        return len(self.values) - 1

    def conflict(self, index: int, view: Mapping[str, Value], since: int = -1) -> Conflict | None:
        """Return the conflict of `values[index]` with `view` in the first violated constraint. None: no conflict.

        Constraints with unknown variables in `view` are skipped, and so are those whose lowest robot is above rank
        `since`: the caller knows that they hold. The order is that of their lowest robot, the highest first, so the
        first conflict also has the highest possible lowest variable. Of each robot, it contains only the variables in
        the constraint (`None` for others).
        """
        broken = self._broken(index, view, since)
        return None if broken is None else broken.conflict_with(view)

    def conflicts_of(
        self, indices: Sequence[int], view: Mapping[str, Value], since: int = -1
    ) -> list[tuple[Conflict, list[int]]]:
        """Return the conflicts of the values at `indices`, each with its values. Checks as in `conflict`."""
        if self._table is not None:
            found: dict[int, tuple[Conflict, list[int]]] = {}
            for index in indices:
                conflict = self.conflict(index, view, since)
                if conflict is not None:
                    found.setdefault(id(conflict), (conflict, []))[1].append(index)
            return list(found.values())
        left = sum([1 << index for index in indices])
        conflicts: list[tuple[Conflict, list[int]]] = []
        for constraint in self._since(since):
            mask = constraint.mask_in(view)
            if mask == UNKNOWN:
                continue
            self.checks += left.bit_count()
            broken = left & ~mask
            if broken:
                conflicts.append((constraint.conflict_with(view), [i for i in indices if broken >> i & 1]))
                left &= mask
                if not left:
                    break
        return conflicts

    def conflict_with_key(self, index: int, view: Mapping[str, Value], since: int = -1) -> tuple[Conflict, str] | None:
        """Return the result of `conflict`, with the key of the violated constraint."""
        broken = self._broken(index, view, since)
        return None if broken is None else (broken.conflict_with(view), broken.key)

    def conflicts(self, index: int, view: Mapping[str, Value]) -> list[tuple[Conflict, str]]:
        """Return the conflict and key of every constraint that `values[index]` violates."""
        known = self._known(view)
        return [(c.conflict(others), c.key) for c, others in known if not c.mask(others) >> index & 1]

    def gaps(self, index: int, sets: Mapping[str, Sequence[Value]]) -> Iterator[Gap]:
        """Yield the constraints that `values[index]` violates for some combination of the others' values in `sets`.

        The order and the skipped constraints are those of `conflict`. Each combination that a constraint distinguishes
        is one check. Robots must not withdraw.
        """
        for constraint in self._constraints:
            broken: list[Conflict] = []
            allowed: list[Conflict] = []
            for others in constraint.combined(sets):
                self.checks += 1
                (allowed if constraint.mask(others) >> index & 1 else broken).append(constraint.conflict(others))
            if broken:
                yield Gap(broken, allowed)

    def part_conflict(self, index: int, child: str, value: Value) -> Conflict | None:
        """Return the conflict of `values[index]` with `value` of `child` in this robot's parts of shared PKCs.

        None: the parts allow the pair. Unlike other conflicts, it contains this robot's value.
        """
        for constraint in self._below.get(child, ()):
            others = constraint.other_values({child: value})
            if others is None:
                continue
            self.checks += 1
            if not constraint.mask(others) >> index & 1:
                return {self.agent: constraint.own_part(index), **constraint.conflict(others)}
        return None

    def filter(self, index: int, receiver: str) -> bytes:
        """Return the values of `receiver` that are consistent with `values[index]` in this robot's constraints.

        For a child: in totally known constraints (if all robots of a scope know them) and this robot's parts. For a
        parent: in this robot's parts. For other robots: all values. Every pair that a constraint distinguishes is one
        check, so that the count reveals nothing about the values. See `solver/filters.py`.
        """
        evaluated, allowed = self._filters.of(index, receiver)
        self.checks += evaluated
        return allowed

    @property
    def filter_places(self) -> Sequence[int]:
        """The position of each own value in filters. Raises `UnsupportedError` if there are too many for a filter."""
        return self._filters.places

    def violation_count(self, index: int, view: Mapping[str, Value]) -> int:
        """Return the number of constraints without unknown variables in `view` that `values[index]` violates."""
        return sum(not constraint.mask(others) >> index & 1 for constraint, others in self._known(view))

    def cost(self, index: int, view: Mapping[str, Value]) -> Cost:
        """Return the cost of `values[index]` in `view`: private, plus that of constraints without unknown variables."""
        return sum([c.costs(others)[index] for c, others in self._known(view)], self.charges[index])

    def costs(self, view: Mapping[str, Value]) -> list[Cost]:
        """Return the `cost` of every own value; each value and constraint is one check."""
        known = self._paid(view)
        self.checks += len(known) * len(self.values)
        return [sum(prices) for prices in zip(self.charges, *known, strict=True)]

    def lexicographic_costs(self, view: Mapping[str, Value]) -> list[LexicographicCost]:
        """Return the lexicographic costs of all own values, comparable even where hard constraints are violated."""
        known = self._paid(view)
        self.checks += len(known) * len(self.values)
        costs = list(map(sum, zip(self.charges, *known, strict=True)))
        if INFINITE not in costs:
            return [(0, cost) for cost in costs]
        return [_lexicographic_cost(prices) for prices in zip(self.charges, *known, strict=True)]

    def shares_parts_with(self, robot: str) -> bool:
        """Return whether this robot, or `robot`, has a part of a common partially known constraint (PKC)."""
        return robot in self._parts or robot in self.pkc_parents

    def own_side(self, index: int, robot: str, value: Value) -> LexicographicCost:
        """Return the cost of `values[index]` in this robot's parts of constraints with `robot`, if `robot` has `value`.

        These are parts of partially known constraints (PKC); `robot` pays for its own parts. Each part is one check.

        Raises:
            ValueError: if `robot` cannot have the value.
        """
        self.refuse_value(robot, value)
        known = [paid for part in self._parts.get(robot, ()) if (paid := part.costs_in({robot: value})) is not None]
        self.checks += len(known)
        return _lexicographic_cost([paid[index] for paid in known])

    def least_side(self, robot: str) -> list[Cost]:
        """Return, for each own value, a lower bound on its cost in `own_side` over all values of `robot`.

        Violated parts are infinite. As in `lower_bounds`, the bound is 0 if robots may withdraw, or have too many
        values.
        """
        return self._at_least(self._parts.get(robot, ()))

    def refuse_value(self, robot: str, value: Value) -> None:
        """Raise `ValueError` if `value`, received in a message, is not in the declared domains of `robot`."""
        names = self._part.known.interfaces.get(robot, ())
        if len(value) != len(names):
            raise ValueError(f"a value of {robot} has {len(names)} parts, not {len(value)}")
        if any(part is not None for part in value):  # otherwise the robot is withdrawn
            domains = self._part.known.domains
            for name, part in zip(names, value, strict=True):
                if part is None or part not in domains[name].possible:
                    raise ValueError(f"{name} of {robot} cannot be {part}")

    def charged(self, view: Mapping[str, Value]) -> list[Charged]:
        """Return the costs in each constraint whose other variables are all known, with the checks of `costs`.

        These costs add up to the `costs` without the private `charges`.
        """
        found = [
            Charged(number, others, constraint.codes, constraint.costs(others))
            for number, constraint in enumerate(self._constraints)
            if (others := constraint.other_values(view)) is not None
        ]
        self.checks += len(found) * len(self.values)
        return found

    def least_and_most(self, number: int) -> tuple[Cost, Cost]:
        """Return the minimum and maximum cost of the constraint with this `number`, including infinite costs.

        The minimum and maximum are over this robot's values and all declared values of the others. With more than
        `MAX_BOUNDED_ROWS` combinations, they are 0 and the maximum in the constraint's definition.
        """
        constraint = self._constraints[number]
        checks, least, most = constraint.least_and_most(self._part.known.domains, MAX_BOUNDED_ROWS)
        self.checks += checks
        return least, most

    def scopes(self, robots: Iterable[str]) -> list[tuple[tuple[str, ...], Cost]]:
        """Return, for each constraint whose other robots are all in `robots`, these robots and its maximum cost.

        The maximum is over finite costs, for any domains: nothing is checked. See `tables`.
        """
        known = {*robots}
        return [(c.agents, c.max_cost) for c in self._constraints if known.issuperset(c.agents)]

    def scopes_in_tables(self, robots: Iterable[str]) -> list[TableScope]:
        """Return the result of `scopes`, with the variables that each constraint names: nothing is checked."""
        known = {*robots}
        return [
            TableScope(c.agents, None if c.names_all else c.places, c.max_cost)
            for c in self._constraints
            if known.issuperset(c.agents)
        ]

    def table_inputs(self, robots: Iterable[str]) -> tuple[object, ...]:
        """Return the data that determine `tables` for these `robots`, except domains: equal data give equal tables.

        The data are this robot's values and their charges, and the constraints whose other robots are all in `robots`,
        without the names of their definitions, which journals do not keep.
        """
        known = {*robots}
        constraints = [nameless(c.definition) for c in self._constraints if known.issuperset(c.agents)]
        return self.values, self.charges, constraints

    def added(self, robot: str, view: Mapping[str, Value]) -> list[Cost] | None:
        """Return the cost that `robot`, the lowest in `view`, adds to each own value: the increase of `costs`.

        None: no constraint becomes complete. All other robots in `view` must be higher. Checks are counted only for the
        constraints that become complete.
        """
        waiting = self._with_lowest(robot)
        return self._added(waiting, view) if waiting else None

    def added_by(self, robot: str, view: Mapping[str, Value]) -> list[Cost]:
        """Return the result of `added` for a `robot` anywhere in the order; 0 if no constraint becomes complete."""
        return self._added([constraint for constraint in self._constraints if robot in constraint.agents], view)

    def lower_bounds(self, robots: Container[str]) -> list[Cost]:
        """Return, for each own value, a lower bound on its cost in constraints whose other robots are all in `robots`.

        The others may have all their declared values. The bound is 0 if robots may withdraw, and for a constraint
        with more than `MAX_BOUNDED_ROWS` combinations of values.
        """
        return self._at_least([c for c in self._constraints if c.agents and all(a in robots for a in c.agents)])

    def _at_least(self, constraints: Sequence[SharedConstraint]) -> list[Cost]:
        """Return a lower bound on the cost of each own value in `constraints`, over all declared values of others."""
        least: list[list[Cost]] = []
        for constraint in constraints if self._part.parameters.withdrawal_cost is None else ():
            checks, charged = constraint.lower_bounds(self._part.known.domains, MAX_BOUNDED_ROWS)
            self.checks += checks
            least.append(charged)
        return _summed(len(self.values), least)

    def tables(self, domains: Mapping[str, Sequence[Value]], lowest: str | None = None) -> list[CostTable]:
        """Return a cost table for each constraint whose other robots are all in `domains`.

        With `lowest`, return only the tables of constraints whose lowest other robot is `lowest`.

        Each combination that a constraint distinguishes is one check. The tables, numpy arrays, do not include the
        private charges. See `solver/cost_table.py`, also for the size limit.
        """
        from robochoc.solver.cost_table import cost_table  # noqa: PLC0415 - numpy, needed for tables only

        found = []
        for constraint in self._constraints if lowest is None else self._with_lowest(lowest):
            if set(constraint.agents) <= domains.keys():
                checks, table = cost_table(constraint, domains)
                self.checks += checks
                found.append(table)
        return found

    def tables_or_rows(self, domains: Mapping[str, Sequence[Value]], lowest: str) -> list[CostTable | ConstraintRows]:
        """Return the result of `tables`, but `ConstraintRows` for n-ary constraints whose tables would be too large.

        The caller counts the checks of rows.

        Raises:
            TooLargeError: if a table is too large, and the constraint cannot be evaluated in rows.
        """
        from robochoc.solver.constraint_arrays import ConstraintRows  # noqa: PLC0415 - as above
        from robochoc.solver.cost_table import cost_table  # noqa: PLC0415 - as above

        found: list[CostTable | ConstraintRows] = []
        for constraint in self._with_lowest(lowest):
            if not set(constraint.agents) <= domains.keys():
                continue
            try:
                checks, table = cost_table(constraint, domains)
            except TooLargeError:
                rows = constraint.row_costs(domains) if len(constraint.agents) > 1 else None
                if rows is None:
                    raise
                found.append(ConstraintRows(constraint.agents, rows))
            else:
                self.checks += checks
                found.append(table)
        return found

    @property
    def has_costs(self) -> bool:
        """True if costs or withdrawals are minimised."""
        return self._part.robot.kind == ProblemKind.DISWCSP or self._part.parameters.withdrawal_cost is not None

    def allowed(self, domains: Mapping[str, Sequence[Value]], lowest: str) -> list[AllowedValues]:
        """Return the result of `tables` for `lowest` as bit masks, for problems without costs.

        No robot may withdraw.

        Raises:
            TooLargeError: if there are too many combinations.
        """
        found = []
        for constraint in self._with_lowest(lowest):
            if not domains.keys() >= set(constraint.agents):
                continue
            axes = constraint.axes(domains)
            evaluated, masks = constraint.masks_on(axes, MAX_BOUNDED_ROWS)
            self.checks += evaluated * len(self.values)
            codes = tuple([axis.codes for axis in axes])
            found.append(AllowedValues(constraint.key, constraint.agents, codes, masks))
        return found

    def look_ahead(self) -> None:
        """Evaluate the constraints that `allowed` will need, before other robots have sent their values.

        These are the constraints in which one robot is lower than this one, evaluated for all declared values. Robots
        do this simultaneously. If there are too many values, nothing is evaluated.
        """
        own = self._rank[self.agent]
        declared = self._part.known.domains
        for constraint in self._constraints:
            if not constraint.agents or self._rank[constraint.agents[-1]] < own:
                continue
            if any(self._rank[agent] > own for agent in constraint.agents[:-1]):
                continue
            combinations = constraint.declared(declared, MAX_BOUNDED_ROWS // max(1, len(self.values)))
            self.checks += constraint.evaluate(combinations) * len(self.values)

    def tasks(self, *, congestion: bool = False) -> tuple[SharedTask, ...]:
        """Return the tasks of the robot. Raises `UnsupportedError`. See `solver/exclusions.py`."""
        from robochoc.solver.exclusions import tasks_of  # noqa: PLC0415 - for auctions only

        checks, tasks = tasks_of(self._part, congestion=congestion)
        self.checks += checks
        return tasks

    def interchangeable(self, value: Value) -> Sequence[int]:
        """Return the indices of all own values that agree with `value` wherever `value` is not None.

        Neighbours that see nothing else cannot distinguish these values: neighbourhood partial interchangeability
        (Burke and Brown, "Applying interchangeability to complex local problems in distributed constraint reasoning",
        AAMAS workshop DCR 2006).
        """
        if None not in value:
            index = self._place_of.get(value)
            return () if index is None else (index,)
        wanted = [(place, part) for place, part in enumerate(value) if part is not None]
        return [index for index, own in enumerate(self.values) if all(own[place] == part for place, part in wanted)]

    def _may_look_withdrawn(self, names: Sequence[str]) -> bool:
        """Return whether withdrawal is a separate value of a robot that shows `names` to its neighbours."""
        return self._part.parameters.withdrawal_cost is not None and bool(names)

    def _known(self, view: Mapping[str, Value]) -> list[tuple[SharedConstraint, OtherValues]]:
        """Return each constraint whose other variables are all known, and their values. Each is one check."""
        known = [(c, others) for c in self._constraints if (others := c.other_values(view)) is not None]
        self.checks += len(known)
        return known

    def _paid(self, view: Mapping[str, Value]) -> list[list[Cost]]:
        """Return the costs of own values in each constraint whose other variables are all known. Count no checks."""
        return [prices for c in self._constraints if (prices := c.costs_in(view)) is not None]

    def _since(self, place: int) -> Sequence[SharedConstraint]:
        """Return the constraints whose lowest robot is not higher in the order than `place`."""
        return self._constraints if place < 0 else self._constraints[bisect_left(self._depths, place) :]

    def _with_lowest(self, robot: str) -> Sequence[SharedConstraint]:
        """Return the constraints whose lowest other robot is `robot`."""
        depth = self._rank[robot]
        return self._constraints[bisect_left(self._depths, depth) : bisect_right(self._depths, depth)]

    def _broken(self, index: int, view: Mapping[str, Value], since: int) -> SharedConstraint | None:
        """Return the first constraint that `values[index]` violates in `view`."""
        if self._table is not None:
            checks, broken = self._table.first_broken(index, view, bisect_left(self._depths, since))
            self.checks += checks
            return broken
        for constraint in self._since(since):
            mask = constraint.mask_in(view)
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

    def _conflict_table(self) -> ConflictTable:
        from robochoc.solver.conflict_table import ConflictTable  # noqa: PLC0415 - numpy, needed for large domains only

        return ConflictTable(self._constraints, len(self.values))

    def _added(self, waiting: Sequence[SharedConstraint], view: Mapping[str, Value]) -> list[Cost]:
        """Return the cost of each own value in the constraints of `waiting` whose other variables are all known."""
        known = [(c, others) for c in waiting if (others := c.other_values(view)) is not None]
        self.checks += len(known) * len(self.values)
        return _summed(len(self.values), [constraint.costs(others) for constraint, others in known])


def _summed(size: int, rows: Sequence[Sequence[Cost]]) -> list[Cost]:
    """Return the sum of `rows`, each of `size` values."""
    return [sum(prices) for prices in zip(*rows, strict=True)] if rows else [0] * size


def _lexicographic_cost(prices: Sequence[Cost]) -> LexicographicCost:
    """Return the total of `prices` as a lexicographic cost."""
    return prices.count(INFINITE), sum([price for price in prices if price < INFINITE])
