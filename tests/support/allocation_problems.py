"""Random task allocations of every kind, and the sequential greedy algorithm on them, which auctions come to."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import replace
from random import Random
from typing import NamedTuple

from robochoc.model.allocation import TaskSpec, Worker, assignment, several_tasks
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Relation, Semantics
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.costs import normalized
from robochoc.model.problem import INFINITE, ProblemKind, Robot, Team
from robochoc.run.registry import protocol_named, protocol_names

ALLOCATING = tuple(name for name in protocol_names() if protocol_named(name).traits.allocates)
ANY_TEAM = tuple(name for name in protocol_names() if name not in ALLOCATING)
"""Protocols that take more than task allocations."""
Bundle = frozenset[str]


class Allocation(NamedTuple):
    """A team, its robots and whether its scores have diminishing marginal gain (DMG), each robot alone."""

    team: Team
    workers: list[Worker]
    model: str
    dmg: bool


def random_allocation(
    chance: Random, *, dmg: bool = False, model: str | None = None, simple: bool = False
) -> Allocation:
    """Return a random allocation: one robot or more, tasks that nobody can do, worths of any sign, ties, decimals.

    Args:
        chance: What draws it.
        dmg: Whether scores are to have diminishing marginal gain: no loads, and synergies that are negative.
        model: `assignment` or `several`; None: one of them.
        simple: Whether no robot is to need a solver for its own constraints: no loads, and no limits.
    """
    model = model or chance.choice(("assignment", "several"))
    robots, tasks = chance.randint(1, 5), chance.randint(1, 4)
    skilled, most = chance.choice((0.5, 0.8, 1.0)), chance.choice((3, 12, 200))
    single = model == "assignment"
    synergies = not single and chance.random() < 0.4
    loads = not (single or dmg or simple) and chance.random() < 0.5
    workers = []
    for robot in range(1, robots + 1):
        can = [task for task in range(1, tasks + 1) if chance.random() < skilled]
        pairs = [pair for pair in itertools.combinations(can, 2) if synergies and chance.random() < 0.5]
        worker = Worker(
            f"Robot{robot}",
            str(robot),
            f"V{robot}",
            {task: chance.randint(-most // 3, most) for task in can},
            chance.randint(1, 4) if loads else None,
            chance.randint(1, 3) if not (single or simple) and chance.random() < 0.6 else None,
            {pair: -chance.randint(1, most) if dmg else chance.randint(-most, most) for pair in pairs},
        )
        workers.append(worker)
    if not any(worker.profit for worker in workers):
        return random_allocation(chance, dmg=dmg, model=model, simple=simple)
    jobs = {task: TaskSpec(str(task), chance.randint(1, 3) if loads else 1) for task in range(1, tasks + 1)}
    variables, constraints = assignment(workers) if single else several_tasks(workers, jobs)
    units = CostUnits(maximize=True, places=chance.choice((0, 0, 2)))
    team = assemble("allocation", variables, constraints, kind=ProblemKind.DISWCSP, costs=units)
    return Allocation(team, workers, model, dmg or not (loads or synergies))


def random_allocation_team(chance: Random) -> Team:
    """Return the team of a random allocation, with costs of 0 or more that are minimised."""
    return plain(random_allocation(chance).team)


def simple_allocation_team(chance: Random) -> Team:
    """Return the same, where no robot needs a solver for its own constraints."""
    return plain(random_allocation(chance, simple=True).team)


class Congestion(NamedTuple):
    """A team whose robots do one task each: it gains `worth[robot][task]`, less `cost[task]` for each pair there."""

    team: Team
    worth: list[list[int]]
    cost: list[float]


def random_congestion(chance: Random, *, monotone: bool = False) -> Congestion:
    """Return a random game of congestion: 2 to 5 robots, which all can do all tasks; pairs may exclude each other.

    With `monotone` what a coalition gains never falls as robots join it.
    """
    robots, tasks, most = chance.randint(2, 5), chance.randint(1, 4), chance.choice((3, 20))
    cost: list[float] = [
        chance.choice((chance.randint(1, most), chance.randint(1, most), INFINITE)) for _ in range(tasks)
    ]
    if monotone:
        cost = [chance.randint(1, most) for _ in range(tasks)]
    least = [int(one) * (robots - 1) if monotone else -most // 2 for one in cost]
    worth = [[low + chance.randint(0, 3 * most) for low in least] for _ in range(robots)]
    workers = [Worker(f"R{at}", str(at), f"V{at}", dict(enumerate(own, 1))) for at, own in enumerate(worth)]
    variables, constraints = assignment(workers)
    made = [one for one in constraints if len(one.variables) == 1]
    soft = {task: int(one) for task, one in enumerate(cost, 1) if one < INFINITE}
    crowd = Relation(
        "crowd", 2, Semantics.SOFT, tuple((task, task) for task in soft), tuple(-one for one in soft.values())
    )
    alone = tuple((task, task) for task, one in enumerate(cost, 1) if one == INFINITE)
    for scope in itertools.combinations([f"V{at}" for at in range(robots)], 2):
        made.append(Constraint("crowd", crowd, scope, scope))
        made.append(Constraint("alone", Relation("alone", 2, Semantics.CONFLICTS, alone), scope, scope))
    units = CostUnits(maximize=True)
    team = assemble("congestion", variables, iter(made), kind=ProblemKind.DISWCSP, costs=units)
    return Congestion(team, worth, cost)


def plain(team: Team) -> Team:
    """Return `team` with costs of 0 or more that are minimised, and told as they are."""
    robots = normalized(team).robots
    own = [tuple(replace(one, offset=0) for one in robot.private) for robot in robots]
    made = [replace(robot, private=costs, user_units=PLAIN_COSTS) for robot, costs in zip(robots, own, strict=True)]
    return replace(team, robots=tuple(made))


def tables(allocation: Allocation) -> dict[str, dict[Bundle, float]]:
    """Return by robot the least cost of its own for each set of tasks that others can do too."""
    able = [task for worker in allocation.workers for task in worker.profit]
    shared = {task for task in able if able.count(task) > 1}
    return {robot.name: _table(robot, shared, allocation.model) for robot in normalized(allocation.team).robots}


def _table(robot: Robot, shared: set[int], model: str) -> dict[Bundle, float]:
    found: dict[Bundle, float] = {}
    names = [variable.name for variable in robot.variables]
    for values in itertools.product(*(variable.domain for variable in robot.variables)):
        own = dict(zip(names, values, strict=True))
        if model == "assignment":
            done = set(values) & shared
        else:
            done = {int(name.partition(".")[2]) for name, value in own.items() if value} & shared
        bundle = frozenset(map(str, done))
        cost = sum(constraint.price(own) for constraint in robot.private)
        if cost < found.get(bundle, INFINITE):
            found[bundle] = cost
    return found


def greedy(allocation: Allocation, most: int | None = None) -> float:
    """Return the cost of the sequential greedy algorithm, which takes the best bid of all, again and again.

    Args:
        allocation: The problem.
        most: The tasks that a robot takes at most.

    Bids of equal amounts go to the robot of higher priority, and a robot never bids more than before.
    """
    own = tables(allocation)
    has: dict[str, Bundle] = dict.fromkeys(own, frozenset())
    limit: dict[str, float] = dict.fromkeys(own, INFINITE)
    sold: set[str] = set()
    rank = {name: place for place, name in enumerate(allocation.team.order)}
    while True:
        bids = [
            (min(score, limit[robot]), -rank[robot], score, -int(task), robot)
            for robot in own
            if most is None or len(has[robot]) < most
            for task, score in _scores(own[robot], has[robot]).items()
            if task not in sold and score > 0
        ]
        bids = [bid for bid in bids if bid[0] > 0]
        if not bids:
            return sum(own[robot][has[robot]] for robot in own)
        amount, _, _, number, robot = max(bids)
        has[robot] |= {str(-number)}
        limit[robot] = amount
        sold.add(str(-number))


def _scores(own: Mapping[Bundle, float], has: Bundle) -> dict[str, float]:
    more = [bundle for bundle in own if len(bundle) == len(has) + 1 and bundle > has]
    return {next(iter(bundle - has)): own[has] - own[bundle] for bundle in more}


def optimum(allocation: Allocation) -> float:
    """Return the least cost, over all ways to share out the tasks."""
    best: dict[Bundle, float] = {frozenset(): 0}
    for own in tables(allocation).values():
        sums: dict[Bundle, float] = {}
        for taken, before in best.items():
            for bundle, cost in own.items():
                if not taken & bundle:
                    sums[taken | bundle] = min(before + cost, sums.get(taken | bundle, INFINITE))
        best = sums
    return min(best.values())


def idle(allocation: Allocation) -> float:
    """Return the cost where no robot does a task that others can do too."""
    return sum(own[frozenset()] for own in tables(allocation).values())
