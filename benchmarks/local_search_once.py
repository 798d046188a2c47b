"""Colour one random graph once: `local_search_once.py PROTOCOL AGENTS DEGREE SEED CYCLES [NAME=VALUE ...]`.

A program of its own, so that its memory is that of this run alone. Prints what came of it as JSON.
"""

from __future__ import annotations

import json
import resource
import sys
import time
from random import Random

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats import PREDEFINED
from robochoc.model.problem import Child, Constraint, Domain, Parent, ProblemKind, Robot, Team, Variable
from robochoc.run.incumbent import costs_by_cycle
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters

COLOURS = Domain("Colours", (range(3),))


def soft_colouring(agents: int, degree: int, seed: int) -> Team:
    """A random graph with `agents * degree / 2` edges, each of which charges 1 for equal colours at its ends."""
    chance = Random(seed)
    edges: set[tuple[int, int]] = set()
    while len(edges) < agents * degree // 2:
        i, j = sorted((int(chance.random() * agents), int(chance.random() * agents)))
        if i < j:
            edges.add((i, j))
    above: dict[int, list[Parent]] = {agent: [] for agent in range(agents)}
    below: dict[int, list[Child]] = {agent: [] for agent in range(agents)}
    for i, j in sorted(edges):
        names = (f"V{i}", f"V{j}")
        above[j].append(Parent(f"Robot{i}", (Constraint(f"C{i}.{j}", PREDEFINED["neq"], names, names, cost=1),)))
        below[i].append(Child(f"Robot{j}", (f"V{i}",)))
    robots = (
        Robot(
            name=f"Robot{agent}",
            kind=ProblemKind.DISWCSP,
            variables=(Variable(f"V{agent}", COLOURS),),
            parents=tuple(above[agent]),
            children=tuple(below[agent]),
        )
        for agent in range(agents)
    )
    return Team(f"soft-colouring-{agents}-{degree}-{seed}", tuple(robots))


def main() -> None:
    """Solve, and print the cost in each cycle, the counts, and what the search took."""
    name, agents, degree, seed, cycles, *settings = sys.argv[1:]
    team = soft_colouring(int(agents), int(degree), int(seed))
    given = {"cycles": cycles, **dict(setting.split("=", 1) for setting in settings)}
    run = Simulation(team, protocol_named(name), Concurrent(int(seed)), parameters=RunParameters(int(seed), given))
    cpu_s, wall_s = time.process_time(), time.perf_counter()
    result = run.search()
    cpu_s, wall_s = time.process_time() - cpu_s, time.perf_counter() - wall_s
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    trails = {name: found.trail for name, found in result.findings.items() if found.trail}
    told = {
        "costs": list(costs_by_cycle(run.compiled, trails)),
        "messages": sum(result.metrics.messages.values()),
        "bytes": result.metrics.bytes,
        "ncccs": result.metrics.ncccs,
        "cpu_s": cpu_s,
        "wall_s": wall_s,
        "memory_mb": memory_mb,
    }
    print(json.dumps(told))


if __name__ == "__main__":
    main()
