"""Read a list of robots and tasks as a team: the tasks that each robot can do, and their profits."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

from robochoc.formats.diagnostics import DiagnosticCollector, InvalidInputError, MistakeError, encodable, shortened
from robochoc.formats.dialects.dialect import ConversionNote, ImportOptions, ImportResult, NameMap, notes_on_names
from robochoc.formats.dialects.exact_costs import Scale
from robochoc.formats.dialects.pydcop.files import file_text
from robochoc.formats.dialects.tasks.entries import (
    MAX_PLACES,
    EntryReader,
    Point,
    RobotEntry,
    Synergy,
    TaskEntry,
    name_text,
    read_robots,
    read_synergies,
    read_tasks,
)
from robochoc.formats.dialects.tasks.tours import TaskSet, TourSearch, round_length
from robochoc.formats.symbols import check_symbol
from robochoc.formats.yaml_tree import Node, read_yaml, unread_parts
from robochoc.model.allocation import (
    Distance,
    TasksModel,
    TaskSpec,
    Worker,
    assignment,
    distance_between,
    several_tasks,
)
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team, Variable
from robochoc.system.lazy_dataclass import dataclass

MAX_NUMBER = 1000
"""The maximum number of robots, and of tasks."""
MAX_CONSTRAINTS = 200_000
"""The maximum number of constraints of the team, and of tours."""
MAX_CREW = 16
"""The maximum number of robots that can do a task that requires several: one constraint is over all of them."""
NONE = "none"
"""The value of a robot without a task."""
_ONLY = "task"
"""The last part of the name of a robot's only variable."""


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
        found = _TaskTeamBuilder(_read(file_text(path), path.stem, mistakes)).imported(options)
    mistakes.finish()
    if found is None:
        raise InvalidInputError([])
    return found


@dataclass(frozen=True)
class _TaskList:
    """The checked content of a `tasks.yaml`."""

    name: str
    model: TasksModel
    distance: Distance
    places: int
    robots: Mapping[str, RobotEntry]
    tasks: Mapping[str, TaskEntry]
    synergies: Sequence[Synergy]
    tours: bool


def _read(text: str, stem: str, mistakes: DiagnosticCollector) -> _TaskList:
    def read(root: Node) -> _TaskList:
        found = _list(EntryReader("the file", root), stem, mistakes)
        for mistake in unread_parts(root):
            mistakes.add(mistake.line, mistake.message, mistake.hint)
        mistakes.finish()
        return found

    read_list = read_yaml(text, read, "a list has robots and tasks")
    _check_model(read_list, mistakes)
    return read_list


def _list(head: EntryReader, stem: str, mistakes: DiagnosticCollector) -> _TaskList:
    listed = head.required_node("tasks")
    robots, tasks = read_robots(head.required_node("robots"), mistakes), read_tasks(listed, mistakes)
    for what, entries in (("robots", robots), ("tasks", tasks)):
        if len(entries) > MAX_NUMBER:
            raise MistakeError(f"has {len(entries)} {what}", f"write at most {MAX_NUMBER}")
    synergies = read_synergies(head.node("synergies"), [name_text(name) for name, _ in listed.named()], mistakes)
    model = head.choice("model", TasksModel) or _model(robots, tasks)
    distance = head.choice("distance", Distance) or Distance.STRAIGHT
    places = head.integer("places", 0) or 0
    if places > MAX_PLACES:
        raise MistakeError(f"has costs with {places} decimal places", f"write places: {MAX_PLACES} or less")
    tours = head.flag("tours") and model != TasksModel.ASSIGNMENT
    name = " ".join(head.words("name")) or stem
    _check_points([*robots.values(), *tasks.values()], mistakes)
    return _TaskList(name, model, distance, places, robots, tasks, synergies, tours)


def _model(robots: Mapping[str, RobotEntry], tasks: Mapping[str, TaskEntry]) -> TasksModel:
    """Return `assignment` if each robot does at most one task, and each task requires one robot; else `several`."""
    alone = all(one.most == 1 for one in robots.values()) and all(one.robots == 1 for one in tasks.values())
    return TasksModel.ASSIGNMENT if alone else TasksModel.SEVERAL


def _check_points(entries: Sequence[RobotEntry | TaskEntry], mistakes: DiagnosticCollector) -> None:
    known = {len(one.at): one for one in entries if one.at}
    if len(known) > 1:
        line = list(known.values())[1].line
        what = "a place has a different number of coordinates than the places before it"
        mistakes.add(line, what, "write all places with two coordinates, or all with three")


def _check_model(read: _TaskList, mistakes: DiagnosticCollector) -> None:
    if read.model == TasksModel.ASSIGNMENT:
        for name, robot in read.robots.items():
            if robot.most not in (None, 1):
                what = f"the robot '{shortened(name)}' may do {robot.most} tasks; the model assignment allows one"
                mistakes.add(robot.line, what, "write most: 1, or model: several")
        for name, task in read.tasks.items():
            if task.robots > 1:
                what = f"the task '{shortened(name)}' requires {task.robots} robots; the model assignment allows one"
                mistakes.add(task.line, what, "write model: several")
    mistakes.finish()


def _check_symbols(tasks: Mapping[str, TaskEntry]) -> None:
    for name, task in tasks.items():
        if name == NONE:
            raise MistakeError(f"the name '{NONE}' is reserved, and means no task", "rename the task", task.line)
        try:
            check_symbol(name)
        except MistakeError as mistake:
            raise MistakeError(mistake.message, mistake.hint, task.line) from None


def _check_names(variables: Mapping[str, Sequence[Variable]]) -> None:
    names: dict[str, str] = {}
    for robot, own in variables.items():
        for one in own:
            if one.name in names:
                robots = f"{shortened(names[one.name])} and {shortened(robot)}"
                what = f"the robots {robots} would both have a variable {shortened(one.name)}"
                raise MistakeError(what, "write names of robots without dots")
            names[one.name] = robot


class _TaskTeamBuilder:
    """Builds a team from a task list. Tasks are numbered from 1, in the order of the file."""

    def __init__(self, read: _TaskList) -> None:
        self._read = read
        self._number = {name: number for number, name in enumerate(read.tasks, start=1)}
        self._notes: list[ConversionNote] = []
        self._sets = 0
        self._robot_names, self._task_names = NameMap(), NameMap()
        amounts = [one.worth for one in read.tasks.values()] + [one.worth for one in read.synergies]
        self._scale = Scale([*amounts, Fraction(1, 10**read.places)])
        if self._scale.rounds:
            text = f"some worths were rounded to {MAX_PLACES} decimal places"
            self._notes.append(ConversionNote("rounded", text))

    def imported(self, options: ImportOptions) -> ImportResult:
        """Return the team. Raises `MistakeError`."""
        read = self._read
        workers = [self._worker(name, robot) for name, robot in read.robots.items()]
        self._note_impossible_tasks(workers)
        if read.model == TasksModel.ASSIGNMENT:
            _check_symbols(read.tasks)
            variables, constraints = assignment(workers, (NONE, *read.tasks))
        else:
            jobs = {self._number[name]: self._job(name, task, workers) for name, task in read.tasks.items()}
            variables, constraints = several_tasks(workers, jobs)
        if not variables:
            raise MistakeError("no robot can do any of the tasks", "check skills, needs, loads and deadlines")
        _check_names(variables)
        listed = list(itertools.islice(constraints, MAX_CONSTRAINTS + 1))
        if len(listed) > MAX_CONSTRAINTS:
            what = f"has robots and tasks for more than {MAX_CONSTRAINTS:,} constraints"
            raise MistakeError(what, "write fewer robots, or fewer tasks")
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", options.name or read.name)[:100].strip("._-") or "team"
        units = CostUnits(maximize=True, places=self._scale.places)
        team: Team = assemble(name, variables, listed, kind=ProblemKind.DISWCSP, costs=units)
        changed = self._originals(workers)
        return ImportResult(team, "tasks", changed, (*self._notes, *notes_on_names(list(changed.items()))))

    def _worker(self, name: str, robot: RobotEntry) -> Worker:
        profit = {
            self._number[task]: profit_of_task
            for task, entry in self._read.tasks.items()
            if (profit_of_task := self._profit(robot, task, entry)) is not None
        }
        together: dict[tuple[int, int], int] = {}
        for one in self._read.synergies:
            first, second = sorted(self._number[task] for task in one.tasks)
            if first in profit and second in profit and self._read.model == TasksModel.SEVERAL:
                together[first, second] = together.get((first, second), 0) + int(self._scale.units(one.worth))
        own = self._robot_names.allowed(name)
        if self._read.model == TasksModel.ASSIGNMENT:
            return Worker(own, own, f"{own}.{_ONLY}", profit)
        if not profit:
            self._notes.append(
                ConversionNote("left out", f"the robot {shortened(name)}, which can do none of the tasks")
            )
        return Worker(own, own, own, profit, robot.capacity, robot.most, together, *self._tours(name, robot, profit))

    def _tours(self, name: str, robot: RobotEntry, able: Collection[int]) -> tuple[dict[TaskSet, int], bool]:
        """Return the lengths of the robot's tours, and whether deadlines exclude other sets of tasks."""
        if not self._read.tours or not robot.at:  # for a robot without a position, all ways have length 0
            return {}, False
        numbered = enumerate(self._read.tasks.values(), start=1)
        placed = {number: entry for number, entry in numbered if number in able and entry.at}
        lengths = TourSearch(name, robot, placed, lambda start, end: self._way(start, end, MAX_PLACES)).lengths()
        self._sets += len(lengths)
        if self._sets > MAX_CONSTRAINTS:
            what = f"has robots and tasks for more than {MAX_CONSTRAINTS:,} tours"
            raise MistakeError(what, "use fewer robots, or a smaller number in most:")
        hurries = any(entry.deadline is not None for entry in placed.values())
        return {tasks: round_length(length, self._scale.places) for tasks, length in lengths.items()}, hurries

    def _job(self, name: str, task: TaskEntry, workers: Sequence[Worker]) -> TaskSpec:
        able = sum(self._number[name] in one.profit for one in workers)
        if task.robots > 1 and able > MAX_CREW:
            what = f"the task '{shortened(name)}' requires {task.robots} robots, and {able} robots can do it"
            raise MistakeError(what, f"restrict it by needs: to at most {MAX_CREW} robots", task.line)
        return TaskSpec(self._task_names.allowed(name), task.load, task.robots)

    def _originals(self, workers: Sequence[Worker]) -> dict[str, str]:
        """Return the original names in the file, by the names in the team, if the two differ."""
        tasks = list(self._read.tasks)
        found = dict(self._robot_names.originals)
        for name, one in zip(self._read.robots, workers, strict=True):
            if self._read.model == TasksModel.ASSIGNMENT:
                found[one.variable] = f"{name}.{_ONLY}"
            else:
                own = {
                    f"{one.variable}.{self._task_names.allowed(tasks[task - 1])}": tasks[task - 1]
                    for task in one.profit
                }
                found |= {variable: f"{name}.{task}" for variable, task in own.items()}
        return {name: original for name, original in found.items() if name != original}

    def _note_impossible_tasks(self, workers: Sequence[Worker]) -> None:
        able = {task for one in workers for task in one.profit}
        for name, number in self._number.items():
            if number not in able:
                self._notes.append(ConversionNote("left out", f"the task {shortened(name)}, which no robot can do"))

    def _profit(self, robot: RobotEntry, task: str, entry: TaskEntry) -> int | None:
        """Return a robot's profit from a task: its share of the worth minus the way; None if it cannot do the task."""
        if not entry.needs <= robot.skills or robot.most == 0:
            return None
        if robot.capacity is not None and entry.load > robot.capacity:
            return None
        if entry.deadline is not None and self._way(robot.at, entry.at, MAX_PLACES) > (
            entry.deadline * robot.speed * 10**MAX_PLACES
        ):
            return None
        worth = self._scale.units(entry.worth)
        if worth % entry.robots:
            what = f"the worth {entry.worth} of '{shortened(task)}' cannot be divided by its {entry.robots} robots"
            raise MistakeError(what, "write a multiple of their number, or more places:", entry.line)
        way = 0 if self._read.tours else self._way(robot.at, entry.at, self._scale.places)
        return int(worth) // entry.robots - way

    def _way(self, start: Point, end: Point, places: int) -> int:
        return distance_between(start, end, self._read.distance, places) if start and end else 0
