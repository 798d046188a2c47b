"""Task allocation as a problem of costs: who does which task (Gerkey and Mataric, IJRR 23, 2004).

What a task brings a robot is what it is worth, less the way there. The sum of what is done is maximised. Two models:

- `assignment`: a robot does one task at most. It has one variable: its task, or 0.
- `several`: a robot does as many as it has room for. It has a variable for each task that it could do: 1, it does it.

In both a task is done by one robot at most, unless it asks for several (in `several` alone): then by all of these, or
by none. Each robot alone knows what tasks bring it; what robots share is that they exclude each other.
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
"""Two robots do not do the same task; 0 is none."""
NOT_BOTH = Predicate("notBoth", ("X", "Y"), parse("or(eq(X, 0), eq(Y, 0))", ("X", "Y"), Type.BOOLEAN))
_DONE = Domain("Done", (range(2),))

Parts = tuple[dict[str, list[Variable]], Iterator[Constraint]]
"""The variables of each robot, and the constraints."""


class TasksModel(StrEnum):
    """The model of a task allocation: one task for each robot (`assignment`), or `several`."""

    ASSIGNMENT = "assignment"
    SEVERAL = "several"


class Distance(StrEnum):
    """The measure of a way: along streets (Manhattan's), or straight."""

    STREETS = "streets"
    STRAIGHT = "straight"


@dataclass(frozen=True)
class Worker:
    """A robot that tasks are allocated to.

    Attributes:
        name: Its name.
        label: What stands for it in the names of constraints.
        variable: In `assignment` its variable; in `several` the first part of the names of its variables.
        profit: What each task that it can do brings it.
        capacity: The room that it has; None: for any load.
        most: The number of tasks that it does at most; None: any.
        together: What pairs of tasks bring besides when it does both.
        tours: The length of the tour of each set of tasks that it can do together, by their numbers. With tours,
            `profit` has no ways in it; tasks that are in none have no place.
        hurries: Whether it can do no other sets of these tasks, as they have deadlines.
    """

    name: str
    label: str
    variable: str
    profit: Mapping[int, int]
    capacity: int | None = None
    most: int | None = None
    together: Mapping[tuple[int, int], int] = field(default_factory=dict)
    tours: Mapping[tuple[int, ...], int] = field(default_factory=dict)
    hurries: bool = False


@dataclass(frozen=True)
class Job:
    """A task, as far as all robots know it.

    Attributes:
        name: The last part of the names of its variables in `several`.
        load: The room that it takes.
        robots: The number of robots that it asks for.
    """

    name: str
    load: int = 1
    robots: int = 1


def assignment(workers: Sequence[Worker], symbols: tuple[str, ...] = ()) -> Parts:
    """Return the model in which a robot does one task at most.

    Args:
        workers: The robots.
        symbols: The names of none and of the tasks, from number 1 on; without them values are numbers.
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


def several(workers: Sequence[Worker], jobs: Mapping[int, Job]) -> Parts:
    """Return the model in which a robot does several tasks; a robot that can do none is left out."""
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


def way(start: Sequence[int | Fraction], end: Sequence[int | Fraction], distance: Distance, places: int) -> int:
    """Return the length of a way in units of 10**-places, rounded, halves up."""
    # Whole numbers stay integers, which are several times as fast.
    parts = cast("list[Fraction]", [abs(one - other) for one, other in zip(start, end, strict=True)])
    unit: int = 10**places
    if distance == Distance.STREETS:
        return floor(2 * sum(parts) * unit + 1) // 2
    square = sum(part * part for part in parts) * unit**2
    return (isqrt(floor(4 * square)) + 1) // 2


def _does(one: Worker, job: Job) -> str:
    return f"{one.variable}.{job.name}"


def _limits(one: Worker, jobs: Mapping[int, Job]) -> Iterator[Constraint]:
    """Yield what a robot has room for, and how many tasks it does at most, if that says anything."""
    scope = tuple(_does(one, jobs[task]) for task in one.profit)
    if one.capacity is not None:
        loads = [jobs[task].load for task in one.profit]
        yield Constraint("room", _at_most(f"room{one.label}", loads, one.capacity), scope, scope)
    if one.most is not None and one.most < len(scope):
        yield Constraint("most", _at_most(f"most{one.label}", [1] * len(scope), one.most), scope, scope)


def _tours(one: Worker, jobs: Mapping[int, Job]) -> Iterator[Constraint]:
    """Yield what tours cost, and which sets of tasks a robot has time for."""
    placed = [task for task in one.profit if (task,) in one.tours]
    scope = tuple(_does(one, jobs[task]) for task in placed)
    if not scope:
        return
    rows = {tuple([int(task in tour) for task in placed]): -length for tour, length in one.tours.items()}
    cost = Relation(f"tour{one.label}", len(scope), Semantics.SOFT, tuple(rows), tuple(rows.values()))
    yield Constraint("tour", cost, scope, scope)
    if one.hurries:
        able = ((0,) * len(scope), *rows)
        yield Constraint("time", Relation(f"time{one.label}", len(scope), Semantics.SUPPORTS, able), scope, scope)


def _at_most(name: str, loads: Sequence[int], most: int) -> Predicate:
    names = _parameters(len(loads))
    terms: list[Expression] = [
        Apply("mul", (Constant(load), Name(one))) for load, one in zip(loads, names, strict=True)
    ]
    return Predicate(name, names, Apply("le", (total(terms), Constant(most))))


def _crews(able: Sequence[Worker], jobs: Mapping[int, Job]) -> Iterator[Constraint]:
    """Yield, for each task that asks for several robots, that so many do it or none does."""
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
