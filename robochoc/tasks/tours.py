"""The shortest tours of a robot from its position to all tasks in a set, in an order that meets all times.

They are found by dynamic programming over sets and their last places (Held and Karp, SIAM J. 10, 1962). Of two tours
with the same last place, the one that is neither longer nor later is never worse for the following tasks; a robot that
waits for the beginning of a window may have several tours that differ in this. A tour does not return to its start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.system.lazy_dataclass import dataclass
from robochoc.tasks.entries import MAX_PLACES, Point, RobotEntry, TaskEntry

MAX_SETS = 4096
"""The maximum number of task sets for which a robot has time and capacity."""
TaskSet = tuple[int, ...]
"""Numbers of tasks, in ascending order."""
_HOME = 0
"""The number of the robot's position; tasks are numbered from 1."""


class Tour(NamedTuple):
    """A tour: its length in units of 10**-MAX_PLACES, the time of its end, and its tasks in order."""

    length: int
    end: int
    order: tuple[int, ...]


_Ends = Mapping[int, list[Tour]]
"""The tours of a set that no other tour dominates, by the number of their last place."""


@dataclass(frozen=True)
class TourSearch:
    """The search for the tours of one robot.

    Attributes:
        name: The robot's name.
        robot: The robot. It has a position.
        tasks: The tasks that have a position and that the robot can do, by number.
        way: Returns the length of the way between two positions, in units of 10**-MAX_PLACES; None if there is none.
    """

    name: str
    robot: RobotEntry
    tasks: Mapping[int, TaskEntry]
    way: Callable[[Point, Point], int | None]

    def tours(self) -> dict[TaskSet, Tour]:
        """Return the shortest tour for each set of tasks for which the robot has time and capacity.

        Raises:
            MistakeError: if there are more than `MAX_SETS` sets.
        """
        ends: dict[TaskSet, _Ends] = {(): {_HOME: [Tour(0, 0, ())]}}
        level: list[TaskSet] = [()]
        legs = self._legs()
        clock = _Clock(self.robot, self.tasks.values())
        while level:
            larger = []
            for tasks in level:
                for more in self._larger_sets(tasks):
                    found = dict(self._ends(more, ends, legs, clock))
                    if found:
                        ends[more] = found
                        larger.append(more)
                        self._check_count(len(ends))
            level = larger
        return {tasks: min(one for some in found.values() for one in some) for tasks, found in ends.items() if tasks}

    def _legs(self) -> dict[tuple[int, int], int]:
        """Return the length of the way between each two places, by their numbers; no entry if there is no way."""
        places = {_HOME: self.robot.at, **{number: entry.at for number, entry in self.tasks.items()}}
        return {
            (one, other): length
            for one, start in places.items()
            for other in self.tasks
            if one != other and (length := self.way(start, places[other])) is not None
        }

    def _larger_sets(self, tasks: TaskSet) -> Iterator[TaskSet]:
        """Yield the sets with one more task, with a higher number, for which the robot has capacity."""
        if self.robot.most is not None and len(tasks) >= self.robot.most:
            return
        load = sum(self.tasks[task].load for task in tasks)
        for task in self.tasks:
            room = self.robot.capacity
            if (not tasks or task > tasks[-1]) and (room is None or load + self.tasks[task].load <= room):
                yield (*tasks, task)

    def _ends(
        self, tasks: TaskSet, ends: Mapping[TaskSet, _Ends], legs: Mapping[tuple[int, int], int], clock: _Clock
    ) -> Iterator[tuple[int, list[Tour]]]:
        """Yield the possible last tasks of a tour of `tasks`, with the tours that no other tour dominates."""
        for last in tasks:
            found = []
            for before, tours in ends.get(tuple([task for task in tasks if task != last]), {}).items():
                leg = legs.get((before, last))
                for one in tours if leg is not None else ():
                    end = clock.end(self.tasks[last], one.end, leg or 0)
                    if end is not None:
                        found.append(Tour(one.length + (leg or 0), end, (*one.order, last)))
            if found:
                yield last, _undominated(found)

    def _check_count(self, sets: int) -> None:
        if sets > MAX_SETS:
            raise MistakeError(
                f"the robot '{shortened(self.name)}' has time and capacity for more than {MAX_SETS:,} sets of tasks",
                "write most:, write a smaller capacity:, or delete tours:",
                self.robot.line,
            )


class _Clock:
    """Computes with times as integers, in a unit in which all times of the tasks and of the ways are integers.

    Args:
        robot: The robot, with its speed.
        tasks: The tasks with times.
    """

    def __init__(self, robot: RobotEntry, tasks: Iterable[TaskEntry]) -> None:
        per_time = robot.speed * 10**MAX_PLACES  # lengths travelled in a unit of time
        given = [time for task in tasks for time in (*task.window, task.deadline, task.duration) if time is not None]
        self._per_length = math.lcm(*((time * per_time).denominator for time in given))
        self._units = per_time * self._per_length

    def end(self, task: TaskEntry, start: int, way: int) -> int | None:
        """Return the end of `task` after a way that begins at `start`; None if the robot is too late."""
        arrival = start + way * self._per_length
        earliest, latest = task.window
        if task.deadline is not None and arrival > task.deadline * self._units:
            return None
        begin = max(arrival, int(earliest * self._units))
        if latest is not None and begin > latest * self._units:
            return None
        return begin + int(task.duration * self._units)


def _undominated(tours: list[Tour]) -> list[Tour]:
    """Return the tours for which no other tour is neither longer nor later."""
    found: list[Tour] = []
    for one in sorted(tours):
        if not found or one.end < found[-1].end:
            found.append(one)
    return found


def round_length(length: int, places: int) -> int:
    """Convert a length from units of 10**-MAX_PLACES to units of 10**-places, rounding half up."""
    unit = Fraction(10**places, 10**MAX_PLACES)
    return int(2 * length * unit + 1) // 2
