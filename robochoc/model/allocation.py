"""Task allocation modelled as a problem with costs (Gerkey and Mataric, IJRR 23, 2004).

The profit of a task for a robot is the task's worth minus its distance. The sum of profits is maximised. Two models:

- `assignment`: a robot does at most one task. It has one variable, whose value is its task, or 0.
- `several`: a robot does several tasks, within its capacity. It has a variable for each task that it can do, with the
  value 1 if it does the task and 0 otherwise.

In both models, at most one robot does a task. In `several`, a task may require several robots: then exactly that many
robots do it, or none. It may also require a coalition (`coalition.py`) whose robots start it at the same time. Profits
are private; robots share only the mutual exclusion constraints, and those on the robots and the starts of a task.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from fractions import Fraction
from functools import cached_property
from math import floor, isqrt
from typing import NamedTuple, cast

from robochoc.model.coalition import Kind, coalitions
from robochoc.model.constraint import Constraint, Domain, Predicate, Relation, Semantics, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name, Type, parse, total
from robochoc.system.lazy_dataclass import dataclass

NOT_THE_SAME = Predicate("notSame", ("X", "Y"), parse("or(eq(X, 0), ne(X, Y))", ("X", "Y"), Type.BOOLEAN))
"""Two robots do not do the same task. 0 means no task."""
NOT_BOTH = Predicate("notBoth", ("X", "Y"), parse("eq(mul(X, Y), 0)", ("X", "Y"), Type.BOOLEAN))
"""Not both values are 1. A product has no meaning without one of its robots, so the constraint is dropped with it."""
_DONE = Domain("Done", (range(2),))
TOUR = "tour"
"""The last part of the name of the variable with the number of a tour."""
START = "start"
"""The last part of the name of the variable with the start of a task."""
NOT_DONE = -1
"""The start of an ordered or joint task that the robot does not do."""
_NOT_DONE_BY_BOTH = f"or(eq(X, {NOT_DONE}), eq(Y, {NOT_DONE}))"
SAME_START = Predicate("sameStart", ("X", "Y"), parse(f"or({_NOT_DONE_BY_BOTH}, eq(X, Y))", ("X", "Y"), Type.BOOLEAN))
"""Two robots that do a joint task start it at the same time."""

Parts = tuple[dict[str, list[Variable]], Iterator[Constraint]]
"""The variables of each robot, and the constraints."""


class TasksModel(StrEnum):
    """The model of a task allocation: one task per robot (`assignment`), or `several`."""

    ASSIGNMENT = "assignment"
    SEVERAL = "several"


class Distance(StrEnum):
    """The measure of distances: along streets (Manhattan distance), or straight."""

    STREETS = "streets"
    STRAIGHT = "straight"


class Schedule(NamedTuple):
    """Tasks that a robot can do together.

    Attributes:
        tasks: The numbers of the tasks, in ascending order.
        starts: The starts of those tasks that are ordered (`Order`) or joint, with their numbers, in ascending order.
    """

    tasks: tuple[int, ...]
    starts: tuple[tuple[int, int], ...] = ()


class Order(NamedTuple):
    """Two ordered tasks: `after` is done only if `before` is done, and starts at least `gap` later."""

    before: int
    after: int
    gap: int


@dataclass(frozen=True)
class Worker:
    """A robot to which tasks are allocated.

    Attributes:
        name: Its name.
        label: Its label in the names of constraints.
        variable: In `assignment` the name of its variable; in `several` the first part of the names of its variables.
        profit: The profit of each task that the robot can do.
        capacity: Its maximum load. None: unlimited.
        most: The maximum number of tasks. None: unlimited.
        together: The additional profit of pairs of tasks if the robot does both.
        tours: The length of the tour for each schedule for which the robot has time and capacity. With tours, `profit`
            does not include distances; tasks in no tour have no location and no times. Tours are numbered from 1.
        skills: Its skills, of those that tasks require of single members of their teams.
    """

    name: str
    label: str
    variable: str
    profit: Mapping[int, int]
    capacity: int | None = None
    most: int | None = None
    together: Mapping[tuple[int, int], int] = field(default_factory=dict)
    tours: Mapping[Schedule, int] = field(default_factory=dict)
    skills: Kind = frozenset()

    @cached_property
    def scheduled(self) -> tuple[int, ...]:
        """The tasks that are part of tours."""
        known = {task for schedule in self.tours for task in schedule.tasks}
        return tuple(task for task in self.profit if task in known)

    @property
    def all_scheduled(self) -> bool:
        """True if all tasks are part of tours, which then are within the robot's capacity."""
        return bool(self.tours) and len(self.scheduled) == len(self.profit)


@dataclass(frozen=True)
class TaskSpec:
    """The data of a task, known to all robots.

    Attributes:
        name: The last part of the names of the task's variables in `several`.
        load: Its load.
        robots: The number of robots that the task requires.
        team: The number of these robots that have a skill, by skill. A robot counts for one skill. Empty: any robots.
        is_joint: True if its robots start it at the same time.
    """

    name: str
    load: int = 1
    robots: int = 1
    team: Mapping[str, int] = field(default_factory=dict)
    is_joint: bool = False


def assignment(workers: Sequence[Worker], symbols: tuple[str, ...] = ()) -> Parts:
    """Return the model in which a robot does at most one task.

    Args:
        workers: The robots.
        symbols: The names for no task and for the tasks from number 1 on. None: values are numbers.
    """
    variables = {
        one.name: [
            Variable(one.variable, Domain("Tasks", tuple(range(task, task + 1) for task in (0, *one.profit)), symbols))
        ]
        for one in workers
    }

    def constraints() -> Iterator[Constraint]:
        for one in workers:
            yield _worth(one.label, one.variable, one.profit)
        for one, other in itertools.combinations(workers, 2):
            if not one.profit.keys().isdisjoint(other.profit):
                scope = (one.variable, other.variable)
                yield Constraint("notSame", NOT_THE_SAME, scope, scope)

    return variables, constraints()


def several_tasks(workers: Sequence[Worker], jobs: Mapping[int, TaskSpec], orders: Sequence[Order] = ()) -> Parts:
    """Return the model in which a robot does several tasks. Robots that can do no task are left out.

    Args:
        workers: The robots.
        jobs: The tasks, by number.
        orders: The pairs of ordered tasks. A robot has another variable for each such task, and for each joint task:
            its start, or `NOT_DONE`.
    """
    able = [one for one in workers if one.profit]
    starts = {one.name: _starts(one) for one in able}
    variables = {
        one.name: [Variable(_does(one, jobs[task]), _DONE) for task in one.profit]
        + [Variable(_start(one, jobs[task]), domain) for task, domain in starts[one.name].items()]
        + [Variable(tour_variable(one), Domain("Tours", (range(len(one.tours) + 1),))) for _ in one.scheduled[:1]]
        for one in able
    }

    def constraints() -> Iterator[Constraint]:
        for one in able:
            for task, worth in one.profit.items():
                yield _worth(f"{one.label}.{jobs[task].name}", _does(one, jobs[task]), {1: worth})
            if not one.all_scheduled:
                yield from _limits(one, jobs)
            yield from _tours(one, jobs, [*starts[one.name]])
            for (first, second), worth in one.together.items():
                scope = (_does(one, jobs[first]), _does(one, jobs[second]))
                relation = Relation(f"S{'.'.join(scope)}", 2, Semantics.SOFT, ((1, 1),), (worth,))
                yield Constraint(relation.name, relation, scope, scope)
        yield from _crews(able, jobs)
        yield from _joint_starts(starts, able, jobs)
        for order in orders:
            yield from _order(order, able, jobs)
        for one, other in itertools.combinations(able, 2):
            for task in one.profit:
                if task in other.profit and jobs[task].robots == 1:
                    names = (_does(one, jobs[task]), _does(other, jobs[task]))
                    yield Constraint("notBoth", NOT_BOTH, names, names)

    return variables, constraints()


def distance_between(
    start: Sequence[int | Fraction], end: Sequence[int | Fraction], distance: Distance, places: int
) -> int:
    """Return the distance between two locations in units of 10**-places, rounded half up."""
    # Whole numbers stay integers, for which the computation is several times as fast.
    parts = cast("list[Fraction]", [abs(one - other) for one, other in zip(start, end, strict=True)])
    unit: int = 10**places
    if distance == Distance.STREETS:
        return floor(2 * sum(parts) * unit + 1) // 2
    square = sum(part * part for part in parts) * unit**2
    return (isqrt(floor(4 * square)) + 1) // 2


def _does(one: Worker, job: TaskSpec) -> str:
    return f"{one.variable}.{job.name}"


def tour_variable(one: Worker) -> str:
    """Return the name of the variable with the number of a robot's tour; 0 is the tour without tasks."""
    return f"{one.variable}.{TOUR}"


def _start(one: Worker, job: TaskSpec) -> str:
    return f"{_does(one, job)}.{START}"


def _starts(one: Worker) -> dict[int, Domain]:
    """Return the domain of the start of each ordered or joint task that the robot can do."""
    found: dict[int, set[int]] = {}
    for schedule in one.tours:
        for task, start in schedule.starts:
            found.setdefault(task, {NOT_DONE}).add(start)
    return {
        task: Domain(f"Starts{task}", tuple(range(start, start + 1) for start in sorted(found[task])))
        for task in sorted(found)
    }


def _order(order: Order, able: Sequence[Worker], jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the constraints on two ordered tasks: the first one is done if the second one is, and ends before it."""
    first, last = jobs[order.before], jobs[order.after]
    before = [one for one in able if order.before in one.profit]
    after = [one for one in able if order.after in one.profit]
    scope = (*(_does(one, first) for one in before), *(_does(one, last) for one in after))
    names = _parameters(len(scope))
    sums = [total(map(Name, some)) for some in (names[: len(before)], names[len(before) :])]
    body = Apply("or", (Apply("eq", (sums[1], Constant(0))), Apply("gt", (sums[0], Constant(0)))))
    label = f"{first.name}.{last.name}"
    yield Constraint("needs", Predicate(f"needs{label}", names, body), scope, scope)
    ends = parse(f"or({_NOT_DONE_BY_BOTH}, ge(Y, add(X, {order.gap})))", ("X", "Y"), Type.BOOLEAN)
    follows = Predicate(f"follows{order.gap}", ("X", "Y"), ends)
    for one, other in itertools.product(before, after):
        pair = (_start(one, first), _start(other, last))
        yield Constraint("follows", follows, pair, pair)


def _limits(one: Worker, jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the constraints on a robot's load and number of tasks, as far as they restrict the robot."""
    scope = tuple(_does(one, jobs[task]) for task in one.profit)
    if one.capacity is not None:
        loads = [jobs[task].load for task in one.profit]
        yield Constraint("room", _at_most(f"room{one.label}", loads, one.capacity), scope, scope)
    if one.most is not None and one.most < len(scope):
        yield Constraint("most", _at_most(f"most{one.label}", [1] * len(scope), one.most), scope, scope)


def _tours(one: Worker, jobs: Mapping[int, TaskSpec], ordered: Sequence[int]) -> Iterator[Constraint]:
    """Yield the constraint that the robot does the tasks of its tour, and the costs of tours.

    Args:
        one: The robot.
        jobs: The tasks, by number.
        ordered: The tasks with a start.
    """
    placed = one.scheduled
    if not placed:
        return
    does = (*(_does(one, jobs[task]) for task in placed), *(_start(one, jobs[task]) for task in ordered))
    rows = [(0, *[0] * len(placed), *[NOT_DONE] * len(ordered))]
    for number, schedule in enumerate(one.tours, start=1):
        starts = dict(schedule.starts)
        done = [int(task in schedule.tasks) for task in placed]
        rows.append((number, *done, *[starts.get(task, NOT_DONE) for task in ordered]))
    tour = tour_variable(one)
    chosen = Relation(f"tour{one.label}", 1 + len(does), Semantics.SUPPORTS, tuple(rows))
    yield Constraint("tour", chosen, (tour, *does), (tour, *does))
    lengths = tuple(-length for length in one.tours.values())
    numbers = tuple((number,) for number in range(1, len(lengths) + 1))
    cost = Relation(f"way{one.label}", 1, Semantics.SOFT, numbers, lengths)
    yield Constraint("way", cost, (tour,), (tour,))


def _at_most(name: str, loads: Sequence[int], most: int) -> Predicate:
    names = _parameters(len(loads))
    terms = [_multiple(load, one) for load, one in zip(loads, names, strict=True)]
    return Predicate(name, names, Apply("le", (total(terms), Constant(most))))


def _multiple(number: int, name: str) -> Expression:
    return Name(name) if number == 1 else Apply("mul", (Constant(number), Name(name)))


def _crews(able: Sequence[Worker], jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield, for each task that requires several robots, the constraint that a coalition does it, or none."""
    for task, job in jobs.items():
        crew = [one for one in able if task in one.profit]
        if job.robots > 1 and crew:
            scope = tuple(_does(one, job) for one in crew)
            names = _parameters(len(scope))
            weights, sums = coalitions([one.skills.intersection(job.team) for one in crew], job.team, job.robots)
            number = total(_multiple(weight, name) for weight, name in zip(weights, names, strict=True))
            body = Apply("in", (number, *map(Constant, (0, *sums))))
            yield Constraint("crew", Predicate(f"crew{job.name}", names, body), scope, scope)


def _joint_starts(
    starts: Mapping[str, Mapping[int, Domain]], able: Sequence[Worker], jobs: Mapping[int, TaskSpec]
) -> Iterator[Constraint]:
    """Yield the constraints that the robots of a joint task start it at the same time."""
    for task, job in jobs.items():
        waiting = [_start(one, job) for one in able if job.is_joint and task in starts[one.name]]
        for pair in itertools.combinations(waiting, 2):
            yield Constraint("sameStart", SAME_START, pair, pair)


def _parameters(number: int) -> tuple[str, ...]:
    return tuple(f"X{place}" for place in range(1, number + 1))


def _worth(label: str, variable: str, profit: Mapping[int, int]) -> Constraint:
    relation = Relation(f"U{label}", 1, Semantics.SOFT, tuple((task,) for task in profit), tuple(profit.values()))
    return Constraint(relation.name, relation, (variable,), (variable,))
