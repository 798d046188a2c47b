"""Exclusions: what is done by one robot at most, as a team's constraints say it.

A *choice* is a value of a variable. Two choices of two robots exclude each other if a constraint between these robots
forbids them together: `V1 = 3` and `V2 = 3` where no two robots do task 3. A team is a *task allocation* if

- all that robots share are such constraints, each over one variable of two robots, which cost nothing;
- choices that exclude each other, directly or through others, all do, but for those of one robot: they are the ways to
  do one thing, which is done by one robot at most (a *task*);
- each variable that robots show each other has a value that is no such choice: a robot can leave all tasks to others.

With *congestion* several robots may do a task, each pair of them at a cost, the same for all pairs of the task. What
excludes is the same at an infinite cost.

A robot needs its own constraints alone to know its tasks, and who else can do them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from robochoc.model.constraint import Definition
from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Domain, Team
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import MAX_TUPLES, Cost, UnsupportedError, cost_function
from robochoc.solver.explanation import held_above

Choice = tuple[int, int]
"""A variable's place among those that its robot shows, and one of its values."""
Pair = tuple[int, int]
"""Values of two variables."""
Column = tuple[int, ...]
"""The values of a variable."""
Partners = dict[tuple[str, Choice], Cost]
"""Choices of other robots, and what they cost together with one of this robot."""


class Task(NamedTuple):
    """Something that is done by one robot at most; or by several, each pair of them at a `cost`.

    Attributes:
        own: The choices of this robot that do it.
        others: The choices of each other robot that do it. Robots stand in priority order.
        cost: What each pair of robots that does it costs.
    """

    own: tuple[Choice, ...]
    others: Mapping[str, frozenset[Choice]]
    cost: Cost = INFINITE


def tasks_of(part: AgentProblem, *, congestion: bool = False) -> tuple[int, tuple[Task, ...]]:
    """Return the number of constraint checks, and the tasks of the robot of `part`, by their first own choices.

    A check for each pair of values of each constraint. The constraints of lower robots have to be among `part.copies`.

    Args:
        part: The robot's problem.
        congestion: Whether several robots may do a task at a cost.

    Raises:
        UnsupportedError: when a constraint that the robot shares is no exclusion.
    """
    known, own = part.known, part.robot.name
    place = {name: at for names in known.interfaces.values() for at, name in enumerate(names)}
    excluded: dict[Choice, Partners] = defaultdict(dict)
    choices: dict[Choice, Choice] = {}
    exclusions = _Exclusions(known.owners, known.domains, congestion=congestion)
    for constraint in (one.constraint for one in (*held_above(part.robot), *part.copies)):
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
) -> Task:
    costs = {*partners.values()}
    if len(costs) > 1:
        raise UnsupportedError(
            f"{part.robot.name} shares a task that costs {min(costs)} with one robot, and {max(costs)} with another"
        )
    return Task(tuple(choices), _by_robot(partners, part.known.rank, same), costs.pop())


def allocation_fault(team: Team, *, congestion: bool = False) -> str:
    """Return why `team` is no task allocation, or with `congestion` none where that is allowed; empty if it is one."""
    variables = {name: variable.domain for name, variable in team.variables.items()}
    exclusions = _Exclusions(team.owner, variables, congestion=congestion)
    excluded: dict[tuple[str, int], dict[tuple[str, int], Cost]] = defaultdict(dict)
    held = [(robot.name, one.constraint) for robot in team.robots for one in held_above(robot)]
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
                " as where a task asks for several robots"
            )
    return _scattered(excluded, team.owner)


def _scattered(excluded: Mapping[tuple[str, int], Mapping[tuple[str, int], Cost]], owner: Mapping[str, str]) -> str:
    """Return which two choices do not exclude each other although others link them; empty if there are none.

    Or which cost something else together than those that link them.
    """
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
                return f"{pair} do not exclude each other, though both exclude what others do"
    return ""


class _Exclusions:
    """Finds what constraints forbid, and counts the checks. Constraints that say the same are evaluated once.

    So they are in a process: robots whose files say the same evaluate it once together. Each counts its own checks.
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
        """Return the two variables of a `constraint` that `robot` holds. Raises `UnsupportedError`."""
        names = constraint.variables
        apart = {self._owners.get(name) for name in names}
        if constraint.model == ConstraintModel.PKC or not len(names) == len(apart) == len(("one", "other")):
            raise UnsupportedError(f"{robot} shares {constraint.name!r}, which is not over one variable of two robots")
        return names[0], names[1]

    def pairs(self, constraint: Constraint, one: str, other: str) -> tuple[tuple[Pair, Cost], ...]:
        """Return the values of `one` and `other` that cost something together, and how much: infinite, or congestion.

        Raises:
            UnsupportedError: where there must be no congestion, or there are too many pairs.
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
        """Return what stands for the definition of `constraint`: the same for all that say the same."""
        known = id(constraint.definition)
        if known not in self._definitions:
            self._definitions[known] = id(
                self._same_definition.setdefault(constraint.definition, constraint.definition)
            )
        return self._definitions[known]

    def _column(self, name: str) -> Column:
        """Return the values of a variable: the same object for variables of the same values."""
        if name not in self._columns:
            column = tuple(self._domains[name])
            self._columns[name] = self._same.setdefault(column, column)
        return self._columns[name]

    def _refuse_costs(self, constraint: Constraint, names: tuple[str, str], costs: Iterable[tuple[Pair, Cost]]) -> None:
        finite = [one for one in costs if one[1] != INFINITE]
        if finite and not self._congestion:
            (value, theirs), cost = min(finite)
            raise UnsupportedError(
                f"{constraint.name!r} costs {cost} for {names[0]} = {value} and {names[1]} = {theirs}: it is more than"
                " an exclusion"
            )


class _Row(NamedTuple):
    """The costs of one value of a variable with values of another one, as far as they were evaluated.

    Attributes:
        columns: The numbers of the columns whose values were all evaluated.
        evaluated: The values that were.
        costs: What they cost, if they cost something.
    """

    columns: set[int]
    evaluated: set[int]
    costs: dict[int, Cost]


class Evaluations:
    """The costs of definitions, kept for the robots of a process: the same constraint stands in many files.

    Args:
        most: Of more pairs of values nothing is kept.
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
        """Return the pairs of values of `columns` that cost something, and how much."""
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
    """Return the choices by robot, in priority order. Sets of the same choices are the same object."""
    found: dict[str, set[Choice]] = {}
    for robot, choice in partners:
        found.setdefault(robot, set()).add(choice)
    sets = {robot: frozenset(found[robot]) for robot in sorted(found, key=rank.__getitem__)}
    return {robot: same.setdefault(choices, choices) for robot, choices in sets.items()}
