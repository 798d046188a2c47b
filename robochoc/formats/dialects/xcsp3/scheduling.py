"""Translate the constraints of XCSP3-core on tasks in time: cumulative and noOverlap."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError
from robochoc.formats.dialects.xcsp3.constraint_element import Element
from robochoc.formats.dialects.xcsp3.constraints import as_integers, items
from robochoc.formats.dialects.xcsp3.expressions import (
    Xcsp3Condition,
    as_integer,
    compare,
    conjunction,
    disjunction,
    plus,
    times,
    total,
    zip_equal,
)
from robochoc.formats.dialects.xcsp3.posting import Posting
from robochoc.model.expression import Constant, Expression

MAX_COVERS = 5_000
"""The maximum number of minimal sets of tasks that together exceed the capacity."""


class ScheduledTask(NamedTuple):
    """A task: its start, its duration, and the amount of the resource that it requires."""

    start: Expression
    length: Expression
    height: Expression


def no_overlap(element: Element, posting: Posting) -> None:
    """Post that tasks, or boxes, do not overlap."""
    origins, lengths = (_points(element, child, posting) for child in ("origins", "lengths"))
    excepted = element.is_true("zeroIgnored", default=True)
    boxes = [
        list(zip_equal(*box, what="<origins> and <lengths>"))
        for box in zip_equal(origins, lengths, what="<origins> and <lengths>")
    ]
    for one, other in itertools.combinations(boxes, 2):
        apart = []
        for (x, long), (y, wide) in zip_equal(one, other):
            apart += [compare("le", plus(x, long), y), compare("le", plus(y, wide), x)]
            apart += [_is_zero(side) for side in (long, wide) if excepted and _may_be_zero(side, posting)]
        posting.post(disjunction(apart))


def cumulative(element: Element, posting: Posting) -> None:
    """Post that at any time the sum of the heights of the running tasks meets the condition."""
    children = ["origins", "lengths", "heights", *(["ends"] if element.has("ends") else [])]
    columns = [as_integers(items(element.words(child), posting)) for child in children]
    tasks = []
    for start, length, height, *ends in zip_equal(*columns, what=f"<cumulative>: {', '.join(children)}"):
        tasks.append(ScheduledTask(start, length, height))
        for end in ends:
            posting.post(compare("eq", plus(start, length), end))
    if any(min(posting.domain(one), default=0) < 0 for task in tasks for one in (task.length, task.height)):
        raise MistakeError(
            "negative lengths or heights of tasks are not supported", "use lengths and heights from 0 on"
        )
    condition = posting.condition(element.text("condition"))
    if condition.operator not in {"lt", "le"}:
        raise MistakeError(f"<cumulative> with {condition.operator} is not supported", "write (le,10)")
    post_tasks(tasks, condition, posting)


def post_tasks(every_task: Sequence[ScheduledTask], condition: Xcsp3Condition, posting: Posting) -> None:
    """Post that at any time the sum of the heights of the running tasks meets `condition`, an upper bound."""
    nothing = Constant(0)
    tasks = [task for task in every_task if nothing not in (task.length, task.height)]
    covers = _covers(tasks, condition)
    if covers is None:
        for task in tasks:
            posting.post(_load_at(task, tasks, condition, posting))
        return
    for cover in covers:
        pairs = itertools.combinations(cover, 2)
        posting.post(
            disjunction([part for one, other in pairs for part in _apart(one, other)] + _absent(cover, posting))
        )


def _absent(cover: Sequence[ScheduledTask], posting: Posting) -> list[Expression]:
    return [_is_zero(task.length) for task in cover if _may_be_zero(task.length, posting)]


def _apart(one: ScheduledTask, other: ScheduledTask) -> list[Expression]:
    return [
        compare("le", plus(one.start, one.length), other.start),
        compare("le", plus(other.start, other.length), one.start),
    ]


def _covers(tasks: Sequence[ScheduledTask], condition: Xcsp3Condition) -> list[tuple[ScheduledTask, ...]] | None:
    """Return the minimal sets of tasks that together exceed the capacity; None if there are many, or heights vary.

    Tasks that overlap in pairs all overlap at some time, so two tasks of each set must not overlap.
    """
    if condition.with_constant(0) is None or not all(isinstance(task.height, Constant) for task in tasks):
        return None
    found: list[tuple[ScheduledTask, ...]] = []
    try:
        found.extend(_minimal(sorted(tasks, key=_height, reverse=True), condition))
    except _TooManySetsError:
        return None
    return found


class _TooManySetsError(Exception):
    """There are more than `MAX_COVERS` sets of tasks."""


def _minimal(tasks: Sequence[ScheduledTask], condition: Xcsp3Condition) -> Iterator[tuple[ScheduledTask, ...]]:
    """Yield the minimal sets that violate `condition`; `tasks` are from the highest to the lowest."""
    steps = 0
    waiting: list[tuple[tuple[ScheduledTask, ...], int, int]] = [((), 0, 0)]
    while waiting:
        chosen, height, following = waiting.pop()
        for place in range(following, len(tasks)):
            steps += 1
            if steps > 20 * MAX_COVERS:
                raise _TooManySetsError
            larger, sum_of_heights = (*chosen, tasks[place]), height + _height(tasks[place])
            # The set is minimal: the last task has the least height, and the set without it meets the condition.
            if not condition.with_constant(sum_of_heights):
                yield larger
            else:
                waiting.append((larger, sum_of_heights, place + 1))


def _height(task: ScheduledTask) -> int:
    return task.height.value if isinstance(task.height, Constant) else 0


def _load_at(
    task: ScheduledTask, tasks: Sequence[ScheduledTask], condition: Xcsp3Condition, posting: Posting
) -> Expression:
    """Return an expression that is true if the running tasks meet `condition` at the start of `task`."""
    running = [task.height]
    for other in tasks:
        if other is not task:
            runs = conjunction(
                [compare("le", other.start, task.start), compare("lt", task.start, plus(other.start, other.length))]
            )
            running.append(times(other.height, as_integer(runs)))
    unused = [_is_zero(task.length)] if _may_be_zero(task.length, posting) else []
    return disjunction([*unused, condition.on(total(running))])


def _is_zero(length: Expression) -> Expression:
    return compare("eq", length, Constant(0))


def _may_be_zero(length: Expression, posting: Posting) -> bool:
    return 0 in posting.domain(length)


def _points(element: Element, child: str, posting: Posting) -> list[list[Expression]]:
    """Return the coordinates of each task: several if one of the two elements contains lists in parentheses."""
    if any(element.text(name).startswith("(") for name in ("origins", "lengths")):
        return [as_integers(posting.term(word) for word in row) for row in element.matrix(child)]
    return [[member] for member in as_integers(items(element.words(child), posting))]
