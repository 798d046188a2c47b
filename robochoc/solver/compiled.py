"""A robot's local problem as protocols see it: one compiled variable, and the constraints it has to check.

Paper, Section 4.1: every robot is one variable to a protocol. Its values are the robot's local solutions, seen from
the interface variables that neighbours know (`solver/domain.py`); the constraints it checks are those shared with
its parents (`solver/shared_constraint.py`), and its parts of partially known ones (PKC), also with its children.

Constraint checks are counted here, and only here (CompAPO adds those in tables that others send it): one check is one
evaluation of one shared constraint for one value of the own domain (Meisels, Kaplansky, Razgon and Zivan 2002). Private
constraints are settled once, when the domain is compiled, and are not counted; nor are look-ups of nogoods and filters.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

from robochoc.model.message import Value
from robochoc.model.problem import INFINITE, ProblemKind
from robochoc.solver.encoding import Cost
from robochoc.solver.local_constraints import LocalConstraints
from robochoc.solver.shared_constraint import (
    UNKNOWN,
    Conflict,
    Gap,
    OtherValues,
    SharedConstraint,
)

if TYPE_CHECKING:
    from robochoc.solver.cost_table import CostTable
    from robochoc.solver.exclusions import Task

LexicographicCost = tuple[int, Cost]
"""The number of constraints that a value violates, and the cost of all others. Pairs compare as tuples: a violated
constraint weighs more than any cost, and differences are never `inf - inf`."""


class Charged(NamedTuple):
    """The costs that one constraint charges in a view, of each own value, given what it sees of the `others`.

    `number` is the constraint's place in `LocalProblem`. Own values that it cannot tell apart have the same code.
    """

    number: int
    others: OtherValues
    codes: Sequence[int]
    costs: Sequence[Cost]


MAX_BOUNDED_ROWS = 65_536
"""A constraint with more combinations of values than this is not searched for the least that it charges."""


class LocalProblem(LocalConstraints):
    """The local problem of one robot: its compiled domain, its neighbours, and the constraints it has to check.

    `values[i]` is the i-th value as neighbours see it; `solution(i)` are the own variables' values behind it.
    `parents` and `children` are the links that the files name, `neighbours` are they and all others in a constraint
    that this robot knows; each in priority order. `pkc_parents` are the parents with whom a partially known constraint
    is shared: they have to hear of the own value too. `checks` counts constraint checks so far.

    `charges[i]` is the private cost of the i-th value. Where robots may withdraw, the last value means withdrawal: all
    its parts are None, and constraints with it are restated or dropped (`model/absence.py`).
    """

    @property
    def behind(self) -> Sequence[int]:
        """For each own value the number of local solutions of least private cost behind it; 1 for withdrawal."""
        return (*self._domain.cheapest, *(1 for _ in self.values[len(self._domain.values) :]))

    def solution(self, index: int) -> dict[str, int]:
        """Return the values of all own variables for `values[index]`. Empty if the robot is withdrawn."""
        return self._domain.solution(index)

    def conflict(self, index: int, view: Mapping[str, Value], since: int = -1) -> Conflict | None:
        """Return why `values[index]` is against `view`: what the first constraint that it breaks sees, or None.

        Constraints whose other variables are not all known in `view` are passed over, and so are those whose lowest
        robot stands higher in the order than place `since`: the caller knows that they hold. The order is that of their
        lowest robot, the highest first, so the first conflict is also the one with the highest possible lowest
        variable. Of each robot only what the constraint looks at is named (`None` elsewhere).
        """
        broken = self._broken(index, view, since)
        return None if broken is None else broken.conflict_with(view)

    def conflicts_of(
        self, indices: Sequence[int], view: Mapping[str, Value], since: int = -1
    ) -> list[tuple[Conflict, list[int]]]:
        """Return what `conflict` returns for those of `indices` that are against `view`, with as many checks.

        Values with the same conflict come together.
        """
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
            mask = constraint.look(view)
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
        """Return what `conflict` returns, with the key of the violated constraint."""
        broken = self._broken(index, view, since)
        return None if broken is None else (broken.conflict_with(view), broken.key)

    def conflicts(self, index: int, view: Mapping[str, Value]) -> list[tuple[Conflict, str]]:
        """Return what `conflict_with_key` returns, for every constraint that `values[index]` violates."""
        known = self._known(view)
        return [(c.conflict(others), c.key) for c, others in known if not c.mask(others) >> index & 1]

    def gaps(self, index: int, sets: Mapping[str, Sequence[Value]]) -> Iterator[Gap]:
        """Yield the constraints that `values[index]` violates for some combination of the others' values in `sets`.

        The order is that of `conflict`, and so is what is passed over. A check for each combination that a constraint
        can tell apart. Robots do not withdraw here.
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
        """Return the conflict of `values[index]` with `value` of `child`, by this robot's parts of shared PKCs.

        None: the parts allow the pair. The pair is named like a conflict, but with this robot's own value in it.
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

        That is, towards a child, what is totally known (where all robots of a scope know it) and the own parts;
        towards a parent the own parts; for other robots all values. Every pair that a constraint can tell apart
        is one check, so that the count says nothing of the answers. See `solver/filters.py`.
        """
        evaluated, allowed = self._filters.of(index, receiver)
        self.checks += evaluated
        return allowed

    @property
    def filter_places(self) -> Sequence[int]:
        """For each own value its place in filters. Raises `UnsupportedError` when there are too many for a filter."""
        return self._filters.places

    def violation_count(self, index: int, view: Mapping[str, Value]) -> int:
        """Return how many constraints `values[index]` violates. Those with unknown variables in `view` are left out."""
        return sum(not constraint.mask(others) >> index & 1 for constraint, others in self._known(view))

    def cost(self, index: int, view: Mapping[str, Value]) -> Cost:
        """Return the cost of `values[index]` in `view`: its private cost, and constraints without unknown variables."""
        return sum([c.costs(others)[index] for c, others in self._known(view)], self.charges[index])

    def costs(self, view: Mapping[str, Value]) -> list[Cost]:
        """Return the `cost` of every own value: as many checks for each constraint as there are values."""
        known = self._paid(view)
        self.checks += len(known) * len(self.values)
        return [sum(prices) for prices in zip(self.charges, *known, strict=True)]

    def lexicographic_costs(self, view: Mapping[str, Value]) -> list[LexicographicCost]:
        """Return the lexicographic cost of every own value: comparable also where hard constraints are violated."""
        known = self._paid(view)
        self.checks += len(known) * len(self.values)
        costs = list(map(sum, zip(self.charges, *known, strict=True)))
        if INFINITE not in costs:
            return [(0, cost) for cost in costs]
        return [_lexicographic_cost(prices) for prices in zip(self.charges, *known, strict=True)]

    def shares_parts_with(self, robot: str) -> bool:
        """Return whether this robot has a part of a partially known constraint (PKC) with `robot`, or knows of its."""
        return robot in self._parts or robot in self.pkc_parents

    def own_side(self, index: int, robot: str, value: Value) -> LexicographicCost:
        """Return what `values[index]` pays for the own parts of constraints with `robot`, when that has `value`.

        Only what is partially known (PKC) is counted, and of it the own parts: `robot` pays its own. One check for each
        part.

        Raises:
            ValueError: when `robot` has no such value.
        """
        self.refuse_value(robot, value)
        known = [paid for part in self._parts.get(robot, ()) if (paid := part.costs_in({robot: value})) is not None]
        self.checks += len(known)
        return _lexicographic_cost([paid[index] for paid in known])

    def least_side(self, robot: str) -> list[Cost]:
        """Return a lower bound, for each own value, on what `own_side` charges whatever value `robot` takes.

        Broken parts are infinite. As in `lower_bounds`, it is 0 where robots may withdraw, or have too many values.
        """
        return self._at_least(self._parts.get(robot, ()))

    def refuse_value(self, robot: str, value: Value) -> None:
        """Raise `ValueError` for a `value` that `robot`, as its files declare it, cannot have: others say anything."""
        names = self._part.known.interfaces.get(robot, ())
        if len(value) != len(names):
            raise ValueError(f"a value of {robot} has {len(names)} parts, not {len(value)}")
        if any(part is not None for part in value):  # none at all: it is withdrawn
            domains = self._part.known.domains
            for name, part in zip(names, value, strict=True):
                if part is None or part not in domains[name]:
                    raise ValueError(f"{name} of {robot} cannot be {part}")

    def charged(self, view: Mapping[str, Value]) -> list[Charged]:
        """Return what each constraint whose other variables are all known charges, with the checks of `costs`.

        They add up to the `costs`, but for the private `charges`.
        """
        found = [
            Charged(number, others, constraint.codes, constraint.costs(others))
            for number, constraint in enumerate(self._constraints)
            if (others := constraint.other_values(view)) is not None
        ]
        self.checks += len(found) * len(self.values)
        return found

    def least_and_most(self, number: int) -> tuple[Cost, Cost]:
        """Return the least and the most that the constraint of this `number` charges, broken ones (infinite) included.

        For the own values and all that files declare for the others; with more than `MAX_BOUNDED_ROWS` combinations,
        what the constraint itself says: 0, and the most that it lists.
        """
        constraint = self._constraints[number]
        checks, least, most = constraint.least_and_most(self._part.known.domains, MAX_BOUNDED_ROWS)
        self.checks += checks
        return least, most

    def scopes(self, robots: Iterable[str]) -> list[tuple[tuple[str, ...], Cost]]:
        """Return, for each constraint whose other robots are all in `robots`, these robots and its maximum cost.

        That is, short of being broken, and whatever values there are: nothing is checked. See `tables`.
        """
        known = {*robots}
        return [(c.agents, c.max_cost) for c in self._constraints if known.issuperset(c.agents)]

    def table_inputs(self, robots: Iterable[str]) -> tuple[object, ...]:
        """Return what `tables` are made of for these `robots`, but for their domains: equal if the tables must be.

        That is, the own values and their charges, and the constraints whose other robots are all in `robots`.
        """
        known = {*robots}
        return self.values, self.charges, [c.definition for c in self._constraints if known.issuperset(c.agents)]

    def added(self, robot: str, view: Mapping[str, Value]) -> list[Cost] | None:
        """Return the additional cost of each own value when `robot`, the lowest in `view`, is known too.

        None: no constraint becomes complete.

        So much are the `costs` in `view` more than without `robot`, if all others in it are higher. Checks are only
        those of the constraints that come in.
        """
        depth = self._rank[robot]
        places = slice(bisect_left(self._depths, depth), bisect_right(self._depths, depth))
        return self._added(self._constraints[places], view) if self._depths[places] else None

    def added_by(self, robot: str, view: Mapping[str, Value]) -> list[Cost]:
        """Return what `added` returns for a `robot` anywhere in the order; 0 where no constraint becomes complete."""
        return self._added([constraint for constraint in self._constraints if robot in constraint.agents], view)

    def lower_bounds(self, robots: Container[str]) -> list[Cost]:
        """Return, for each own value, a lower bound on its cost in constraints whose other robots are all in `robots`.

        These may take any values that their files declare. The bound is 0 where robots may withdraw, and for a
        constraint with more than `MAX_BOUNDED_ROWS` combinations of values.
        """
        return self._at_least([c for c in self._constraints if c.agents and all(a in robots for a in c.agents)])

    def _at_least(self, constraints: Sequence[SharedConstraint]) -> list[Cost]:
        """Return a lower bound on what `constraints` charge each own value, over all that files declare for others."""
        least: list[list[Cost]] = []
        for constraint in constraints if self._part.parameters.withdrawal_cost is None else ():
            checks, charged = constraint.lower_bounds(self._part.known.domains, MAX_BOUNDED_ROWS)
            self.checks += checks
            least.append(charged)
        return _summed(len(self.values), least)

    def tables(self, domains: Mapping[str, Sequence[Value]], lowest: str | None = None) -> list[CostTable]:
        """Return a cost table for each constraint whose other robots are all in `domains`.

        With `lowest`, only of those among whose other robots that one is the lowest.

        A check for each combination that a constraint can tell apart. The own charges are not among them. Numpy's:
        see `solver/cost_table.py`, also for how large a table may be.
        """
        from robochoc.solver.cost_table import cost_table  # noqa: PLC0415 - numpy is for those who want tables only

        found = []
        for constraint in self._constraints:
            if lowest is not None and constraint.agents[-1:] != (lowest,):
                continue
            if set(constraint.agents) <= domains.keys():
                checks, table = cost_table(constraint, domains, len(self.values))
                self.checks += checks
                found.append(table)
        return found

    @property
    def has_costs(self) -> bool:
        """Whether something is minimised: costs, or robots that withdraw."""
        return self._part.robot.kind == ProblemKind.DISWCSP or self._part.parameters.withdrawal_cost is not None

    def allowed(
        self, domains: Mapping[str, Sequence[Value]], lowest: str
    ) -> list[tuple[tuple[str, ...], dict[tuple[int, ...], int]]]:
        """Return what `tables` returns for `lowest`, where there are no costs.

        For each constraint its other robots, and for each combination of places of their values the own values that
        are consistent with these: bit i for the i-th. No robot may withdraw.

        Raises:
            UnsupportedError: when these are too many.
        """
        found = []
        for constraint in self._constraints:
            if constraint.agents[-1:] != (lowest,) or not domains.keys() >= set(constraint.agents):
                continue
            combinations = [*constraint.combinations(domains, len(self.values))]
            self.checks += constraint.evaluate(others for _, others in combinations) * len(self.values)
            found.append((constraint.agents, {place: constraint.mask(others) for place, others in combinations}))
        return found

    def look_ahead(self) -> None:
        """Evaluate what `allowed` will be asked for, before other robots have told their values.

        That is, the constraints in which one robot is lower than this one, for all values that files declare. Robots
        do it at the same time. Where values are too many, nothing is done.
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

    def tasks(self, *, congestion: bool = False) -> tuple[Task, ...]:
        """Return what is done by one robot at most. Raises `UnsupportedError`. See `solver/exclusions.py`."""
        from robochoc.solver.exclusions import tasks_of  # noqa: PLC0415 - for auctions only

        checks, tasks = tasks_of(self._part, congestion=congestion)
        self.checks += checks
        return tasks

    def interchangeable(self, value: Value) -> Sequence[int]:
        """Return the places of all own values that agree with `value` wherever that is not None.

        Neighbours that see nothing else cannot tell them apart: neighbourhood partial interchangeability
        (Burke and Brown, "Applying interchangeability to complex local problems in distributed constraint
        reasoning", AAMAS workshop DCR 2006).
        """
        if None not in value:
            index = self._place_of.get(value)
            return () if index is None else (index,)
        wanted = [(place, part) for place, part in enumerate(value) if part is not None]
        return [index for index, own in enumerate(self.values) if all(own[place] == part for place, part in wanted)]

    def _added(self, waiting: Sequence[SharedConstraint], view: Mapping[str, Value]) -> list[Cost]:
        """Return what each own value pays for those of `waiting` whose other variables are all known."""
        known = [(c, others) for c in waiting if (others := c.other_values(view)) is not None]
        self.checks += len(known) * len(self.values)
        return _summed(len(self.values), [constraint.costs(others) for constraint, others in known])


def _summed(size: int, rows: Sequence[Sequence[Cost]]) -> list[Cost]:
    """Return the sum of `rows`, each of `size` values."""
    return [sum(prices) for prices in zip(*rows, strict=True)] if rows else [0] * size


def _lexicographic_cost(prices: Sequence[Cost]) -> LexicographicCost:
    """Return the total of `prices`."""
    return prices.count(INFINITE), sum([price for price in prices if price < INFINITE])
