"""Counts violated hard constraints at the end of incomplete protocols, without and with a repair.

`python benchmarks/repairs.py [PROTOCOL...]` prints a table for 100 small problems of five families with hard and soft
constraints: slots and tasks (as for robots that share docks), meetings, colourings, tasks, and capacities. All have a
solution. Each protocol runs once with seed 1 in the simulator.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from itertools import combinations, pairwise
from random import Random
from statistics import mean
from typing import Any

import robochoc

PROBLEMS = 100
PROTOCOLS = (
    *("dsa", "a-dsa", "mixed-dsa", "dsa-sdp", "mgm", "mgm2", "gdba", "dgls", "lamdls", "lamdls-2", "regret-matching"),
    *("d-gibbs", "duct", "cocoa", "maxsum", "async-maxsum", "maxsum-ad", "bounded-maxsum", "adpop", "acls"),
    *("gca-mgm", "mcs-mgm"),
)


def _priced(chance: Random, most: int, variable: Any, size: int) -> Any:  # noqa: ANN401 - terms of a model
    """Return a term with a random cost for each value of a variable."""
    prices = [chance.randint(0, most) for _ in range(size)]
    return robochoc.function(lambda value: prices[value], variable)


def _slots(chance: Random, model: robochoc.Model) -> None:
    many, slots, places = chance.randint(4, 7), chance.randint(3, 4), chance.randint(4, 6)
    robots = range(many)
    at = {robot: (chance.randint(0, 12), chance.randint(0, 8)) for robot in robots}
    goals = [(chance.randint(0, 12), chance.randint(0, 8)) for _ in range(places)]
    slot: list[Any] = []
    task: list[Any] = []
    for robot in robots:
        own = model.robot(f"r{robot}")
        slot.append(own.variable("slot", range(slots)))
        task.append(own.variable("task", range(places + 1)))
    for number in range(slots):
        model.add(sum(one == number for one in slot) <= -(-many // slots))
    for one, other in combinations(task, 2):
        model.add((one != other) | (one == places))

    def way(robot: int, goal: int) -> int:
        if goal == places:
            return 30
        (x, y), (u, v) = at[robot], goals[goal]
        return abs(x - u) + abs(y - v)

    ways = [robochoc.function(lambda goal, robot=robot: way(robot, goal), task[robot]) for robot in robots]
    model.minimize(sum(ways) + sum(chance.randint(0, 9) * one for one in slot))


def _meetings(chance: Random, model: robochoc.Model) -> None:
    many, meetings, times = chance.randint(5, 8), chance.randint(4, 6), chance.randint(5, 7)
    who = [sorted(chance.sample(range(many), chance.randint(2, 3))) for _ in range(meetings)]
    at: dict[tuple[int, int], Any] = {}
    costs = []
    for person in range(many):
        mine = [meeting for meeting in range(meetings) if person in who[meeting]]
        if not mine:
            continue
        robot = model.robot(f"p{person}")
        for meeting in mine:
            at[person, meeting] = robot.variable(f"m{meeting}", range(times))
        for one, other in combinations(mine, 2):
            model.add(at[person, one] != at[person, other])
        costs += [_priced(chance, 9, at[person, meeting], times) for meeting in mine]
    for meeting, members in enumerate(who):
        for one, other in pairwise(members):
            model.add(at[one, meeting] == at[other, meeting])
    model.minimize(sum(costs))


def _colouring(chance: Random, model: robochoc.Model) -> None:
    many, colours = chance.randint(8, 14), 3
    known = [chance.randrange(colours) for _ in range(many)]
    own: list[Any] = [model.robot(f"r{robot}").variable("c", range(colours)) for robot in range(many)]
    edges = [(i, j) for i, j in combinations(range(many), 2) if known[i] != known[j]]
    costs = []
    for i, j in chance.sample(edges, min(len(edges), int(1.8 * many))):
        model.add(own[i] != own[j])
        if chance.random() < 1 / 2:
            prices = [[chance.randint(0, 9) for _ in range(colours)] for _ in range(colours)]
            costs.append(robochoc.function(lambda a, b, prices=prices: prices[a][b], own[i], own[j]))
    model.minimize(sum([*costs, *(_priced(chance, 9, one, colours) for one in own)]))


def _tasks(chance: Random, model: robochoc.Model) -> None:
    many = chance.randint(4, 8)
    tasks = many + chance.randint(0, 2)
    own: list[Any] = [model.robot(f"r{robot}").variable("t", range(tasks)) for robot in range(many)]
    for one, other in combinations(own, 2):
        model.add(one != other)
    model.minimize(sum(_priced(chance, 30, one, tasks) for one in own))


def _capacities(chance: Random, model: robochoc.Model) -> None:
    many, depots = chance.randint(5, 8), chance.randint(3, 4)
    sizes = [chance.randint(1, 3) for _ in range(many)]
    known = [chance.randrange(depots) for _ in range(many)]
    space = [
        sum(size for size, depot in zip(sizes, known, strict=True) if depot == number) + chance.randint(0, 1)
        for number in range(depots)
    ]
    own: list[Any] = [model.robot(f"r{robot}").variable("d", range(depots)) for robot in range(many)]
    for number in range(depots):
        model.add(sum(size * (one == number) for size, one in zip(sizes, own, strict=True)) <= space[number])
    costs = [_priced(chance, 30, one, depots) for one in own]
    for i, j in chance.sample([*combinations(range(many), 2)], many // 2):
        costs.append(robochoc.function(lambda a, b: 5 * (a == b), own[i], own[j]))
    model.minimize(sum(costs))


FAMILIES: tuple[Callable[[Random, robochoc.Model], None], ...] = (_slots, _meetings, _colouring, _tasks, _capacities)


def problem(number: int) -> robochoc.Model:
    """Return one of the problems."""
    model = robochoc.Model(f"problem{number}")
    FAMILIES[number % len(FAMILIES)](Random(f"0-{number}"), model)
    return model


def row(protocol: str, optima: Sequence[float]) -> str:
    """Return the row of a protocol in the table."""
    runs = left = 0
    above: list[float] = []
    bare_above: list[float] = []
    bare_left = 0
    for number in range(PROBLEMS):
        try:
            bare = problem(number).solve(protocol=protocol, runtime="simulator", seed=1, repair=False)
        except robochoc.UnsupportedError:
            continue
        runs += 1
        repaired = bare
        if bare.cost is None:
            bare_left += 1
            repaired = problem(number).solve(protocol=protocol, runtime="simulator", seed=1)
        else:
            bare_above.append(float(bare.cost) - optima[number])
        if repaired.cost is None:
            left += 1
        else:
            above.append(float(repaired.cost) - optima[number])
    found = mean(bare_above) if bare_above else 0
    return f"| `{protocol}` | {runs} | {bare_left} | {left} | {found:.1f} | {mean(above):.1f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("protocols", nargs="*", metavar="PROTOCOL", default=PROTOCOLS)
    protocols: Sequence[str] = parser.parse_args().protocols
    optima = [float(problem(number).solve(protocol="central").cost or 0) for number in range(PROBLEMS)]
    print("| protocol | problems | violated | violated after the repair | above the optimum | with repairs |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for protocol in protocols:
        print(row(protocol, optima), flush=True)


if __name__ == "__main__":
    main()
