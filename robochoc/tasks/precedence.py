"""Precedence between tasks: `after` in a list, and the resulting pairs of ordered tasks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from graphlib import CycleError, TopologicalSorter

from robochoc.formats.diagnostics import DiagnosticCollector, MistakeError, shortened, suggestion
from robochoc.model.allocation import Order
from robochoc.tasks.entries import TaskEntry
from robochoc.tasks.tours import Precedence

MAX_STARTS = 1000
"""The maximum number of starts of a task."""


def check_order(tasks: Mapping[str, TaskEntry], mistakes: DiagnosticCollector, *, tours: bool) -> None:
    """Report tasks that follow unknown tasks or themselves, and ordered or joint tasks without a window.

    Args:
        tasks: The tasks.
        mistakes: Receives the mistakes.
        tours: True if robots have tours, and so times.
    """
    for name, task in tasks.items():
        with mistakes.at(task.line):
            if tours and task.is_joint and task.window[1] is None:
                what = f"the task '{shortened(name)}' has a team, which starts at the same time, and no window"
                raise MistakeError(what, "write window: [EARLIEST, LATEST]", task.line)
            for before in task.after:
                if before not in tasks:
                    what = f"the task '{shortened(name)}' is after '{shortened(before)}', which is not in the list"
                    raise MistakeError(what, suggestion(before, tasks, "tasks"), task.line)
                for ordered in (before, name):
                    if tasks[ordered].window[1] is None:
                        what = f"the task '{shortened(ordered)}' precedes or follows another task, and has no window"
                        raise MistakeError(what, "write window: [EARLIEST, LATEST]", tasks[ordered].line)
    mistakes.finish()
    try:
        TopologicalSorter({name: task.after for name, task in tasks.items()}).prepare()
    except CycleError as error:
        cycle = error.args[1]
        what = f"the order of tasks is a cycle: {', '.join(shortened(name) for name in cycle)}"
        mistakes.add(tasks[cycle[0]].line, what, "delete one after:")


def precedence_of(tasks: Mapping[str, TaskEntry], step: Fraction) -> Precedence:
    """Return which tasks have starts that other robots see. Raises `MistakeError` if a task has too many starts."""
    number = {name: place for place, name in enumerate(tasks, start=1)}
    first = {number[before] for task in tasks.values() for before in task.after}
    last = {number[name] for name, task in tasks.items() if task.after or task.is_joint}
    for name, task in tasks.items():
        latest = task.window[1] or Fraction(0)
        if number[name] in first | last and (latest - task.window[0]) / step > MAX_STARTS:
            what = f"the task '{shortened(name)}' has more than {MAX_STARTS:,} starts in its window"
            raise MistakeError(what, "write a larger step:, or a shorter window:", task.line)
    return Precedence(step, frozenset(first), frozenset(last))


def orders_of(tasks: Mapping[str, TaskEntry], step: Fraction) -> Iterator[Order]:
    """Yield the pairs of ordered tasks; the second starts at least the duration of the first later, in steps."""
    number = {name: place for place, name in enumerate(tasks, start=1)}
    for name, task in tasks.items():
        for before in dict.fromkeys(task.after):
            yield Order(number[before], number[name], -int(-tasks[before].duration // step))
