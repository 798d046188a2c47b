"""Build the team of a task list: the tasks that each robot can do, their profits, and the robots' waypoints."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

import msgspec

from robochoc.formats.definitions import check_topic
from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.dialect import ConversionNote, ImportOptions, ImportResult, NameMap, notes_on_names
from robochoc.formats.dialects.exact_costs import Scale
from robochoc.formats.symbols import check_symbol
from robochoc.formats.team_reader import GROUND_FILE
from robochoc.model.allocation import (
    START,
    TOUR,
    Order,
    Schedule,
    TasksModel,
    TaskSpec,
    Worker,
    assignment,
    several_tasks,
    tour_variable,
)
from robochoc.model.assembly import Extras, assemble
from robochoc.model.coalition import can_fill
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Expression
from robochoc.model.problem import ProblemKind, Team, Topic, Variable
from robochoc.system.lazy_dataclass import dataclass
from robochoc.tasks.entries import MAX_PLACES, MAX_TEAM, Point, RobotEntry, Synergy, TaskEntry
from robochoc.tasks.precedence import orders_of, precedence_of
from robochoc.tasks.stops import stops_of_choice, stops_of_tours, within_limit
from robochoc.tasks.tours import Tour, TourSearch, round_length
from robochoc.tasks.waypoints import Cells, in_units, of_choice, of_nearest, of_tours, unit_of, waypoint_topic
from robochoc.tasks.ways import MapWays, Ways

if TYPE_CHECKING:
    from robochoc.maps.ground_map import GroundMap
    from robochoc.maps.stops import RobotStops

MAX_CONSTRAINTS = 200_000
"""The maximum number of constraints of the team, and of tours."""
MAX_CREW = MAX_TEAM
"""The maximum number of robots that can do a task that requires several: one constraint is over all of them."""
NONE = "none"
"""The value of a robot without a task."""
_ONLY = "task"
"""The last part of the name of a robot's only variable."""


@dataclass(frozen=True)
class TaskList:
    """The checked content of a `tasks.yaml`."""

    name: str
    model: TasksModel
    ways: Ways
    places: int
    robots: Mapping[str, RobotEntry]
    tasks: Mapping[str, TaskEntry]
    synergies: Sequence[Synergy]
    tours: bool
    step: Fraction

    @property
    def points(self) -> list[Point]:
        """All positions in the list."""
        found = [*(one.at for one in self.robots.values()), *(one.at for one in self.tasks.values())]
        return [at for at in found if at]


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


class TaskTeamBuilder:
    """Builds a team from a task list. Tasks are numbered from 1, in the order of the file."""

    def __init__(self, read: TaskList) -> None:
        self._read = read
        self._number = {name: number for number, name in enumerate(read.tasks, start=1)}
        self._notes: list[ConversionNote] = []
        self._sets = 0
        self._tours_of: dict[str, list[Tour]] = {}
        self._precedence = precedence_of(read.tasks, read.step)
        self._impossible: set[str] = set()
        self._names = list(read.tasks)
        self._unit = unit_of(read.points)
        self._robot_names, self._task_names = NameMap(), NameMap()
        if read.tours:
            self._task_names.reserve(TOUR)
        amounts = [one.worth for one in read.tasks.values()] + [one.worth for one in read.synergies]
        self._scale = Scale([*amounts, Fraction(1, 10**read.places)])
        if self._scale.rounds:
            text = f"some worths were rounded to {MAX_PLACES} decimal places"
            self._notes.append(ConversionNote("rounded", text))

    def imported(self, options: ImportOptions) -> ImportResult:
        """Return the team. Raises `MistakeError`."""
        read = self._read
        workers = self._workers()
        self._note_impossible(workers)
        if read.model == TasksModel.ASSIGNMENT:
            _check_symbols(read.tasks)
            variables, constraints = assignment(workers, (NONE, *read.tasks))
        else:
            jobs = {self._number[name]: self._job(name, task, workers) for name, task in read.tasks.items()}
            orders = [
                one for one in orders_of(read.tasks, read.step) if self._names[one.after - 1] not in self._impossible
            ]
            self._check_orders(orders, workers)
            variables, constraints = several_tasks(workers, jobs, orders)
        if not variables:
            raise MistakeError("no robot can do any of the tasks", "check skills, needs, teams, loads and deadlines")
        _check_names(variables)
        listed = list(itertools.islice(constraints, MAX_CONSTRAINTS + 1))
        if len(listed) > MAX_CONSTRAINTS:
            what = f"has robots and tasks for more than {MAX_CONSTRAINTS:,} constraints"
            raise MistakeError(what, "write fewer robots, or fewer tasks")
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", options.name or read.name)[:100].strip("._-") or "team"
        units = CostUnits(maximize=True, places=self._scale.places)
        ground = self._ground(workers)
        topics = self._topics(workers, variables) if ground or self._unit == 1 else {}
        team: Team = assemble(
            name, variables, listed, kind=ProblemKind.DISWCSP, costs=units, extras=Extras(topics=topics)
        )
        changed = self._originals(workers)
        notes = (*self._notes, *notes_on_names(list(changed.items())))
        return ImportResult(team, "tasks", changed, notes, files={GROUND_FILE: ground} if ground else {})

    def _workers(self) -> list[Worker]:
        """Return the robots with the tasks that they can do.

        A task that has no team, or follows one that no robot can do, is impossible.
        """
        while True:
            self._sets = 0
            workers = [self._worker(name, robot) for name, robot in self._read.robots.items()]
            able = {name for name, task in self._read.tasks.items() if self._can_be_done(name, task, workers)}
            more = {name for name, task in self._read.tasks.items() if name in able and not able.issuperset(task.after)}
            self._impossible |= {*self._names} - able
            if not more:
                return workers
            self._impossible |= more

    def _can_be_done(self, name: str, task: TaskEntry, workers: Sequence[Worker]) -> bool:
        kinds = [one.skills.intersection(task.team) for one in workers if self._number[name] in one.profit]
        return can_fill(kinds, task.team, task.robots if task.is_joint else 1)

    def _check_orders(self, orders: Sequence[Order], workers: Sequence[Worker]) -> None:
        """Raise `MistakeError` if the constraint on two ordered tasks would have too many variables."""
        for one in orders:
            able = sum((one.before in worker.profit) + (one.after in worker.profit) for worker in workers)
            if able > MAX_CREW:
                before, after = (shortened(self._names[task - 1]) for task in (one.before, one.after))
                line = self._read.tasks[self._names[one.after - 1]].line
                what = f"the task '{after}' follows '{before}', and {able} robots can do one of them, counted for each"
                raise MistakeError(what, f"restrict both by needs: to at most {MAX_CREW} robots in all", line)

    def _worker(self, name: str, robot: RobotEntry) -> Worker:
        profit = {
            self._number[task]: profit_of_task
            for task, entry in self._read.tasks.items()
            if task not in self._impossible and (profit_of_task := self._profit(robot, task, entry)) is not None
        }
        tours = self._tours(name, robot, profit)
        together: dict[tuple[int, int], int] = {}
        for one in self._read.synergies:
            first, second = sorted(self._number[task] for task in one.tasks)
            if first in profit and second in profit and self._read.model == TasksModel.SEVERAL:
                together[first, second] = together.get((first, second), 0) + int(self._scale.units(one.worth))
        own = self._robot_names.allowed(name)
        if self._read.model == TasksModel.ASSIGNMENT:
            return Worker(own, own, f"{own}.{_ONLY}", profit)
        return Worker(own, own, own, profit, robot.capacity, robot.most, together, tours, robot.skills)

    def _tours(self, name: str, robot: RobotEntry, able: dict[int, int]) -> dict[Schedule, int]:
        """Return the lengths of the robot's tours; those with the same first places are together.

        Tasks that the robot cannot even do alone are removed from `able`.
        """
        if not self._read.tours:
            return {}
        ordered = {*self._precedence.first, *self._precedence.last}
        numbered = enumerate(self._read.tasks.values(), start=1)
        placed = {
            number: entry
            for number, entry in numbered
            if number in able and ((robot.at and entry.at) or entry.is_timed or number in ordered)
        }
        search = TourSearch(
            name, robot, placed, lambda start, end: self._way(robot, start, end, MAX_PLACES), self._precedence
        )
        found = search.tours()
        for task in placed:
            if (task,) not in found:
                del able[task]
        tours = sorted(
            ((Schedule(tasks, one.starts), one) for tasks, some in found.items() for one in some),
            key=lambda pair: pair[1].order,
        )
        self._tours_of[self._robot_names.allowed(name)] = [one for _, one in tours]
        self._sets += len(tours)
        if self._sets > MAX_CONSTRAINTS:
            what = f"has robots and tasks for more than {MAX_CONSTRAINTS:,} tours"
            raise MistakeError(what, "use fewer robots, or a smaller number in most:")
        return {schedule: round_length(one.length, self._scale.places) for schedule, one in tours}

    def _job(self, name: str, task: TaskEntry, workers: Sequence[Worker]) -> TaskSpec:
        able = sum(self._number[name] in one.profit for one in workers)
        if task.robots > 1 and able > MAX_CREW:
            what = f"the task '{shortened(name)}' requires {task.robots} robots, and {able} robots can do it"
            raise MistakeError(what, f"restrict it by needs: to at most {MAX_CREW} robots", task.line)
        return TaskSpec(self._task_names.allowed(name), task.load, task.robots, task.team, task.is_joint)

    def _topics(
        self, workers: Sequence[Worker], variables: Mapping[str, Sequence[Variable]]
    ) -> dict[str, tuple[Topic, ...]]:
        """Return the topics of robots with a position, for the places to which they go first."""
        entries = {self._robot_names.allowed(name): entry for name, entry in self._read.robots.items()}
        found: dict[str, tuple[Topic, ...]] = {}
        for one in workers:
            entry = entries[one.name]
            formulas = self._waypoint(one, entry) if entry.at and one.name in variables else None
            if formulas is None:
                continue
            topic = waypoint_topic(entry.topic or f"/{one.name}/waypoint", formulas)
            own = variables[one.name]
            symbols = own[0].domain.symbols
            try:
                check_topic(topic, [each.name for each in own], [each.name for each in own if symbols], symbols)
            except MistakeError:
                name = self._robot_names.originals.get(one.name, one.name)
                text = f"the topic of the robot {shortened(name)}, which has too many tasks for a formula"
                self._notes.append(ConversionNote("topic", text))
            else:
                found[one.name] = (topic,)
        return found

    def _waypoint(self, worker: Worker, entry: RobotEntry) -> tuple[Expression, ...] | None:
        """Return the formulas for the place to which a robot goes first; None if they would be too long."""
        home = in_units(entry.at, self._unit)
        places = self._places(worker)
        if self._read.model == TasksModel.ASSIGNMENT:
            return of_choice(worker.variable, places, home)
        if self._read.tours:
            first = [self._first(one, home) for one in self._tours_of[worker.name]]
            return of_tours(tour_variable(worker), [home, *first], len(home))
        nearest = self._nearest(entry, places)
        return of_nearest([(self._variable(worker, task), places[task]) for task in nearest], home)

    def _places(self, worker: Worker) -> dict[int, Cells]:
        """Return the places of the tasks that a robot can do, by number."""
        return {
            self._number[name]: in_units(task.at, self._unit)
            for name, task in self._read.tasks.items()
            if task.at and self._number[name] in worker.profit
        }

    def _nearest(self, entry: RobotEntry, places: Mapping[int, Cells]) -> list[int]:
        """Return the tasks with places, the nearest to the robot first."""
        tasks = list(self._read.tasks.values())
        return sorted(places, key=lambda task: self._way(entry, entry.at, tasks[task - 1].at, MAX_PLACES) or 0)

    def _stops(self, worker: Worker, entry: RobotEntry) -> RobotStops:
        places = self._places(worker)
        if self._read.model == TasksModel.ASSIGNMENT:
            return stops_of_choice(worker.variable, places)
        names = {task: self._variable(worker, task) for task in places}
        tours = self._tours_of.get(worker.name, [])
        return stops_of_tours(names, places, self._nearest(entry, places), tour_variable(worker), tours)

    def _first(self, tour: Tour, home: Cells) -> Cells:
        """Return the first place of a tour."""
        entries = [self._read.tasks[self._names[task - 1]] for task in tour.order]
        return next((in_units(one.at, self._unit) for one in entries if one.at), home)

    def _ground(self, workers: Sequence[Worker]) -> bytes:
        """Return the content of `map.json`; empty if no robot has a position, or a position is too far away."""
        robots = {self._robot_names.allowed(name): one for name, one in self._read.robots.items() if one.at}
        if not robots:
            return b""
        from robochoc.maps.ground_map import ground_map_json  # noqa: PLC0415 - start-up

        ground = self._plain_or_walled_ground({name: one.at for name, one in robots.items()})
        if ground is None:
            return b""
        stops = {one.name: self._stops(one, robots[one.name]) for one in workers if one.name in robots and one.profit}
        if within_limit(stops):
            return ground_map_json(msgspec.structs.replace(ground, stops=stops))
        what = "the tours in map.json, which are too many, so that robots are sent to their first places only"
        self._notes.append(ConversionNote("map", what))
        return ground_map_json(ground)

    def _plain_or_walled_ground(self, robots: Mapping[str, Point]) -> GroundMap | None:
        from robochoc.tasks.ground import plain_ground  # noqa: PLC0415 - start-up

        if isinstance(self._read.ways, MapWays):
            try:
                return self._read.ways.ground(robots, self._unit)
            except ValueError as error:
                self._notes.append(ConversionNote("map", f"the map, so that flights have no walls: {error}"))
        return plain_ground(robots, self._read.points, self._unit)

    def _variable(self, worker: Worker, task: int) -> str:
        """Return the name of the variable that is 1 if a robot does a task, in the model with several tasks."""
        return f"{worker.variable}.{self._task_names.allowed(self._names[task - 1])}"

    def _originals(self, workers: Sequence[Worker]) -> dict[str, str]:
        """Return the original names in the file, by the names in the team, if the two differ."""
        found = dict(self._robot_names.originals)
        for name, one in zip(self._read.robots, workers, strict=True):
            if self._read.model == TasksModel.ASSIGNMENT:
                found[one.variable] = f"{name}.{_ONLY}"
            else:
                own = {self._variable(one, task): self._names[task - 1] for task in one.profit}
                starts = {task for schedule in one.tours for task, _ in schedule.starts}
                own |= {f"{self._variable(one, task)}.{START}": f"{self._names[task - 1]}.{START}" for task in starts}
                own |= {tour_variable(one): TOUR} if one.scheduled else {}
                found |= {variable: f"{name}.{task}" for variable, task in own.items()}
        return {name: original for name, original in found.items() if name != original}

    def _note_impossible(self, workers: Sequence[Worker]) -> None:
        for name, one in zip(self._read.robots, workers, strict=True):
            if not one.profit and self._read.model == TasksModel.SEVERAL:
                what = f"the robot {shortened(name)}, which can do none of the tasks"
                self._notes.append(ConversionNote("left out", what))
        for name in self._names:
            if name in self._impossible:
                who = "team of these robots" if self._read.tasks[name].is_joint else "robot"
                self._notes.append(ConversionNote("left out", f"the task {shortened(name)}, which no {who} can do"))

    def _profit(self, robot: RobotEntry, task: str, entry: TaskEntry) -> int | None:
        """Return a robot's profit from a task: its share of the worth minus the way; None if it cannot do the task."""
        if not entry.needs <= robot.skills or (entry.team and robot.skills.isdisjoint(entry.team)) or robot.most == 0:
            return None
        if robot.capacity is not None and entry.load > robot.capacity:
            return None
        arrival = self._way(robot, robot.at, entry.at, MAX_PLACES)
        latest = entry.latest
        if arrival is None or (latest is not None and arrival > latest * robot.speed * 10**MAX_PLACES):
            return None
        worth = self._scale.units(entry.worth)
        if worth % entry.robots:
            what = f"the worth {entry.worth} of '{shortened(task)}' cannot be divided by its {entry.robots} robots"
            raise MistakeError(what, "write a multiple of their number, or more places:", entry.line)
        way = 0 if self._read.tours else self._way(robot, robot.at, entry.at, self._scale.places) or 0
        return int(worth) // entry.robots - way

    def _way(self, robot: RobotEntry, start: Point, end: Point, places: int) -> int | None:
        return self._read.ways.length(start, end, places, robot.radius) if start and end else 0
