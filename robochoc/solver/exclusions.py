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

import itertools
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from robochoc.model.problem import INFINITE, Constraint, ConstraintModel, Domain, Team
from robochoc.solver.agent_problem import AgentProblem
from robochoc.solver.encoding import MAX_TUPLES, Cost, UnsupportedError, cost_function
from robochoc.solver.explanation import held_above

Choice = tuple[int, int]
"""A variable's place among those that its robot shows, and one of its values."""
Pair = tuple[int, int]
"""Values of two variables."""
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
    exclusions = _Exclusions(known.owners, known.domains, congestion=congestion)
    for constraint in (one.constraint for one in (*held_above(part.robot), *part.copies)):
        one, other = exclusions.scope(constraint, own)
        if known.owners[other] == own:
            one, other = other, one
        for (value, theirs), cost in exclusions.pairs(constraint, one, other):
            partner = known.owners[other], (place[other], theirs)
            own_choice = excluded[place[one], value]
            own_choice[partner] = cost + own_choice.get(partner, 0)
    together: dict[frozenset[tuple[tuple[str, Choice], Cost]], list[Choice]] = {}
    for choice in sorted(excluded):
        together.setdefault(frozenset(excluded[choice].items()), []).append(choice)
    return exclusions.checks, tuple(_task(choices, dict(partners), part) for partners, choices in together.items())


def _task(choices: list[Choice], partners: Partners, part: AgentProblem) -> Task:
    costs = {*partners.values()}
    if len(costs) > 1:
        raise UnsupportedError(
            f"{part.robot.name} shares a task that costs {min(costs)} with one robot, and {max(costs)} with another"
        )
    return Task(tuple(choices), _by_robot(partners, part.known.rank), costs.pop())


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
            return f"{team.owner[name]} cannot leave all tasks to others: each value of {name} excludes another robot's"
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
    """Finds what constraints forbid, and counts the checks. Constraints that say the same are evaluated once."""

    def __init__(self, owners: Mapping[str, str], domains: Mapping[str, Domain], *, congestion: bool) -> None:
        self.checks = 0
        self._congestion = congestion
        self._owners = owners
        self._domains = domains
        self._found: dict[tuple[object, ...], tuple[tuple[Pair, Cost], ...]] = {}

    def scope(self, constraint: Constraint, robot: str) -> tuple[str, str]:
        """Return the two variables of a `constraint` that `robot` holds. Raises `UnsupportedError`."""
        names = constraint.variables
        apart = {self._owners.get(name) for name in names}
        if constraint.model is ConstraintModel.PKC or not len(names) == len(apart) == len(("one", "other")):
            raise UnsupportedError(f"{robot} shares {constraint.name!r}, which is not over one variable of two robots")
        return names[0], names[1]

    def pairs(self, constraint: Constraint, one: str, other: str) -> tuple[tuple[Pair, Cost], ...]:
        """Return the values of `one` and `other` that cost something together, and how much: infinite, or congestion.

        Raises:
            UnsupportedError: where there must be no congestion, or there are too many pairs.
        """
        columns = tuple(self._domains[one]), tuple(self._domains[other])
        size = len(columns[0]) * len(columns[1])
        self.checks += size
        if size > MAX_TUPLES:
            raise UnsupportedError(f"{constraint.name!r} has {size:,} pairs of values, more than {MAX_TUPLES:,}")
        place = {one: 0, other: 1}
        terms = tuple([place[term] if isinstance(term, str) else (term,) for term in constraint.parameters])
        key = id(constraint.definition), constraint.cost, terms, columns
        if key not in self._found:
            pairs = itertools.product(*columns)
            self._found[key] = tuple(_costly(constraint, (one, other), pairs, congestion=self._congestion))
        return self._found[key]


def _costly(
    constraint: Constraint, names: tuple[str, str], pairs: Iterable[Pair], *, congestion: bool
) -> Iterator[tuple[Pair, Cost]]:
    cost_of = cost_function(constraint, names)
    for pair in pairs:
        cost = cost_of(pair)
        if cost == INFINITE or (cost and congestion):
            yield pair, cost
        elif cost:
            raise UnsupportedError(
                f"{constraint.name!r} costs {cost} for {names[0]} = {pair[0]} and {names[1]} = {pair[1]}: it is more"
                " than an exclusion"
            )


def _by_robot(partners: Iterable[tuple[str, Choice]], rank: Mapping[str, int]) -> dict[str, frozenset[Choice]]:
    found: dict[str, set[Choice]] = {}
    for robot, choice in sorted(partners, key=lambda one: (rank[one[0]], one[1])):
        found.setdefault(robot, set()).add(choice)
    return {robot: frozenset(choices) for robot, choices in found.items()}
