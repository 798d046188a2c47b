"""Task allocation to robots: each task has a place, a required skill and a worth; travelling to a task has a cost.

* `assignment`: a robot does at most one task, and a task is done by at most one robot. This is ST-SR-IA, the assignment
  problem, in Gerkey and Mataric, "A formal analysis and taxonomy of task allocation in multi-robot systems", IJRR 23
  (2004). A robot's variable is its task, or 0.
* `several`: a robot does several tasks, within its capacity, and a task is done by at most one robot. This is the
  generalised assignment problem in Scerri, Farinelli, Okamoto and Tambe, "Allocating tasks in extreme teams", AAMAS
  2005. A robot has a variable for each task that it can do: 1 if the robot does the task, else 0.

The total worth of all tasks that are done, minus the distances travelled for them, is maximised. Distances are measured
from the robot to the task, on a straight line or along streets (Manhattan distance); the coordinates of robots and
tasks are integers. Straight distances are decimals, rounded to a given number of places in integer arithmetic, halves
up. With several tasks, the distance to each task is measured from the robot's initial place.
"""

from __future__ import annotations

from random import Random
from typing import assert_never

from robochoc.generators.draws import (
    MAX_AGENTS,
    MAX_COST,
    check_bounds,
    check_places,
    limited,
    random_integer,
    sample,
    seeded,
)
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
from robochoc.model.problem import ProblemKind, Team
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.suggestions import member

MAX_SIDE = 10_000
MAX_SKILLS = 100


@dataclass(frozen=True)
class Travel:
    """The places of robots and tasks, and the distances between them.

    Attributes:
        side: The largest coordinate: robots and tasks are in a square, at integer coordinates from 0 to `side`.
        distance: The measure of distances.
        places: The decimal places of straight distances.
    """

    side: int = 100
    distance: Distance = Distance.STREETS
    places: int = 0


@dataclass(frozen=True)
class Skills:
    """The skills of robots.

    Attributes:
        number: The number of skills. A task requires one, chosen uniformly at random.
        each: The number of skills per robot, chosen uniformly at random.
    """

    number: int = 1
    each: int = 1


@dataclass(frozen=True)
class DrawnTasks:
    """A random task allocation problem.

    Attributes:
        profit: The worth of a task minus the distance to it, by robot and by task for which the robot has the skill.
        load: The load of each task.
        capacity: The maximum load of a robot.
    """

    profit: dict[int, dict[int, int]]
    load: dict[int, int]
    capacity: int


def tasks(
    agents: int,
    tasks: int,
    seed: int = 0,
    *,
    worth: int = 200,
    travel: Travel = Travel(),
    skills: Skills = Skills(),
    model: TasksModel | str = TasksModel.ASSIGNMENT,
    capacity: int = 3,
) -> Team:
    """Return a random problem of allocating `tasks` to robots.

    In `assignment`, `Robot3` owns `V3`. In `several`, `V3.2` is 1 if `Robot3` does task 2; robots that can do no task
    are left out.

    Args:
        agents: The number of robots.
        tasks: The number of tasks.
        seed: The same seed gives the same problem on every machine.
        worth: The maximum worth of a task; the minimum is 1.
        travel: The places of robots and tasks, and the measure of distances.
        skills: The skills of robots.
        model: The maximum number of tasks of a robot: one (`assignment`) or several (`several`).
        capacity: The maximum load of a robot in `several`; the load of a task is from 1 to 3.

    Raises:
        ValueError: A number is out of bounds, or no robot has a required skill.
    """
    model = member(TasksModel, "model", model)
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "tasks": (tasks, 1, MAX_AGENTS)})
    check_bounds({"side": (travel.side, 1, MAX_SIDE), "worth": (worth, 1, MAX_COST)})
    check_bounds({"skills": (skills.number, 1, MAX_SKILLS), "skilled": (skills.each, 1, skills.number)})
    check_bounds({"capacity": (capacity, 1, MAX_AGENTS)})
    check_places(travel.places)
    problem = drawn_tasks(seeded(seed), (agents, tasks, worth), travel, skills, capacity)
    match model:
        case TasksModel.ASSIGNMENT:
            variables, constraints = assignment(_workers(problem))
        case TasksModel.SEVERAL:
            jobs = {task: TaskSpec(str(task), load) for task, load in problem.load.items()}
            variables, constraints = several_tasks(_workers(problem), jobs)
        case never:
            assert_never(never)
    if not variables:
        raise ValueError("no robot has a skill that a task requires; use another seed, or increase skilled")
    label = f"{travel.side}-{worth}-{skills.each}of{skills.number}-{travel.distance}{travel.places or ''}"
    room = f"-{capacity}" if model == TasksModel.SEVERAL else ""
    return assemble(
        f"tasks-{model}-{agents}-{tasks}-{label}{room}-{seed}",
        variables,
        limited(constraints),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=travel.places),
    )


def drawn_tasks(
    chance: Random, numbers: tuple[int, int, int], travel: Travel, skills: Skills, capacity: int
) -> DrawnTasks:
    """Return random tasks; `numbers` are the numbers of robots and tasks, and the maximum worth of a task."""
    agents, count, most = numbers

    def point() -> tuple[int, int]:
        return random_integer(chance, 0, travel.side), random_integer(chance, 0, travel.side)

    robots = {robot: (point(), set(sample(chance, skills.number, skills.each))) for robot in range(1, agents + 1)}
    profit: dict[int, dict[int, int]] = {robot: {} for robot in robots}
    load = {}
    for task in range(1, count + 1):
        place, skill = point(), random_integer(chance, 0, skills.number - 1)
        worth, load[task] = random_integer(chance, 1, most) * 10**travel.places, random_integer(chance, 1, 3)
        for robot, (start, has) in robots.items():
            if skill in has:
                profit[robot][task] = worth - distance_between(start, place, travel.distance, travel.places)
    return DrawnTasks(profit, load, capacity)


def _workers(problem: DrawnTasks) -> list[Worker]:
    return [
        Worker(f"Robot{robot}", str(robot), f"V{robot}", profit, problem.capacity)
        for robot, profit in problem.profit.items()
    ]
