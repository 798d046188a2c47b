"""Task allocation modelled as a problem with costs (Gerkey and Mataric, IJRR 23, 2004).

The profit of a task for a robot is the task's worth minus its distance. The sum of profits is maximised. Two models:

- `assignment`: a robot does at most one task. It has one variable, whose value is its task, or 0.
- `several`: a robot does several tasks, within its capacity. It has a variable for each task that it can do, with the
  value 1 if it does the task and 0 otherwise.

In both models, at most one robot does a task. In `several`, a task may require several robots: then exactly that many
robots do it, or none. Profits are private; robots share only the mutual exclusion constraints.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from fractions import Fraction
from math import floor, isqrt
from typing import cast

from robochoc.model.constraint import Constraint, Domain, Predicate, Relation, Semantics, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name, Type, parse, total
from robochoc.system.lazy_dataclass import dataclass

NOT_THE_SAME = Predicate("notSame", ("X", "Y"), parse("or(eq(X, 0), ne(X, Y))", ("X", "Y"), Type.BOOLEAN))
"""Two robots do not do the same task. 0 means no task."""
NOT_BOTH = Predicate("notBoth", ("X", "Y"), parse("or(eq(X, 0), eq(Y, 0))", ("X", "Y"), Type.BOOLEAN))
_DONE = Domain("Done", (range(2),))

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
        tours: The length of the tour for each set of tasks that the robot can do together, by task numbers. With tours,
            `profit` does not include distances; tasks in no tour have no location.
        has_deadlines: True if the robot can do only these sets of tasks, because the tasks have deadlines.
    """

    name: str
    label: str
    variable: str
    profit: Mapping[int, int]
    capacity: int | None = None
    most: int | None = None
    together: Mapping[tuple[int, int], int] = field(default_factory=dict)
    tours: Mapping[tuple[int, ...], int] = field(default_factory=dict)
    has_deadlines: bool = False


@dataclass(frozen=True)
class TaskSpec:
    """The data of a task, known to all robots.

    Attributes:
        name: The last part of the names of the task's variables in `several`.
        load: Its load.
        robots: The number of robots that the task requires.
    """

    name: str
    load: int = 1
    robots: int = 1


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


def several_tasks(workers: Sequence[Worker], jobs: Mapping[int, TaskSpec]) -> Parts:
    """Return the model in which a robot does several tasks. Robots that can do no task are left out."""
    able = [one for one in workers if one.profit]
    variables = {one.name: [Variable(_does(one, jobs[task]), _DONE) for task in one.profit] for one in able}

    def constraints() -> Iterator[Constraint]:
        for one in able:
            for task, worth in one.profit.items():
                yield _worth(f"{one.label}.{jobs[task].name}", _does(one, jobs[task]), {1: worth})
            yield from _limits(one, jobs)
            yield from _tours(one, jobs)
            for (first, second), worth in one.together.items():
                scope = (_does(one, jobs[first]), _does(one, jobs[second]))
                relation = Relation(f"S{'.'.join(scope)}", 2, Semantics.SOFT, ((1, 1),), (worth,))
                yield Constraint(relation.name, relation, scope, scope)
        yield from _crews(able, jobs)
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


def _limits(one: Worker, jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the constraints on a robot's load and number of tasks, as far as they restrict the robot."""
    scope = tuple(_does(one, jobs[task]) for task in one.profit)
    if one.capacity is not None:
        loads = [jobs[task].load for task in one.profit]
        yield Constraint("room", _at_most(f"room{one.label}", loads, one.capacity), scope, scope)
    if one.most is not None and one.most < len(scope):
        yield Constraint("most", _at_most(f"most{one.label}", [1] * len(scope), one.most), scope, scope)


def _tours(one: Worker, jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the costs of tours, and the constraint on the sets of tasks for which a robot has time."""
    placed = [task for task in one.profit if (task,) in one.tours]
    scope = tuple(_does(one, jobs[task]) for task in placed)
    if not scope:
        return
    rows = {tuple([int(task in tour) for task in placed]): -length for tour, length in one.tours.items()}
    cost = Relation(f"tour{one.label}", len(scope), Semantics.SOFT, tuple(rows), tuple(rows.values()))
    yield Constraint("tour", cost, scope, scope)
    if one.has_deadlines:
        able = ((0,) * len(scope), *rows)
        yield Constraint("time", Relation(f"time{one.label}", len(scope), Semantics.SUPPORTS, able), scope, scope)


def _at_most(name: str, loads: Sequence[int], most: int) -> Predicate:
    names = _parameters(len(loads))
    terms: list[Expression] = [
        Apply("mul", (Constant(load), Name(one))) for load, one in zip(loads, names, strict=True)
    ]
    return Predicate(name, names, Apply("le", (total(terms), Constant(most))))


def _crews(able: Sequence[Worker], jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield, for each task that requires several robots, the constraint that exactly so many robots do it, or none."""
    for task, job in jobs.items():
        scope = tuple(_does(one, job) for one in able if task in one.profit)
        if job.robots > 1 and scope:
            names = _parameters(len(scope))
            number = total(map(Name, names))
            body = Apply("or", tuple(Apply("eq", (number, Constant(crew))) for crew in (0, job.robots)))
            yield Constraint("crew", Predicate(f"crew{job.name}", names, body), scope, scope)


def _parameters(number: int) -> tuple[str, ...]:
    return tuple(f"X{place}" for place in range(1, number + 1))


def _worth(label: str, variable: str, profit: Mapping[int, int]) -> Constraint:
    relation = Relation(f"U{label}", 1, Semantics.SOFT, tuple((task,) for task in profit), tuple(profit.values()))
    return Constraint(relation.name, relation, (variable,), (variable,))
