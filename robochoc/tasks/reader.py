"""Read a list of robots and tasks, and check that its entries fit together."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from fractions import Fraction
from pathlib import Path
from typing import TypeVar

from robochoc.formats.diagnostics import (
    DiagnosticCollector,
    InvalidInputError,
    MistakeError,
    encodable,
    shortened,
    suggestion,
)
from robochoc.formats.dialects.dialect import ImportOptions, ImportResult
from robochoc.formats.dialects.pydcop.files import file_text
from robochoc.formats.yaml_tree import Node, read_yaml, unread_parts
from robochoc.model.allocation import Distance, TasksModel
from robochoc.tasks.builder import TaskList, TaskTeamBuilder
from robochoc.tasks.entries import (
    MAX_PLACES,
    EntryReader,
    RobotEntry,
    Synergy,
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
_TOPIC = re.compile(r"/?[A-Za-z]\w*(?:/[A-Za-z]\w*)*", re.ASCII)
"""A legal ROS name. Other names would be published under a changed one."""
_T = TypeVar("_T")


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

    return read_yaml(text, read, "a list has robots and tasks")


def _list(head: EntryReader, path: Path, mistakes: DiagnosticCollector) -> TaskList:
    """Return the content of a list. It is incomplete if errors were added to `mistakes`."""

    def or_default(read: Callable[[], _T], default: _T) -> _T:
        try:
            return read()
        except MistakeError as mistake:
            mistakes.add(mistake.line, mistake.message, mistake.hint)
            return default

    listed = head.required_node("tasks")
    usual = or_default(lambda: head.number("radius", RADIUS_M) or Fraction(0), RADIUS_M)
    listed_robots = head.required_node("robots")
    robots = read_robots(listed_robots, usual, mistakes)
    tasks = read_tasks(listed, mistakes)
    if len(robots) == len([*listed_robots.named()]):  # otherwise not all skills are known
        _check_skills(robots, tasks, mistakes)
    for what, entries in (("robots", robots), ("tasks", tasks)):
        if len(entries) > MAX_NUMBER:
            raise MistakeError(f"has {len(entries)} {what}", f"write at most {MAX_NUMBER}")
    names = [name_text(name) for name, _ in listed.named()]
    synergies = or_default(lambda: read_synergies(head.node("synergies"), names, mistakes), list[Synergy]())
    model = or_default(lambda: head.choice("model", TasksModel), None) or _model(robots, tasks)
    places = or_default(lambda: _places(head), 0)
    step = or_default(lambda: _step(head), Fraction(1))
    tours = or_default(lambda: head.flag("tours"), default=True) and model != TasksModel.ASSIGNMENT
    _check_topics(robots, mistakes)
    name = " ".join(or_default(lambda: head.words("name"), ())) or path.stem
    _check_points([*robots.values(), *tasks.values()], mistakes)
    straight: Ways = PlainWays(Distance.STRAIGHT)
    ways = or_default(lambda: _ways(head, path.parent, robots, tasks, mistakes), straight)
    found = TaskList(name, model, ways, places, robots, tasks, synergies, tours, step)
    _check_model(found, mistakes)
    check_order(tasks, names, step, mistakes, tours=tours)
    return found


def _places(head: EntryReader) -> int:
    places = head.integer("places", 0) or 0
    if places > MAX_PLACES:
        raise MistakeError(f"has costs with {places} decimal places", f"write places: {MAX_PLACES} or less")
    return places


def _step(head: EntryReader) -> Fraction:
    step = head.number("step", Fraction(1)) or Fraction(0)
    if not step:
        raise MistakeError("the list has the step 0", "write a number above 0", head.required_node("step").line)
    return step


def _check_skills(
    robots: Mapping[str, RobotEntry], tasks: Mapping[str, TaskEntry], mistakes: DiagnosticCollector
) -> None:
    """Report skills of teams that no robot has."""
    known = sorted({skill for robot in robots.values() for skill in robot.skills})
    for name, task in tasks.items():
        for skill in task.team:
            if skill not in known:
                what = (
                    f"the task '{shortened(name)}' has a team with the skill '{shortened(skill)}', which no robot has"
                )
                mistakes.add(task.line, what, suggestion(skill, known, "skills"))


def _check_topics(robots: Mapping[str, RobotEntry], mistakes: DiagnosticCollector) -> None:
    """Report invalid topics, and topics of several robots."""
    owners: dict[str, str] = {}
    for name, robot in robots.items():
        if not robot.topic:
            continue
        with mistakes.at(robot.line):
            if not _TOPIC.fullmatch(robot.topic):
                what = f"the robot '{shortened(name)}' cannot have the topic '{shortened(robot.topic)}'"
                raise MistakeError(what, "write words of letters, digits and _, as in /ann/waypoint")
            topic = robot.topic.removeprefix("/")
            if owner := owners.get(topic):
                what = f"the robots '{shortened(owner)}' and '{shortened(name)}' have the same topic"
                raise MistakeError(what, "give each robot its own topic")
            owners[topic] = name


def _ways(
    head: EntryReader,
    folder: Path,
    robots: Mapping[str, RobotEntry],
    tasks: Mapping[str, TaskEntry],
    mistakes: DiagnosticCollector,
) -> Ways:
    """Return the ways given by `map` and `distance`. Raises `MistakeError`."""
    name, measure = head.word("map", "FILE"), head.choice("distance", Measure)
    if name:
        node = head.required_node("map")
        if measure not in (None, Measure.MAP):
            raise MistakeError(f"has a map and distance: {measure}", "delete one of them", node.line)
        try:
            ways = MapWays(map_at(name, folder, node.line), robots, tasks)
        except InvalidInputError:
            mistakes.finish()
            raise
        ways.check(mistakes)
        return ways
    if measure == Measure.MAP:
        raise MistakeError("has distance: map, but no map", "write map: FILE", head.required_node("distance").line)
    owners = {f"the robot '{shortened(name)}'": one.line for name, one in robots.items() if one.has_radius}
    if usual := head.node("radius"):
        owners["the list"] = usual.line
    for owner, line in owners.items():
        mistakes.add(line, f"{owner} has a radius, but there is no map", "write map: FILE, or delete the radius")
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
