"""The best that is known of a search that minimises: of one that has ended, or that a limit has cut short.

Robots report what they know (`protocols/findings.py`): the best assignment of the whole team that one of them has
received, the values that each has had in every cycle, or just the values that they have now. All of these are
assignments whose cost can be computed from the files. The cheapest is the answer.
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
    """An assignment of the robots that do not withdraw, and its cost, withdrawal costs included."""

    assignment: dict[str, int]
    cost: float


def best_known(compiled: CompiledTeam, result: SearchResult, withdrawal_cost: float | None = None) -> BestKnown | None:
    """Return the cheapest assignment in a result.

    Args:
        compiled: The team that the robots have worked on.
        result: What they have reported.
        withdrawal_cost: The withdrawal cost of a robot of weight 1 (None: no robot may withdraw).

    Returns:
        The assignment, or None if all break hard constraints.
    """
    best: BestKnown | None = None
    for own in (
        result.assignments,
        *_received_assignments(compiled, result.findings),
        *_best_cycle(compiled, result, withdrawal_cost),
    ):
        objective = Objective(compiled.team, withdrawal_cost)
        objective.change(own)
        if objective.cost < (best.cost if best else INFINITE):
            best = BestKnown(merged_values(own), objective.cost)
    return best


def costs_by_cycle(
    compiled: CompiledTeam, trails: Mapping[str, Trail], withdrawal_cost: float | None = None
) -> Iterator[float]:
    """Yield the cost of the values that the robots had in cycle 0, 1, ..., as far as all of them have come."""
    objective = Objective(compiled.team, withdrawal_cost)
    for changed in _changes(compiled, trails):
        objective.change(changed)
        yield objective.cost


def lower_bound(findings: Mapping[str, Findings]) -> float | None:
    """Return a lower bound of the cost of all assignments; None if no robot knows one."""
    bounds = [found.bound for found in findings.values() if found.bound is not None]
    least = sum(bounds)
    return int(least) if bounds and least < INFINITE else None


def optima(findings: Mapping[str, Findings]) -> int | None:
    """Return the product of what the roots have counted, each in its tree; None if none has counted."""
    counts = [int(found.count, 16) for found in findings.values() if found.count is not None]
    return math.prod(counts) if counts else None


def pseudo_tree(findings: Mapping[str, Findings]) -> dict[str, PseudoTreeNode]:
    """Return the pseudo-tree that the robots have built: the robots that have their place in it."""
    return {name: found.place for name, found in findings.items() if found.place is not None}


def merged_values(own: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """Return the values of all variables, from the values by robot."""
    return {name: value for values in own.values() for name, value in values.items()}


_Own = dict[str, dict[str, int]]


def _received_assignments(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> Iterator[_Own]:
    """Yield the cheapest assignment of the whole team that some robot has received."""
    bests = [found.best for found in findings.values() if found.best is not None]
    if bests:
        best = min(bests, key=lambda one: one.cost)
        yield {name: compiled[name].behind(value) for name, value in best.values.items()}


def _best_cycle(compiled: CompiledTeam, result: SearchResult, withdrawal_cost: float | None) -> Iterator[_Own]:
    """Yield the values that the robots had in the cheapest cycle, the first of several."""
    trails = {name: found.trail for name, found in result.findings.items() if found.trail is not None}
    if len(trails) < len(compiled.team.robots):
        return
    costs = list(costs_by_cycle(compiled, trails, withdrawal_cost))
    if costs:
        own: _Own = {}
        for changed in itertools.islice(_changes(compiled, trails), costs.index(min(costs)) + 1):
            own.update(changed)
        yield own


def _changes(compiled: CompiledTeam, trails: Mapping[str, Trail]) -> Iterator[_Own]:
    """Yield the changed values of each cycle that all robots have completed."""
    changes: dict[int, _Own] = {}
    for name, trail in trails.items():
        for cycle, index in trail.entries:
            changes.setdefault(cycle, {})[name] = compiled[name].solution(index)
    for cycle in range(min((trail.cycle for trail in trails.values()), default=-1) + 1):
        yield changes.get(cycle, {})
