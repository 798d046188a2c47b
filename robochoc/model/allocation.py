"""Task allocation as a problem of costs (Gerkey and Mataric, IJRR 23, 2004).

The profit of a task for a robot is its worth minus the distance to it. The sum of profits is maximised. Two models:

- `assignment`: a robot does at most one task. It has one variable: its task, or 0.
- `several`: a robot does several tasks, within its capacity. It has a variable for each task that it can do: 1 if it
  does it, else 0.

In both, a task is done by at most one robot, unless it requires several (only in `several`): then by exactly so many,
or by none. Profits are private; robots share only the constraints that exclude each other.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from math import floor, isqrt
from typing import cast

from robochoc.model.constraint import Constraint, Domain, Predicate, Relation, Semantics, Variable
from robochoc.model.expression import Apply, Constant, Expression, Name, Type, parse, total

NOT_THE_SAME = Predicate("notSame", ("X", "Y"), parse("or(eq(X, 0), ne(X, Y))", ("X", "Y"), Type.BOOLEAN))
"""Two robots do not do the same task; 0 means no task."""
NOT_BOTH = Predicate("notBoth", ("X", "Y"), parse("or(eq(X, 0), eq(Y, 0))", ("X", "Y"), Type.BOOLEAN))
_DONE = Domain("Done", (range(2),))

Parts = tuple[dict[str, list[Variable]], Iterator[Constraint]]
"""The variables of each robot, and the constraints."""


class TasksModel(StrEnum):
    """The model of a task allocation: one task for each robot (`assignment`), or `several`."""

    ASSIGNMENT = "assignment"
    SEVERAL = "several"


class Distance(StrEnum):
    """The measure of distances: along streets (Manhattan's), or straight."""

    STREETS = "streets"
    STRAIGHT = "straight"


@dataclass(frozen=True)
class Worker:
    """A robot that tasks are allocated to.

    Attributes:
        name: Its name.
        label: Its label in the names of constraints.
        variable: In `assignment` its variable; in `several` the first part of the names of its variables.
        profit: The profit of each task that it can do.
        capacity: Its maximum load. None: unlimited.
        most: The maximum number of its tasks. None: unlimited.
        together: The additional profit of pairs of tasks, if it does both.
        tours: The length of the tour of each set of tasks that it can do together, by their numbers. With tours,
            `profit` does not include distances; tasks in no tour have no place.
        has_deadlines: Whether it can do only these sets of tasks, because they have deadlines.
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
    """The data of a task that all robots know.

    Attributes:
        name: The last part of the names of its variables in `several`.
        load: Its load.
        robots: The number of robots that it requires.
    """

    name: str
    load: int = 1
    robots: int = 1


def assignment(workers: Sequence[Worker], symbols: tuple[str, ...] = ()) -> Parts:
    """Return the model in which a robot does at most one task.

    Args:
        workers: The robots.
        symbols: The names for no task and for the tasks from number 1 on. Without them, values are numbers.
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
    """Return the distance between two places in units of 10**-places, rounded, halves up."""
    # Whole numbers stay integers, which are several times as fast.
    parts = cast("list[Fraction]", [abs(one - other) for one, other in zip(start, end, strict=True)])
    unit: int = 10**places
    if distance == Distance.STREETS:
        return floor(2 * sum(parts) * unit + 1) // 2
    square = sum(part * part for part in parts) * unit**2
    return (isqrt(floor(4 * square)) + 1) // 2


def _does(one: Worker, job: TaskSpec) -> str:
    return f"{one.variable}.{job.name}"


def _limits(one: Worker, jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the constraints on the load, and on the number of tasks, of a robot, if they restrict it."""
    scope = tuple(_does(one, jobs[task]) for task in one.profit)
    if one.capacity is not None:
        loads = [jobs[task].load for task in one.profit]
        yield Constraint("room", _at_most(f"room{one.label}", loads, one.capacity), scope, scope)
    if one.most is not None and one.most < len(scope):
        yield Constraint("most", _at_most(f"most{one.label}", [1] * len(scope), one.most), scope, scope)


def _tours(one: Worker, jobs: Mapping[int, TaskSpec]) -> Iterator[Constraint]:
    """Yield the costs of tours, and the constraint on sets of tasks that a robot has time for."""
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
    """Yield, for each task that requires several robots, the constraint that so many robots do it, or none."""
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
