"""The shortest tours of a robot from its position to all tasks in a set, in an order that meets all times.

They are found by dynamic programming over sets and their last places (Held and Karp, SIAM J. 10, 1962). Of two tours
with the same last place and the same starts, the one that is neither longer nor later is never worse for the following
tasks; a robot that waits for the beginning of a window may have several tours that differ in this. A tour does not
return to its start.

A task that must precede others, or follow others, or that a team starts together, starts at a multiple of a unit of
time, its *start*, which other robots can see. A task that only precedes others starts as early as possible: this is
never worse for any robot. A task that follows others, or has a team, may start at any later time, too.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from fractions import Fraction
from typing import NamedTuple

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.system.lazy_dataclass import dataclass
from robochoc.tasks.entries import MAX_PLACES, Point, RobotEntry, TaskEntry

MAX_SETS = 4096
"""The maximum number of task sets for which a robot has time and capacity; with starts, of sets and their starts."""
TaskSet = tuple[int, ...]
"""Numbers of tasks, in ascending order."""
_HOME = 0
"""The number of the robot's position; tasks are numbered from 1."""


class Tour(NamedTuple):
    """A tour: its length in units of 10**-MAX_PLACES, the time of its end, its tasks in order, and starts by task."""

    length: int
    end: int
    order: tuple[int, ...]
    starts: tuple[tuple[int, int], ...] = ()


_Ends = Mapping[int, list[Tour]]
"""The tours of a set that no other tour dominates, by the number of their last place."""


@dataclass(frozen=True)
class Precedence:
    """The order of tasks.

    Attributes:
        step: The unit of starts.
        first: The numbers of tasks that precede others.
        last: The numbers of tasks that wait for other robots: they follow others, or have a team.
    """

    step: Fraction
    first: Collection[int] = ()
    last: Collection[int] = ()


@dataclass(frozen=True)
class TourSearch:
    """The search for the tours of one robot.

    Attributes:
        name: The robot's name.
        robot: The robot.
        tasks: The tasks that the robot can do, and that have a position or times, by number.
        way: Returns the length of the way between two positions, in units of 10**-MAX_PLACES; None if there is none.
        precedence: The order of tasks.
    """

    name: str
    robot: RobotEntry
    tasks: Mapping[int, TaskEntry]
    way: Callable[[Point, Point], int | None]
    precedence: Precedence

    def tours(self) -> dict[TaskSet, list[Tour]]:
        """Return the shortest tours for each set of tasks for which the robot has time and capacity.

        A set has a tour for each combination of starts.

        Raises:
            MistakeError: if there are more than `MAX_SETS` tours.
        """
        ends: dict[TaskSet, _Ends] = {(): {_HOME: [Tour(0, 0, ())]}}
        level: list[TaskSet] = [()]
        legs = self._legs()
        clock = _Clock(self.robot, self.tasks, self.precedence)
        tours = 1
        while level:
            larger = []
            for tasks in level:
                for more in self._larger_sets(tasks):
                    found = self._ends(more, ends, legs, clock)
                    if found:
                        ends[more] = found
                        larger.append(more)
                        tours += len({one.starts for some in found.values() for one in some})
                        self._check_count(tours)
            level = larger
        return {tasks: _shortest(found) for tasks, found in ends.items() if tasks}

    def _legs(self) -> dict[tuple[int, int], int]:
        """Return the length of the way between each two places, by their numbers; no entry if there is no way."""
        places = {_HOME: self.robot.at, **{number: entry.at for number, entry in self.tasks.items()}}
        return {
            (one, other): length
            for one, start in places.items()
            for other in self.tasks
            if one != other and start and places[other] and (length := self.way(start, places[other])) is not None
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
    ) -> _Ends:
        """Return the tours of `tasks` that no other tour dominates, by their last places."""
        found: dict[int, list[Tour]] = defaultdict(list)
        for last in tasks:
            moves = bool(self.robot.at and self.tasks[last].at)
            for before, tours in ends.get(tuple([task for task in tasks if task != last]), {}).items():
                leg = legs.get((before, last)) if moves else 0
                for one in tours if leg is not None else ():
                    for start, end in clock.ends(last, one.end, leg or 0):
                        starts = one.starts if start is None else tuple(sorted((*one.starts, (last, start))))
                        found[last if moves else before].append(
                            Tour(one.length + (leg or 0), end, (*one.order, last), starts)
                        )
        return {last: _undominated(some) for last, some in found.items()}

    def _check_count(self, tours: int) -> None:
        if tours > MAX_SETS:
            limits = "write most:, write a smaller capacity:, or delete tours:"
            if self.precedence.last:
                limits = "write most:, a larger step:, or shorter windows:"
            raise MistakeError(
                f"the robot '{shortened(self.name)}' has time and capacity for more than {MAX_SETS:,} sets of tasks"
                f"{' and their starts' if self.precedence.last else ''}",
                limits,
                self.robot.line,
            )


class _Clock:
    """Computes with times as integers, in a unit in which all times of the tasks and of the ways are integers.

    Args:
        robot: The robot, with its speed.
        tasks: The tasks with times, by number.
        precedence: The order of tasks.
    """

    def __init__(self, robot: RobotEntry, tasks: Mapping[int, TaskEntry], precedence: Precedence) -> None:
        per_time = robot.speed * 10**MAX_PLACES  # lengths travelled in a unit of time
        given = [
            time for one in tasks.values() for time in (*one.window, one.deadline, one.duration) if time is not None
        ]
        self._per_length = math.lcm(*((time * per_time).denominator for time in (*given, precedence.step)))
        self._units = per_time * self._per_length
        self._tasks = tasks
        self._precedence = precedence

    def ends(self, number: int, start: int, way: int) -> Iterator[tuple[int | None, int]]:
        """Yield the possible starts and ends of a task after a way that begins at `start`; nothing if it is too late.

        The start is None for a task that is neither ordered nor joint.
        """
        task = self._tasks[number]
        arrival = start + way * self._per_length
        earliest, latest = task.window
        if task.deadline is not None and arrival > task.deadline * self._units:
            return
        begin, duration = max(arrival, int(earliest * self._units)), int(task.duration * self._units)
        if number not in self._precedence.first and number not in self._precedence.last:
            if latest is None or begin <= latest * self._units:
                yield None, begin + duration
            return
        step = int(self._precedence.step * self._units)
        first, end = -(-begin // step), math.floor((latest or Fraction(0)) / self._precedence.step)
        for slot in range(first, end + 1):
            yield slot, slot * step + duration
            if number not in self._precedence.last:
                return


def _shortest(ends: _Ends) -> list[Tour]:
    """Return the shortest tour for each combination of starts."""
    found: dict[tuple[tuple[int, int], ...], Tour] = {}
    for one in sorted(tour for some in ends.values() for tour in some):
        found.setdefault(one.starts, one)
    return list(found.values())


def _undominated(tours: Iterable[Tour]) -> list[Tour]:
    """Return the tours for which no other tour with the same starts is neither longer nor later."""
    earliest: dict[tuple[tuple[int, int], ...], int] = {}
    found: list[Tour] = []
    for one in sorted(tours):
        if one.starts not in earliest or one.end < earliest[one.starts]:
            earliest[one.starts] = one.end
            found.append(one)
    return found


def round_length(length: int, places: int) -> int:
    """Convert a length from units of 10**-MAX_PLACES to units of 10**-places, rounding half up."""
    unit = Fraction(10**places, 10**MAX_PLACES)
    return int(2 * length * unit + 1) // 2
