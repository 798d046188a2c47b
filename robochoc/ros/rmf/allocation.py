"""Allocates tasks to fleets, each at most one: as many tasks as possible, at the lowest sum of added costs.

The fleets' bids are a team's problem, which a protocol for costs solves: each fleet is a robot, whose private costs are
its bids. Fleets bid for each task alone; as soon as a fleet has a new task, its other bids are outdated. So a fleet
gets one task, and bids again.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from robochoc.model.allocation import Worker, assignment
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind
from robochoc.run.defaults import AUTO
from robochoc.run.options import Options, Runtime
from robochoc.run.orchestrator import solve

Costs = Mapping[str, Mapping[str, float]]
"""The cost of each task for each fleet that bids for it."""
SOLVE_S = 5.0
"""The time limit of an allocation, in seconds. Then each task in turn goes to the cheapest fleet that is free."""
_UNITS = 1000
_COST_MAX = 10**9
_DONE = 4 * _UNITS * _COST_MAX
"""The worth of a task: more than all costs of a task."""
_OVERDUE = 1000 * _DONE


def allocate(costs: Costs, overdue: Collection[str] = (), *, protocol: str = AUTO, seed: int = 0) -> dict[str, str]:
    """Return the fleet of each task that is allocated.

    Args:
        costs: The bids. Costs beyond 10^9 count as 10^9.
        overdue: The tasks that have waited for a long time: they come first.
        protocol: The protocol, for costs.
        seed: The seed of the protocol.
    """
    fleets = sorted({fleet for bids in costs.values() for fleet in bids})
    tasks = [task for task in costs if costs[task]]
    if not tasks:
        return {}
    profits: dict[str, dict[int, int]] = {fleet: {} for fleet in fleets}
    for number, task in enumerate(tasks, start=1):
        for fleet, cost in costs[task].items():
            worth = _DONE + _OVERDUE * (task in overdue)
            profits[fleet][number] = worth - round(min(max(cost, -_COST_MAX), _COST_MAX) * _UNITS)
    workers = [Worker(f"F{place}", f"F{place}", f"F{place}.task", profits[fleet]) for place, fleet in enumerate(fleets)]
    variables, constraints = assignment(workers)
    team = assemble(
        "fleets", variables, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(maximize=True, places=0)
    )
    outcome = solve(team, Options(protocol, Runtime.SIMULATOR, seed, timeout=SOLVE_S))
    chosen = {
        tasks[number - 1]: fleets[place]
        for place, worker in enumerate(workers)
        if (number := outcome.assignment.get(worker.variable, 0))
    }
    return chosen or cheapest_first(costs)


def cheapest_first(costs: Costs) -> dict[str, str]:
    """Return the fleet of each task if the cheapest bids win, one after the other."""
    bids = sorted((cost, task, fleet) for task, found in costs.items() for fleet, cost in found.items())
    chosen: dict[str, str] = {}
    for _, task, fleet in bids:
        if task not in chosen and fleet not in chosen.values():
            chosen[task] = fleet
    return chosen
