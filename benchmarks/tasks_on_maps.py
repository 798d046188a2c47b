"""Part `tasks on maps`: allocation of tasks with ways around walls and windows, by proofs, auctions and a solver.

    python benchmarks/tasks_on_maps.py [--lists 20] [--robots 4] [--tasks 6] [--seed 1]

Each list has a map (docs/examples/building), tours, and a window for half of its tasks; places are drawn from free
cells. Every protocol solves every list in this process, in the simulator; `central` merges the team and uses OR-Tools.
CPU seconds are those of this process and of solvers that have ended. Prints a table.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import tempfile
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from robochoc.formats.problems import read_problem
from robochoc.maps.map_file import read_map
from robochoc.maps.reachability.cell_size import cells_of
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import CentralSolverName

MAP = Path(__file__).parents[1] / "docs" / "examples" / "building" / "building.yaml"
PROVEN = "sfb"
PROTOCOLS = (PROVEN, CENTRAL, "ssi", "cbba", "cbaa")
SIDE_M = "0.5"
SKILLS = ("camera", "gripper")


class Solved(NamedTuple):
    """One run: the cost (the profit of the team), messages, bytes, and CPU seconds."""

    cost: float
    messages: int
    size: int
    cpu_s: float


def lists(count: int, robots: int, tasks: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield random lists; the same seed gives the same lists."""
    cells = cells_of(read_map(MAP), Fraction("0.2"), 1000, Fraction(SIDE_M))
    places = [[float(part) for part in cells.centre(cell)] for cell in cells.free]
    chance = Random(seed)
    for _ in range(count):
        spots = chance.sample(places, robots + tasks)
        yield {
            "map": str(MAP),
            "tours": True,
            "places": 1,
            "robots": {
                f"r{number}": {"at": spots[number], "most": 3, "skills": chance.sample(SKILLS, chance.randint(1, 2))}
                for number in range(robots)
            },
            "tasks": {
                f"t{number}": {
                    "at": spots[robots + number],
                    "worth": chance.randint(8, 20),
                    "needs": chance.choice(SKILLS),
                    "duration": chance.randint(0, 4),
                    **({"window": [early, early + 12]} if (early := chance.randrange(-20, 20)) >= 0 else {}),
                }
                for number in range(tasks)
            },
        }


def measure(team: Team, protocol: str) -> Solved:
    """Solve a team, and return the figures of the run."""
    before = os.times()
    solver = CentralSolverName.ORTOOLS if protocol == CENTRAL else CentralSolverName.AUTO
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, central_with=solver)
    found = solve(team, options)
    after = os.times()
    cpu_s = sum(after[:4]) - sum(before[:4])
    return Solved(float(found.cost or 0), sum(found.metrics.messages.values()), found.metrics.bytes, cpu_s)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, default in (("lists", 20), ("robots", 4), ("tasks", 6), ("seed", 1)):
        parser.add_argument(f"--{name}", type=int, default=default)
    given = parser.parse_args()
    runs: dict[str, list[Solved]] = {protocol: [] for protocol in PROTOCOLS}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tasks.json"
        for told in lists(given.lists, given.robots, given.tasks, given.seed):
            path.write_text(json.dumps(told))
            team = read_problem(path).team
            for protocol, found in runs.items():
                found.append(measure(team, protocol))
    print("| protocol | share of the optimum | worst | messages | bytes | CPU s |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for protocol, found in runs.items():
        shares = [one.cost / best.cost for one, best in zip(found, runs[PROVEN], strict=True) if best.cost > 0]
        figures = [statistics.mean(values) for values in zip(*found, strict=True)]
        share = f"{statistics.mean(shares):.1%} | {min(shares):.0%}"
        print(f"| `{protocol}` | {share} | {figures[1]:,.0f} | {figures[2]:,.0f} | {figures[3]:.2f} |")


if __name__ == "__main__":
    main()
