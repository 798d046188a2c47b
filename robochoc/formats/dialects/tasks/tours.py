"""The shortest tours of a robot from its position to all tasks in a set, in an order that meets all deadlines.

They are found by dynamic programming over sets and their last tasks (Held and Karp, SIAM J. 10, 1962): an earlier
arrival at a task is never worse for the following tasks. A tour does not return to its start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from fractions import Fraction

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.tasks.entries import MAX_PLACES, Point, RobotEntry, TaskEntry
from robochoc.system.lazy_dataclass import dataclass

MAX_SETS = 4096
"""The maximum number of task sets for which a robot has time and capacity."""
TaskSet = tuple[int, ...]
"""Numbers of tasks, in ascending order."""


@dataclass(frozen=True)
class TourSearch:
    """The search for the tours of one robot.

    Attributes:
        name: The robot's name.
        robot: The robot. It has a position.
        tasks: The tasks that have a position and that the robot can do, by number.
        way: Returns the length of the way between two positions, in units of 10**-MAX_PLACES.
    """

    name: str
    robot: RobotEntry
    tasks: Mapping[int, TaskEntry]
    way: Callable[[Point, Point], int]

    def lengths(self) -> dict[TaskSet, int]:
        """Return the length of the shortest tour for each set of tasks for which the robot has time and capacity.

        Raises:
            MistakeError: if there are more than `MAX_SETS` sets.
        """
        ends: dict[TaskSet, dict[int, int]] = {(): {}}
        level: list[TaskSet] = [()]
        legs = {
            (one, other): self.way(self.tasks[one].at, self.tasks[other].at)
            for one in self.tasks
            for other in self.tasks
            if one != other
        }
        first = {task: self.way(self.robot.at, entry.at) for task, entry in self.tasks.items()}
        while level:
            larger = []
            for tasks in level:
                for more in self._larger_sets(tasks):
                    found = dict(self._last_tasks(more, ends, first, legs))
                    if found:
                        ends[more] = found
                        larger.append(more)
                        self._check_count(len(ends))
            level = larger
        return {tasks: min(found.values()) for tasks, found in ends.items() if tasks}

    def _larger_sets(self, tasks: TaskSet) -> Iterator[TaskSet]:
        """Yield the sets with one more task, with a higher number, for which the robot has capacity."""
        if self.robot.most is not None and len(tasks) >= self.robot.most:
            return
        load = sum(self.tasks[task].load for task in tasks)
        for task in self.tasks:
            room = self.robot.capacity
            if (not tasks or task > tasks[-1]) and (room is None or load + self.tasks[task].load <= room):
                yield (*tasks, task)

    def _last_tasks(
        self,
        tasks: TaskSet,
        ends: Mapping[TaskSet, Mapping[int, int]],
        first: Mapping[int, int],
        legs: Mapping[tuple[int, int], int],
    ) -> Iterator[tuple[int, int]]:
        """Yield the possible last tasks of a tour of `tasks`, each with the length of the shortest such tour."""
        for last in tasks:
            before = ends.get(tuple([task for task in tasks if task != last]))
            if before is None:
                continue
            length = min((way + legs[task, last] for task, way in before.items()), default=first[last])
            deadline = self.tasks[last].deadline
            if deadline is None or length <= deadline * self.robot.speed * 10**MAX_PLACES:
                yield last, length

    def _check_count(self, sets: int) -> None:
        if sets > MAX_SETS:
            raise MistakeError(
                f"the robot '{shortened(self.name)}' has time and capacity for more than {MAX_SETS:,} sets of tasks",
                "write most:, write a smaller capacity:, or delete tours:",
                self.robot.line,
            )


def round_length(length: int, places: int) -> int:
    """Convert a length from units of 10**-MAX_PLACES to units of 10**-places, rounding half up."""
    unit = Fraction(10**places, 10**MAX_PLACES)
    return int(2 * length * unit + 1) // 2
