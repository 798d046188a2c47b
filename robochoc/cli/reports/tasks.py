"""Print which robot does which task, for a team that was made of a list of robots and tasks (`tasks.yaml`)."""

from __future__ import annotations

from collections.abc import Mapping

from robochoc.cli.reports.table import table_lines
from robochoc.model.priorities import natural_key
from robochoc.model.problem import Robot, Team

_ONLY, _NONE = "task", "none"
"""A robot of one task at most has one variable, whose first value is none (`formats/dialects/task_list`)."""


def task_table(team: Team, values: Mapping[str, int | str]) -> list[str]:
    """Return a table of robots and their tasks, and a line of what nobody does; empty for teams of other problems."""
    could = {robot.name: _tasks_of(robot) for robot in team.robots}
    if not all(could.values()):
        return []
    done = {
        robot: [task for task, (variable, value) in tasks.items() if values.get(variable) == value]
        for robot, tasks in could.items()
    }
    rows = [
        (robot, ", ".join(tasks) or "-") for robot, tasks in sorted(done.items(), key=lambda one: natural_key(one[0]))
    ]
    somebody = {task for tasks in done.values() for task in tasks}
    left = sorted({task for tasks in could.values() for task in tasks} - somebody, key=natural_key)
    return [
        *(f"    {line}" for line in table_lines(("robot", "does"), rows)),
        *([f"    nobody does {', '.join(left)}"] if left else []),
    ]


def _tasks_of(robot: Robot) -> dict[str, tuple[str, int | str]]:
    """Return the variable and the value that say that `robot` does each task; empty if it has other variables too."""
    first = f"{robot.name}."
    if [one.name for one in robot.variables] == [first + _ONLY]:
        only = robot.variables[0]
        labels = [only.domain.label(value) for value in only.domain]
        if labels[:1] == [_NONE]:
            return {str(label): (only.name, label) for label in labels[1:]} or {_NONE: (only.name, 0)}
    binary = (not one.domain.symbols and set(one.domain) == {0, 1} for one in robot.variables)
    if all(one.name.startswith(first) for one in robot.variables) and all(binary):
        return {one.name.removeprefix(first): (one.name, 1) for one in robot.variables}
    return {}
