"""Exclusions and tasks in the constraints of a team: a task is done by at most one robot.

A *choice* is a value of a variable. Two choices of two robots exclude each other if a constraint between these robots
forbids them together: `V1 = 3` and `V2 = 3` if no two robots do task 3. A team is a *task allocation* if

- all shared constraints are of this kind, each over one variable of each of two robots, without costs;
- choices that exclude each other directly or indirectly all exclude each other, except choices of the same robot: such
  a set of choices contains the ways of doing one *task*, which is done by at most one robot;
- each interface variable has a value that is not such a choice, so that a robot can leave all tasks to others.

With *congestion*, several robots may do a task; each pair of them has a cost, the same for all pairs of robots that do
the task. Exclusion is the same as an infinite cost.

A robot can determine its tasks, and the other robots that can do them, from its own constraints.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from robochoc.model.constraint import Definition
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Domain, Team
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import MAX_TUPLES, Cost, cost_function
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.explanation import constraints_above

Choice = tuple[int, int]
"""The index of a variable in its robot's interface, and one of its values."""
Pair = tuple[int, int]
"""A value of each of two variables."""
Column = tuple[int, ...]
"""The values of a variable."""
Partners = dict[tuple[str, Choice], Cost]
"""Choices of other robots, with their costs in combination with one choice of this robot."""


class SharedTask(NamedTuple):
    """A task that at most one robot does; with congestion, several robots, at a `cost` for each pair.

    Attributes:
        own: The choices of this robot that do the task.
        others: The choices of each other robot that do the task. Robots are in priority order.
        cost: The cost of each pair of robots that do the task.
    """

    own: tuple[Choice, ...]
    others: Mapping[str, frozenset[Choice]]
    cost: Cost = INFINITE


def tasks_of(part: AgentProblem, *, congestion: bool = False) -> tuple[int, tuple[SharedTask, ...]]:
    """Return the number of constraint checks, and the tasks of the robot in `part`, sorted by its first choices.

    Each pair of values in each constraint is one check. `part.copies` must contain the constraints of lower robots.

    Args:
        part: The robot's problem.
        congestion: True if several robots may do a task at a cost.

    Raises:
        UnsupportedError: if a shared constraint of the robot is not an exclusion.
    """
    known, own = part.known, part.robot.name
    place = {name: at for names in known.interfaces.values() for at, name in enumerate(names)}
    excluded: dict[Choice, Partners] = defaultdict(dict)
    choices: dict[Choice, Choice] = {}
    exclusions = _Exclusions(known.owners, known.domains, congestion=congestion)
    for constraint in (one.constraint for one in (*constraints_above(part.robot), *part.copies)):
        one, other = exclusions.scope(constraint, own)
        if known.owners[other] == own:
            one, other = other, one
        robot, here, there = known.owners[other], place[one], place[other]
        for (value, theirs), cost in exclusions.pairs(constraint, one, other):
            choice = there, theirs
            partner = robot, choices.setdefault(choice, choice)
            own_choice = excluded[here, value]
            own_choice[partner] = cost + own_choice.get(partner, 0)
    together: dict[frozenset[tuple[tuple[str, Choice], Cost]], list[Choice]] = {}
    for choice in sorted(excluded):
        together.setdefault(frozenset(excluded.pop(choice).items()), []).append(choice)
    same: dict[frozenset[Choice], frozenset[Choice]] = {}
    return exclusions.checks, tuple(_task(own, dict(partners), part, same) for partners, own in together.items())


def _task(
    choices: list[Choice], partners: Partners, part: AgentProblem, same: dict[frozenset[Choice], frozenset[Choice]]
) -> SharedTask:
    costs = {*partners.values()}
    if len(costs) > 1:
        raise UnsupportedError(
            f"{part.robot.name} shares a task that costs {min(costs)} with one robot, and {max(costs)} with another"
        )
    return SharedTask(tuple(choices), _by_robot(partners, part.known.rank, same), costs.pop())


def allocation_fault(team: Team, *, congestion: bool = False) -> str:
    """Return the reason why `team` is not a task allocation (with `congestion` if allowed); empty if it is one."""
    variables = {name: variable.domain for name, variable in team.variables.items()}
    exclusions = _Exclusions(team.owner, variables, congestion=congestion)
    excluded: dict[tuple[str, int], dict[tuple[str, int], Cost]] = defaultdict(dict)
    held = [(robot.name, one.constraint) for robot in team.robots for one in constraints_above(robot)]
    try:
        scopes = [exclusions.scope(constraint, robot) for robot, constraint in held]
        for (_, constraint), (one, other) in zip(held, scopes, strict=True):
            for (value, theirs), cost in exclusions.pairs(constraint, one, other):
                total = cost + excluded[one, value].get((other, theirs), 0)
                excluded[one, value][other, theirs] = excluded[other, theirs][one, value] = total
    except UnsupportedError as fault:
        return str(fault)
    for name in sorted({name for name, _ in excluded}):
        if all((name, value) in excluded for value in variables[name]):
            return (
                f"{team.owner[name]} cannot leave all tasks to others: each value of {name} excludes another robot's,"
                " which may mean that a task requires several robots"
            )
    return _scattered(excluded, team.owner)


def _scattered(excluded: Mapping[tuple[str, int], Mapping[tuple[str, int], Cost]], owner: Mapping[str, str]) -> str:
    """Return an error text if linked choices do not exclude each other, or have different costs; otherwise empty."""
    seen: set[tuple[str, int]] = set()
    for choice in excluded:
        if choice in seen:
            continue
        linked, ahead = {choice}, [choice]
        while ahead:
            new = excluded[ahead.pop()].keys() - linked
            linked |= new
            ahead += new
        seen |= linked
        costs = {cost for one in linked for cost in excluded[one].values()}
        if len(costs) > 1:
            return f"{choice[0]} = {choice[1]} shares a task whose pairs of robots cost {min(costs)} and {max(costs)}"
        for one in sorted(linked):
            missing = {other for other in linked - excluded[one].keys() if owner[other[0]] != owner[one[0]]}
            if missing:
                pair = " and ".join(f"{name} = {value}" for name, value in (one, min(missing)))
                return f"{pair} do not exclude each other, although both exclude the same choices of others"
    return ""


class _Exclusions:
    """Finds the pairs forbidden by constraints, and counts the checks. Equal constraints are evaluated once.

    Robots in one process share the evaluations; each robot counts its own checks.
    """

    def __init__(self, owners: Mapping[str, str], domains: Mapping[str, Domain], *, congestion: bool) -> None:
        self.checks = 0
        self._congestion = congestion
        self._owners = owners
        self._domains = domains
        self._definitions: dict[int, int] = {}
        self._same_definition: dict[Definition, Definition] = {}
        self._columns: dict[str, Column] = {}
        self._same: dict[Column, Column] = {}
        self._found: dict[tuple[object, ...], tuple[tuple[Pair, Cost], ...]] = {}

    def scope(self, constraint: Constraint, robot: str) -> tuple[str, str]:
        """Return the two variables in a `constraint` of `robot`. Raises `UnsupportedError`."""
        names = constraint.variables
        apart = {self._owners.get(name) for name in names}
        if constraint.model == ConstraintModel.PKC or not len(names) == len(apart) == len(("one", "other")):
            problem = f"{robot} shares {constraint.name!r}, which is not over one variable of each of two robots"
            raise UnsupportedError(f"{problem} (in a list of tasks: delete after:, and robots: of tasks)")
        return names[0], names[1]

    def pairs(self, constraint: Constraint, one: str, other: str) -> tuple[tuple[Pair, Cost], ...]:
        """Return the pairs of values of `one` and `other` that have costs (infinite or of congestion), and these costs.

        Raises:
            UnsupportedError: if congestion is not allowed, or there are too many pairs.
        """
        columns = self._column(one), self._column(other)
        size = len(columns[0]) * len(columns[1])
        self.checks += size
        if size > MAX_TUPLES:
            raise UnsupportedError(f"{constraint.name!r} has {size:,} pairs of values, more than {MAX_TUPLES:,}")
        place = {one: 0, other: 1}
        terms = tuple([place[term] if isinstance(term, str) else (term,) for term in constraint.parameters])
        key = self._definition(constraint), constraint.cost, terms, id(columns[0]), id(columns[1])
        if key not in self._found:
            costs = _EVALUATIONS.costs(constraint, (one, other), terms, columns)
            self._refuse_costs(constraint, (one, other), costs)
            self._found[key] = costs
        return self._found[key]

    def _definition(self, constraint: Constraint) -> int:
        """Return an id of the definition of `constraint`, the same for equal definitions."""
        known = id(constraint.definition)
        if known not in self._definitions:
            self._definitions[known] = id(
                self._same_definition.setdefault(constraint.definition, constraint.definition)
            )
        return self._definitions[known]

    def _column(self, name: str) -> Column:
        """Return the values of a variable, the same object for variables with equal values."""
        if name not in self._columns:
            column = tuple(self._domains[name])
            self._columns[name] = self._same.setdefault(column, column)
        return self._columns[name]

    def _refuse_costs(self, constraint: Constraint, names: tuple[str, str], costs: Iterable[tuple[Pair, Cost]]) -> None:
        finite = [one for one in costs if one[1] != INFINITE]
        if finite and not self._congestion:
            (value, theirs), cost = min(finite)
            raise UnsupportedError(
                f"{constraint.name!r} costs {cost} for {names[0]} = {value} and {names[1]} = {theirs}: it is not only"
                " an exclusion"
            )


class _Row(NamedTuple):
    """The costs of one value of a variable with the evaluated values of another variable.

    Attributes:
        columns: The numbers of the columns whose values have all been evaluated.
        evaluated: The evaluated values of the other variable.
        costs: The costs that are not 0, by the value of the other variable.
    """

    columns: set[int]
    evaluated: set[int]
    costs: dict[int, Cost]


class Evaluations:
    """A cache of costs for the robots in a process, because equal constraints occur in many files.

    Args:
        most: The number of pairs of values at which the cache is cleared.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._size = 0
        self._rows: dict[tuple[object, ...], dict[int, _Row]] = {}
        self._columns: dict[Column, int] = {}

    def costs(
        self,
        constraint: Constraint,
        names: tuple[str, str],
        terms: tuple[object, ...],
        columns: tuple[Column, Column],
    ) -> tuple[tuple[Pair, Cost], ...]:
        """Return the pairs of values in `columns` that have costs, and these costs."""
        rows = self._rows.setdefault((constraint.definition, constraint.cost, terms), {})
        others, cost_of = columns[1], cost_function(constraint, names)
        number, wanted = self._columns.setdefault(others, len(self._columns)), frozenset(others)
        found: list[tuple[Pair, Cost]] = []
        for one in columns[0]:
            row = rows.setdefault(one, _Row(set(), set(), {}))
            if number not in row.columns:
                new = wanted - row.evaluated
                row.costs.update({other: cost for other in sorted(new) if (cost := cost_of((one, other)))})
                row.evaluated.update(new)
                row.columns.add(number)
                self._size += len(new)
            found += [((one, other), cost) for other, cost in row.costs.items() if other in wanted]
        if self._size > self._most:
            self._size = 0
            self._rows.clear()
            self._columns.clear()
        return tuple(found)


_EVALUATIONS = Evaluations(most=1 << 20)


def _by_robot(
    partners: Iterable[tuple[str, Choice]],
    rank: Mapping[str, int],
    same: dict[frozenset[Choice], frozenset[Choice]],
) -> dict[str, frozenset[Choice]]:
    """Return the choices by robot, in priority order. Equal sets of choices are the same object."""
    found: dict[str, set[Choice]] = {}
    for robot, choice in partners:
        found.setdefault(robot, set()).add(choice)
    sets = {robot: frozenset(found[robot]) for robot in sorted(found, key=rank.__getitem__)}
    return {robot: same.setdefault(choices, choices) for robot, choices in sets.items()}
