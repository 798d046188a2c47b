"""The best known assignment after a minimising search that has terminated or was stopped by a limit.

Robots report findings (`protocols/findings.py`): the best assignment of the whole team that any robot has received,
the values of each robot in every cycle, or only the current values. If the run was observed, all assignments that the
observers have seen count too (`known_costs.py`). The cost of each of these assignments is computed from the files, and
the cheapest assignment is the answer.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.model.outcome import PseudoTreeNode
from robochoc.model.problem import INFINITE
from robochoc.protocols.findings import Findings, Trail
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.objective import Objective


class BestKnown(NamedTuple):
    """An assignment of the robots that do not withdraw, and its cost, including withdrawal costs."""

    assignment: dict[str, int]
    cost: float


def best_known(
    compiled: CompiledTeam,
    result: SearchResult,
    withdrawal_cost: float | None = None,
    start: Mapping[str, Mapping[str, int]] | None = None,
    seen: Mapping[str, Mapping[str, int]] | None = None,
    *,
    final: bool = False,
) -> BestKnown | None:
    """Return the cheapest assignment in a result, or the start assignment if no other is cheaper.

    Args:
        compiled: The team of the search.
        result: The result of the search.
        withdrawal_cost: The withdrawal cost of a robot of weight 1 (None: no robot may withdraw).
        start: The start assignment, by robot (None: there is none).
        seen: The cheapest assignment that observers have seen, by robot (None: there is none).
        final: True if only the robots' last values count.

    Returns:
        The assignment, or None if all violate hard constraints.
    """
    best: BestKnown | None = None
    objective = Objective(compiled.team, withdrawal_cost)
    known = (start, *known_assignments(compiled, result, objective), seen)
    for own in [result.assignments] if final else [one for one in known if one is not None]:
        objective.reset()
        objective.change(own)
        if objective.cost < (best.cost if best else INFINITE):
            best = BestKnown(merged_values(own), objective.cost)
    return best


def least_violating(compiled: CompiledTeam, result: SearchResult) -> dict[str, int] | None:
    """Return the assignment of all robots in a result with the fewest violated constraints, then the least cost.

    Used after `best_known` has found nothing. None: the robots never had values together.
    """
    objective = Objective(compiled.team)
    best: tuple[tuple[int, float], dict[str, int]] | None = None
    for own in (
        result.assignments,
        *_received_assignments(compiled, result.findings),
        *_nearest_cycle(compiled, result, objective),
    ):
        objective.reset()
        objective.change(own)
        if objective.is_complete and (best is None or objective.shortfall < best[0]):
            best = objective.shortfall, merged_values(own)
    return best and best[1]


def costs_by_cycle(
    compiled: CompiledTeam, trails: Mapping[str, Trail], withdrawal_cost: float | None = None
) -> Iterator[float]:
    """Yield the cost of the robots' values in cycle 0, 1, ..., up to the last cycle that all robots have completed."""
    yield from _costs_by_cycle(compiled, trails, Objective(compiled.team, withdrawal_cost))


def _costs_by_cycle(compiled: CompiledTeam, trails: Mapping[str, Trail], objective: Objective) -> Iterator[float]:
    objective.reset()
    for changed in _changes(compiled, trails):
        objective.change(changed)
        yield objective.cost


def shortfalls_by_cycle(
    compiled: CompiledTeam, trails: Mapping[str, Trail], objective: Objective
) -> Iterator[tuple[int, float]]:
    """Yield the number of violated hard constraints and the cost of all others in each cycle, as `costs_by_cycle`."""
    objective.reset()
    for changed in _changes(compiled, trails):
        objective.change(changed)
        yield objective.shortfall


def lower_bound(findings: Mapping[str, Findings]) -> float | None:
    """Return a lower bound of the cost of all assignments, or None if robots have reported none, or not all shares."""
    shares = [found.share for found in findings.values() if found.share is not None]
    if shares and len(shares) == len(findings):
        # The correctly rounded sum is never above an integer that the exact sum does not exceed.
        return max(0, math.ceil(math.fsum(shares)))
    bounds = [found.bound for found in findings.values() if found.bound is not None]
    least = sum(bounds)
    return int(least) if bounds and least < INFINITE else None


def optima(findings: Mapping[str, Findings]) -> int | None:
    """Return the product of the numbers of optima that the roots have counted, or None if no root has counted them."""
    counts = [int(found.count, 16) for found in findings.values() if found.count is not None]
    return math.prod(counts) if counts else None


def pseudo_tree(findings: Mapping[str, Findings]) -> dict[str, PseudoTreeNode]:
    """Return the pseudo-tree that the robots have built, without robots that are not part of the tree."""
    return {name: found.place for name, found in findings.items() if found.place is not None}


def merged_values(own: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Return the values of all variables. `own` contains the values of each robot."""
    return {name: value for values in own.values() for name, value in values.items()}


_Own = dict[str, dict[str, int]]


def known_assignments(compiled: CompiledTeam, result: SearchResult, objective: Objective) -> Iterator[_Own]:
    """Yield the robots' last values, and the cheapest assignments in their findings, by robot."""
    yield result.assignments
    yield from _received_assignments(compiled, result.findings)
    yield from _best_cycle(compiled, result, objective)


def _received_assignments(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> Iterator[_Own]:
    """Yield the cheapest assignment of the whole team that any robot has received."""
    bests = [found.best for found in findings.values() if found.best is not None]
    if bests:
        best = min(bests, key=lambda one: one.cost)
        yield {name: compiled[name].behind(value) for name, value in best.values.items()}


def _best_cycle(compiled: CompiledTeam, result: SearchResult, objective: Objective) -> Iterator[_Own]:
    """Yield the robots' values in the first of the cheapest cycles."""
    if result.best_cycle:
        yield result.best_cycle
        return
    trails = {name: found.trail for name, found in result.findings.items() if found.trail is not None}
    if len(trails) < len(compiled.team.robots):
        return
    costs = result.cycle_costs
    if len(costs) != _complete_cycles(trails):
        costs = list(_costs_by_cycle(compiled, trails, objective))
    if costs:
        own: _Own = {}
        for changed in itertools.islice(_changes(compiled, trails), costs.index(min(costs)) + 1):
            own.update(changed)
        yield own


def _nearest_cycle(compiled: CompiledTeam, result: SearchResult, objective: Objective) -> Iterator[_Own]:
    """Yield the robots' values in the first of the cycles with the fewest violated constraints."""
    trails = {name: found.trail for name, found in result.findings.items() if found.trail is not None}
    if len(trails) < len(compiled.team.robots):
        return
    shortfalls = list(shortfalls_by_cycle(compiled, trails, objective))
    if shortfalls:
        own: _Own = {}
        for changed in itertools.islice(_changes(compiled, trails), shortfalls.index(min(shortfalls)) + 1):
            own.update(changed)
        yield own


def _changes(compiled: CompiledTeam, trails: Mapping[str, Trail]) -> Iterator[_Own]:
    """Yield the changed values in each cycle that all robots have completed."""
    changes: dict[int, _Own] = {}
    for name, trail in trails.items():
        for cycle, index in trail.entries:
            changes.setdefault(cycle, {})[name] = compiled[name].solution(index)
    for cycle in range(_complete_cycles(trails)):
        yield changes.get(cycle, {})


def _complete_cycles(trails: Mapping[str, Trail]) -> int:
    """Return the number of cycles that all robots have completed."""
    return min((trail.cycle for trail in trails.values()), default=-1) + 1
