"""An assignment problem, solved by one call of OR-Tools and by a team: the table of docs/guides/coming-from.

    python benchmarks/central_or_team.py [ROBOTS ...]

Each of n robots does one of n tasks, each task is done once, and costs are drawn from 1 to 99 with seed 1. OR-Tools has
its own model, with `add_all_different` and `add_element`, and all cores. The team runs in the simulator, in one thread.
"""

from __future__ import annotations

import argparse
import random
import time

from ortools.sat.python import cp_model

import robochoc

LIMIT_S = 30.0
TEAM_PROTOCOLS = ("sfb", "dpop", "gdba")


def costs_of(robots: int) -> list[list[int]]:
    """Return the cost of each task for each robot."""
    generator = random.Random(1)
    return [[generator.randrange(1, 100) for _ in range(robots)] for _ in range(robots)]


def solved_by_ortools(costs: list[list[int]]) -> str:
    """Return status and cost of OR-Tools' answer."""
    model = cp_model.CpModel()
    tasks = [model.new_int_var(0, len(costs) - 1, "") for _ in costs]
    paid = [model.new_int_var(1, 99, "") for _ in costs]
    model.add_all_different(tasks)
    for task, cost, row in zip(tasks, paid, costs, strict=True):
        model.add_element(task, row, cost)
    model.minimize(sum(paid))
    solver = cp_model.CpSolver()
    solver.parameters.max_time_in_seconds = LIMIT_S
    status = solver.solve(model)
    return f"{solver.status_name(status).lower()} {solver.objective_value:g}"


def solved_by_team(costs: list[list[int]], protocol: str) -> str:
    """Return verdict and cost of a team's answer, or the reason of a refusal."""
    model = robochoc.Model("assignment")
    tasks = [model.robot(f"robot{n}").variable("task", range(len(costs))) for n in range(len(costs))]
    model.add(robochoc.all_different(tasks))
    model.minimize(sum(robochoc.element(row, task) for row, task in zip(costs, tasks, strict=True)))
    try:
        outcome = model.solve(protocol, timeout=LIMIT_S)
    except robochoc.RobochocError as error:
        return str(error).partition(":")[0]
    return f"{outcome.verdict} {outcome.cost}"


def main() -> None:
    """Solve the problem for each number of robots on the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robots", type=int, nargs="*", default=[20, 40, 60], help="numbers of robots")
    for robots in parser.parse_args().robots:
        costs = costs_of(robots)
        for name in ("ortools", *TEAM_PROTOCOLS):
            start = time.perf_counter()
            answer = solved_by_ortools(costs) if name == "ortools" else solved_by_team(costs, name)
            print(f"{robots:4} {name:8} {time.perf_counter() - start:6.2f} s  {answer}", flush=True)


if __name__ == "__main__":
    main()
