"""Precedence between tasks: `after` in a list, and the resulting pairs of ordered tasks."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter
from itertools import chain
from math import ceil, floor

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, shortened, suggestion
from robochoc.model.allocation import Order
from robochoc.tasks.entries import TaskEntry
from robochoc.tasks.tours import Precedence

MAX_STARTS = 1000
"""The maximum number of starts of a task."""


def check_order(
    tasks: Mapping[str, TaskEntry],
    names: Collection[str],
    step: Fraction,
    mistakes: DiagnosticCollector,
    *,
    tours: bool,
) -> None:
    """Report unknown predecessors, cycles, and ordered or joint tasks without starts, or with too many of them.

    Args:
        tasks: The valid tasks.
        names: The names of all tasks.
        step: The unit of starts.
        mistakes: The errors found so far.
        tours: True if robots have tours, and so times.
    """
    ordered = {*chain.from_iterable((name, *task.after) for name, task in tasks.items() if task.after)}
    for name, task in tasks.items():
        with mistakes.at(task.line):
            for before in task.after:
                if before not in names:
                    what = f"the task '{shortened(name)}' is after '{shortened(before)}', which is not in the list"
                    raise MistakeError(what, suggestion(before, names, "tasks"))
            if name in ordered or (tours and task.is_joint):
                _check_starts(name, task, step)
    try:
        TopologicalSorter({name: task.after for name, task in tasks.items()}).prepare()
    except CycleError as error:
        cycle = error.args[1]
        what = f"the order of tasks is a cycle: {', '.join(shortened(name) for name in cycle)}"
        mistakes.add(tasks[cycle[0]].line, what, "delete one after:")


def _check_starts(name: str, task: TaskEntry, step: Fraction) -> None:
    """Raise `MistakeError` if an ordered task has no start in its window, or too many starts."""
    (earliest, latest), subject = task.window, f"the task '{shortened(name)}'"
    reason = "has a team, which starts at the same time," if task.is_joint else "precedes or follows another task,"
    if latest is None:
        what = f"{subject} {reason} and has no window"
        raise MistakeError(what, "write window: [EARLIEST, LATEST]")
    starts = floor(latest / step) - ceil(earliest / step) + 1
    if starts < 1:
        what = f"{subject} {reason} and its window has no multiple of step: {float(step):g}"
        raise MistakeError(what, "write a smaller step:, or a longer window:")
    if starts > MAX_STARTS:
        what = f"{subject} has {starts:,} starts in its window; at most {MAX_STARTS:,} are allowed"
        raise MistakeError(what, "write a larger step:, or a shorter window:")


def precedence_of(tasks: Mapping[str, TaskEntry], step: Fraction) -> Precedence:
    """Return which tasks have starts that other robots see."""
    number = {name: place for place, name in enumerate(tasks, start=1)}
    first = {number[before] for task in tasks.values() for before in task.after}
    last = {number[name] for name, task in tasks.items() if task.after or task.is_joint}
    return Precedence(step, frozenset(first), frozenset(last))


def orders_of(tasks: Mapping[str, TaskEntry], step: Fraction) -> Iterator[Order]:
    """Yield the pairs of ordered tasks; the second starts at least the duration of the first later, in steps."""
    number = {name: place for place, name in enumerate(tasks, start=1)}
    for name, task in tasks.items():
        for before in dict.fromkeys(task.after):
            yield Order(number[before], number[name], -int(-tasks[before].duration // step))
