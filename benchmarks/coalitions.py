"""Measure protocols that are private against coalitions, for the tables in docs/guides/privacy.md.

    python benchmarks/coalitions.py [PROBLEMS]

First the messages, bytes and CPU time of a comparison in PC-SyncBB, and the number of comparisons in an open search (5
values, density .3, costs up to 10), which is counted on known costs, since some searches would take hours; then one
cycle of P-DSA, P-MGM and P-Max-Sum. The last table is the mean share of tables that single robots of three can exclude
(2 values, costs of 0 and 1).
"""

from __future__ import annotations

import argparse
import itertools
import time
from random import Random
from statistics import mean, median

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.problem import Team
from robochoc.privacy import CoalitionLoss, coalition_report
from robochoc.protocols.private.p_dsa import PDSA
from robochoc.protocols.private.p_maxsum import PMaxSum
from robochoc.protocols.private.p_mgm import PMGM
from robochoc.protocols.private.pc_syncbb import PCSyncBB
from robochoc.protocols.private.shared_search import SharedSearchProtocol
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters

PROBLEMS = 20
VALUES = 5
ROBOTS = (5, 7, 10)
MESSAGES = 20_000
PRIVATE = ("p-dsa", "p-mgm", "p-maxsum")
EXCLUDING = ("syncbb", "afb", "adopt", "dpop", "o-dpop", "mgm", "dsa", "maxsum", "pc-syncbb", *PRIVATE)
SETTINGS = {name: {"cycles": "2" if name in PRIVATE else "5"} for name in ("mgm", "dsa", "maxsum", *PRIVATE)}
IN_CYCLES: tuple[tuple[type[SharedSearchProtocol], dict[str, str]], ...] = (
    (PDSA, {}),
    (PMGM, {}),
    (PMaxSum, {"topology": "open"}),
    (PMaxSum, {"topology": "hidden"}),
)


def problem(robots: int, seed: int) -> Team:
    """Return a random team with costs."""
    return random_csp(robots, VALUES, 0.3, 0, seed=seed, max_cost=10)


def comparisons(team: Team, seed: int) -> int:
    """Return the number of comparisons in an open search, in which robots try their values in a random order."""
    chance, count, least = Random(seed), 0, float("inf")
    names = [variable for robot in team.robots for variable in robot.variables]
    path: dict[str, int] = {}
    above = [[one for one in team.constraints() if one.variables[-1] == variable.name] for variable in names]

    def visit(place: int, paid: float) -> None:
        nonlocal count, least
        values = [*names[place].domain]
        chance.shuffle(values)
        for value in values:
            path[names[place].name] = value
            cost = paid + sum(one.price(path) for one in above[place])
            count += 1
            if cost < least and place + 1 == len(names):
                least = cost
            elif cost < least:
                visit(place + 1, cost)

    visit(0, 0)
    return count


def print_costs(problems: int) -> None:
    """Print the costs of PC-SyncBB."""
    print("| robots | messages | bytes | CPU ms | comparisons, median of an open search |\n|" + " ---: |" * 5)
    for robots in ROBOTS:
        with Simulation(problem(robots, 0), PCSyncBB, Concurrent(seed=0)) as simulation:
            began = time.process_time()
            metrics = simulation.search(messages=MESSAGES).metrics
            spent = time.process_time() - began
        count = metrics.messages["PublicResult"] / (robots - 1)
        numbers = (
            f"{sum(metrics.messages.values()) / count:.0f} | {metrics.bytes / count:,.0f} | {1000 * spent / count:.0f}"
        )
        searched = median(comparisons(problem(robots, seed), seed) for seed in range(problems))
        print(f"| {robots} | {numbers} | {searched:,.0f} |", flush=True)


def print_cycles() -> None:
    """Print the costs of one cycle of the searches in cycles, with the messages before it."""
    print("\n| robots | protocol | comparisons | messages | MB | CPU s |\n| ---: | --- |" + " ---: |" * 4)
    for robots, (protocol, settings) in itertools.product(ROBOTS, IN_CYCLES):
        parameters = RunParameters(0, {"cycles": "1", **settings})
        with Simulation(problem(robots, 0), protocol, Concurrent(seed=0), parameters=parameters) as simulation:
            began = time.process_time()
            metrics = simulation.search().metrics
            spent = time.process_time() - began
            robot = next(iter(simulation._hosts.values())).protocol  # noqa: SLF001 - to count comparisons
        name = " ".join([f"`{protocol.__name__}`", *settings.values()])
        count = robot.comparisons if isinstance(robot, SharedSearchProtocol) else 0
        messages = sum(metrics.messages.values())
        print(f"| {robots} | {name} | {count:,} | {messages:,} | {metrics.bytes / 1e6:.1f} | {spent:.1f} |", flush=True)


def print_losses(problems: int) -> None:
    """Print the shares of tables that coalitions of one robot of three can exclude."""
    print("\n| protocol | by own values | by messages |\n| --- | ---: | ---: |")
    for name, settings in [(name, SETTINGS.get(name, {})) for name in EXCLUDING] + [
        ("pc-syncbb", {"search": "hidden"})
    ]:
        losses: list[CoalitionLoss] = []
        for seed in range(problems):
            team = random_csp(3, 2, 1, 0, seed=seed, max_cost=1)
            parameters = RunParameters(seed, settings)
            report = coalition_report(team, protocol_named(name), 1, parameters=parameters, coins=4, costs=(0, 1))
            losses += report.losses
        values, messages = (
            mean(getattr(one, f"excluded_by_{kind}") for one in losses) for kind in ("values", "messages")
        )
        hidden = ", hidden" if "search" in settings else ""
        print(f"| `{name}`{hidden} | {values:.3f} | {messages:.3f} |", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("problems", nargs="?", type=int, default=PROBLEMS, metavar="PROBLEMS", help="how many")
    problems = parser.parse_args().problems
    print_costs(problems)
    print_cycles()
    print_losses(problems)


if __name__ == "__main__":
    main()
