"""Read a list of robots and tasks, and check that its entries fit together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from fractions import Fraction
from pathlib import Path

from robochoc.formats.diagnostics import DiagnosticCollector, InvalidInputError, MistakeError, encodable, shortened
from robochoc.formats.dialects.dialect import ImportOptions, ImportResult
from robochoc.formats.dialects.pydcop.files import file_text
from robochoc.formats.names import check_word
from robochoc.formats.yaml_tree import Node, read_yaml, unread_parts
from robochoc.model.allocation import Distance, TasksModel
from robochoc.tasks.builder import TaskList, TaskTeamBuilder
from robochoc.tasks.entries import (
    MAX_PLACES,
    EntryReader,
    RobotEntry,
    TaskEntry,
    name_text,
    read_robots,
    read_synergies,
    read_tasks,
)
from robochoc.tasks.precedence import check_order
from robochoc.tasks.ways import MapWays, PlainWays, Ways, map_at

RADIUS_M = Fraction(1, 5)
"""The default radius of robots on a map."""
MAX_NUMBER = 1000
"""The maximum number of robots, and of tasks."""


class Measure(StrEnum):
    """The measures of distances: those of `Distance`, or ways around the walls of a map."""

    STREETS = "streets"
    STRAIGHT = "straight"
    MAP = "map"


def read(paths: Sequence[Path], options: ImportOptions) -> ImportResult:
    """Return the team for a list of robots and tasks.

    Raises:
        InvalidInputError: with all errors.
    """
    if len(paths) > 1:
        mistakes = DiagnosticCollector(encodable(str(paths[1])))
        mistakes.add(0, "is a second list of robots and tasks", "import one file")
        mistakes.finish()
    path = paths[0]
    mistakes = DiagnosticCollector(encodable(str(path)))
    found: ImportResult | None = None
    with mistakes.at(0):
        for option, given in (("infinity", options.infinity), ("owner", options.owner)):
            if given is not None:
                raise MistakeError(
                    f"is a list of tasks, whose import does not support --{option}", f"leave out --{option}"
                )
        found = TaskTeamBuilder(_read(file_text(path), path, mistakes)).imported(options)
    mistakes.finish()
    if found is None:
        raise InvalidInputError([])
    return found


def _read(text: str, path: Path, mistakes: DiagnosticCollector) -> TaskList:
    def read(root: Node) -> TaskList:
        found = _list(EntryReader("the file", root), path, mistakes)
        for mistake in unread_parts(root):
            mistakes.add(mistake.line, mistake.message, mistake.hint)
        mistakes.finish()
        return found

    read_list = read_yaml(text, read, "a list has robots and tasks")
    _check_model(read_list, mistakes)
    return read_list


def _list(head: EntryReader, path: Path, mistakes: DiagnosticCollector) -> TaskList:
    listed = head.required_node("tasks")
    robots = read_robots(head.required_node("robots"), head.number("radius", RADIUS_M) or Fraction(0), mistakes)
    tasks = read_tasks(listed, mistakes)
    for what, entries in (("robots", robots), ("tasks", tasks)):
        if len(entries) > MAX_NUMBER:
            raise MistakeError(f"has {len(entries)} {what}", f"write at most {MAX_NUMBER}")
    synergies = read_synergies(head.node("synergies"), [name_text(name) for name, _ in listed.named()], mistakes)
    model = head.choice("model", TasksModel) or _model(robots, tasks)
    places = head.integer("places", 0) or 0
    if places > MAX_PLACES:
        raise MistakeError(f"has costs with {places} decimal places", f"write places: {MAX_PLACES} or less")
    tours = head.flag("tours") and model != TasksModel.ASSIGNMENT
    _check_topics(robots, mistakes)
    name = " ".join(head.words("name")) or path.stem
    _check_points([*robots.values(), *tasks.values()], mistakes)
    ways = _ways(head, path.parent, robots, tasks, mistakes)
    step = head.number("step", Fraction(1)) or Fraction(0)
    if not step:
        raise MistakeError("the list has the step 0", "write a number above 0", head.required_node("step").line)
    return TaskList(name, model, ways, places, robots, tasks, synergies, tours, step)


def _check_topics(robots: Mapping[str, RobotEntry], mistakes: DiagnosticCollector) -> None:
    """Report invalid topics, and topics of several robots."""
    owners: dict[str, str] = {}
    for name, robot in robots.items():
        if not robot.topic:
            continue
        with mistakes.at(robot.line):
            check_word(robot.topic)
            if owner := owners.get(robot.topic):
                what = f"the robots '{shortened(owner)}' and '{shortened(name)}' have the same topic"
                raise MistakeError(what, "give each robot its own topic")
            owners[robot.topic] = name


def _ways(
    head: EntryReader,
    folder: Path,
    robots: Mapping[str, RobotEntry],
    tasks: Mapping[str, TaskEntry],
    mistakes: DiagnosticCollector,
) -> Ways:
    """Return the ways given by `map` and `distance`. Raises `MistakeError`."""
    name, measure = head.word("map"), head.choice("distance", Measure)
    if name:
        node = head.required_node("map")
        if measure not in (None, Measure.MAP):
            raise MistakeError(f"has a map and distance: {measure}", "delete one of them", node.line)
        mistakes.finish()
        ways = MapWays(map_at(name, folder, node.line), robots, tasks)
        ways.check(mistakes)
        mistakes.finish()
        return ways
    if measure == Measure.MAP:
        raise MistakeError("has distance: map, but no map", "write map: FILE", head.required_node("distance").line)
    usual = head.number("radius", RADIUS_M)
    lines = [node.line for node in [head.node("radius")] if node]
    lines += [one.line for one in robots.values() if one.radius != usual]
    if lines:
        raise MistakeError("has a radius, but no map", "write map: FILE, or delete the radius", lines[0])
    return PlainWays(Distance(measure or Distance.STRAIGHT))


def _model(robots: Mapping[str, RobotEntry], tasks: Mapping[str, TaskEntry]) -> TasksModel:
    """Return `assignment` if each robot does at most one task, which requires one robot and no other task."""
    alone = all(one.robots == 1 and not one.after for one in tasks.values())
    alone = alone and all(one.most == 1 for one in robots.values())
    return TasksModel.ASSIGNMENT if alone else TasksModel.SEVERAL


def _check_times(name: str, task: TaskEntry, read: TaskList) -> None:
    """Raise `MistakeError` for times that the model cannot express."""
    if task.after and read.model == TasksModel.ASSIGNMENT:
        what = f"the task '{shortened(name)}' has after:, which the model assignment does not support"
        raise MistakeError(what, "write model: several and tours: yes", task.line)
    if read.model == TasksModel.SEVERAL and not read.tours:
        for key, is_given in (("after", task.after), ("duration", task.duration), ("window", task.window[0])):
            if is_given:
                what = f"the task '{shortened(name)}' has {key}:, but robots that do several tasks have no tours"
                raise MistakeError(what, "write tours: yes", task.line)


def _check_points(entries: Sequence[RobotEntry | TaskEntry], mistakes: DiagnosticCollector) -> None:
    known = {len(one.at): one for one in entries if one.at}
    if len(known) > 1:
        line = list(known.values())[1].line
        what = "a place has a different number of coordinates than the places before it"
        mistakes.add(line, what, "write all places with two coordinates, or all with three")


def _check_model(read: TaskList, mistakes: DiagnosticCollector) -> None:
    if read.model == TasksModel.ASSIGNMENT:
        for name, robot in read.robots.items():
            if robot.most not in (None, 1):
                what = f"the robot '{shortened(name)}' may do {robot.most} tasks; the model assignment allows one"
                mistakes.add(robot.line, what, "write most: 1, or model: several")
        for name, task in read.tasks.items():
            if task.robots > 1:
                what = f"the task '{shortened(name)}' requires {task.robots} robots; the model assignment allows one"
                mistakes.add(task.line, what, "write model: several")
    for name, task in read.tasks.items():
        with mistakes.at(task.line):
            _check_times(name, task, read)
    mistakes.finish()
    check_order(read.tasks, mistakes, tours=read.tours)
    mistakes.finish()
