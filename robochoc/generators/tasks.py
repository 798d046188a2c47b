"""Task allocation to robots: tasks lie about, ask for a skill, and are worth something; to get there costs its way.

* `assignment`: a robot does one task at most, and a task is done by one robot at most. This is ST-SR-IA, the assignment
  problem, in Gerkey and Mataric, "A formal analysis and taxonomy of task allocation in multi-robot systems", IJRR 23
  (2004). A robot's variable is its task, or 0.
* `several`: a robot does as many tasks as it has room for, and a task is done by one robot at most. This is the
  generalised assignment problem of Scerri, Farinelli, Okamoto and Tambe, "Allocating tasks in extreme teams", AAMAS
  2005. A robot has a variable for each task that it could do: 1, it does it.

The sum of the worth of all tasks that are done, less the ways of those who do them, is maximised. Ways are straight
lines from the robot to the task, or along streets (Manhattan's); robots and tasks lie on points of whole numbers.
Straight ones are decimals, rounded to so many places in integer arithmetic, halves up. Of several tasks each is reached
from where the robot stands.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random
from typing import assert_never

from robochoc.generators.draws import (
    MAX_AGENTS,
    MAX_COST,
    bounded,
    check_bounds,
    check_places,
    seeded,
    some,
    uniform,
)
from robochoc.model.allocation import Distance, Job, TasksModel, Worker, assignment, several, way
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team
from robochoc.system.suggestions import member

MAX_SIDE = 10_000
MAX_SKILLS = 100


@dataclass(frozen=True)
class Ways:
    """Where robots and tasks are, and how long ways are.

    Attributes:
        side: Robots and tasks lie in a square, at whole coordinates from 0 to `side`.
        distance: How long a way is.
        places: The decimal places of straight ways.
    """

    side: int = 100
    distance: Distance = Distance.STREETS
    places: int = 0


@dataclass(frozen=True)
class Skills:
    """What robots can do.

    Attributes:
        number: The number of skills that there are. A task asks for one, each as likely as any other.
        each: The number of skills that a robot has, any choice as likely as any other.
    """

    number: int = 1
    each: int = 1


@dataclass(frozen=True)
class Tasks:
    """A problem of tasks.

    Attributes:
        profit: By robot and task that it has the skill for: what the task is worth, less the way there.
        load: The room that each task takes.
        capacity: The room that a robot has.
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
    ways: Ways = Ways(),
    skills: Skills = Skills(),
    model: TasksModel | str = TasksModel.ASSIGNMENT,
    capacity: int = 3,
) -> Team:
    """Return the random problem of `seed` of allocating `tasks` to robots.

    In `assignment`, `Robot3` owns `V3`. Of `several`, `V3.2` says whether it does task 2; who can do none is no robot.

    Args:
        agents: The number of robots.
        tasks: The number of tasks.
        seed: The same seed makes the same problem on every machine.
        worth: A task is worth from 1 to so much.
        ways: Where all are, and how long ways are.
        skills: What robots can do.
        model: How many tasks a robot can do.
        capacity: The room of a robot for several tasks, of which each takes from 1 to 3.

    Raises:
        ValueError: if a number is out of its bounds. The text says which.
    """
    model = member(TasksModel, "model", model)
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "tasks": (tasks, 1, MAX_AGENTS)})
    check_bounds({"side": (ways.side, 1, MAX_SIDE), "worth": (worth, 1, MAX_COST)})
    check_bounds({"skills": (skills.number, 1, MAX_SKILLS), "skilled": (skills.each, 1, skills.number)})
    check_bounds({"capacity": (capacity, 1, MAX_AGENTS)})
    check_places(ways.places)
    problem = drawn_tasks(seeded(seed), (agents, tasks, worth), ways, skills, capacity)
    match model:
        case TasksModel.ASSIGNMENT:
            variables, constraints = assignment(_workers(problem))
        case TasksModel.SEVERAL:
            jobs = {task: Job(str(task), load) for task, load in problem.load.items()}
            variables, constraints = several(_workers(problem), jobs)
        case never:
            assert_never(never)
    if not variables:
        raise ValueError("no robot has a skill that a task asks for; another seed, or more of skilled")
    told = f"{ways.side}-{worth}-{skills.each}of{skills.number}-{ways.distance}{ways.places or ''}"
    room = f"-{capacity}" if model == TasksModel.SEVERAL else ""
    return assemble(
        f"tasks-{model}-{agents}-{tasks}-{told}{room}-{seed}",
        variables,
        bounded(constraints),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=ways.places),
    )


def drawn_tasks(chance: Random, numbers: tuple[int, int, int], ways: Ways, skills: Skills, capacity: int) -> Tasks:
    """Return random tasks; `numbers` are those of robots and tasks, and what a task is worth at most."""
    agents, count, most = numbers

    def point() -> tuple[int, int]:
        return uniform(chance, 0, ways.side), uniform(chance, 0, ways.side)

    robots = {robot: (point(), set(some(chance, skills.number, skills.each))) for robot in range(1, agents + 1)}
    profit: dict[int, dict[int, int]] = {robot: {} for robot in robots}
    load = {}
    for task in range(1, count + 1):
        place, skill = point(), uniform(chance, 0, skills.number - 1)
        worth, load[task] = uniform(chance, 1, most) * 10**ways.places, uniform(chance, 1, 3)
        for robot, (start, has) in robots.items():
            if skill in has:
                profit[robot][task] = worth - way(start, place, ways.distance, ways.places)
    return Tasks(profit, load, capacity)


def _workers(problem: Tasks) -> list[Worker]:
    return [
        Worker(f"Robot{robot}", str(robot), f"V{robot}", profit, problem.capacity)
        for robot, profit in problem.profit.items()
    ]
