"""The best that is known of a search that minimises: of one that has ended, or that a limit has cut short.

Robots tell what they know (`protocols/findings.py`): an assignment of all that one of them has heard of, the values
that each has had in every cycle, or just the values that they have now. All of these are assignments whose cost
anybody who sees the files can tell; the cheapest is the answer.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from robochoc.communication.run_result import RunResult
from robochoc.model.outcome import PseudoTreeNode
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.findings import Findings, Trail
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.objective import Objective


class BestKnown(NamedTuple):
    """An assignment of the robots that do not step aside, and what it costs: what constraints and absences charge."""

    assignment: dict[str, int]
    cost: float


def best_known(compiled: CompiledTeam, result: RunResult, aside: float | None = None) -> BestKnown | None:
    """The cheapest assignment that `result` tells of; None when all that it tells of break hard constraints.

    `compiled` is what the robots have worked on.
    """
    best: BestKnown | None = None
    for own in (result.assignments, *_heard_of(compiled, result.findings), *_best_cycle(compiled, result, aside)):
        objective = Objective(compiled.team, aside)
        objective.change(own)
        if objective.cost < (best.cost if best else INFINITE):
            best = BestKnown(merged_values(own), objective.cost)
    return best


def costs_by_cycle(compiled: CompiledTeam, trails: Mapping[str, Trail], aside: float | None = None) -> Iterator[float]:
    """The cost of the values that all robots had in cycle 0, 1, ..., as far as all have come."""
    objective = Objective(compiled.team, aside)
    for changed in _changes(compiled, trails):
        objective.change(changed)
        yield objective.cost


def lower_bound(findings: Mapping[str, Findings]) -> float | None:
    """No assignment costs less; None when nobody can tell."""
    bounds = [found.bound for found in findings.values() if found.bound is not None]
    least = sum(bounds)
    return int(least) if bounds and least < INFINITE else None


def pseudo_tree(findings: Mapping[str, Findings]) -> dict[str, PseudoTreeNode]:
    """The pseudo-tree that the robots have built: those that have their place in it."""
    return {name: found.place for name, found in findings.items() if found.place is not None}


def merged_values(own: Mapping[str, Mapping[str, int]]) -> dict[str, int]:
    """The values of all robots' variables."""
    return {name: value for values in own.values() for name, value in values.items()}


def robots_without_values(team: Team, assignment: Mapping[str, int]) -> tuple[str, ...]:
    """The robots that have no values: they step aside."""
    return tuple(robot.name for robot in team.robots if robot.variables[0].name not in assignment)


_Own = dict[str, dict[str, int]]


def _heard_of(compiled: CompiledTeam, findings: Mapping[str, Findings]) -> Iterator[_Own]:
    """The cheapest assignment that some robot has heard of."""
    bests = [found.best for found in findings.values() if found.best is not None]
    if bests:
        best = min(bests, key=lambda one: one.cost)
        yield {name: compiled[name].behind(value) for name, value in best.values.items()}


def _best_cycle(compiled: CompiledTeam, result: RunResult, aside: float | None) -> Iterator[_Own]:
    """What the robots had in the cheapest cycle, the first of several."""
    trails = {name: found.trail for name, found in result.findings.items() if found.trail is not None}
    if len(trails) < len(compiled.team.robots):
        return
    costs = list(costs_by_cycle(compiled, trails, aside))
    if costs:
        own: _Own = {}
        for changed in itertools.islice(_changes(compiled, trails), costs.index(min(costs)) + 1):
            own.update(changed)
        yield own


def _changes(compiled: CompiledTeam, trails: Mapping[str, Trail]) -> Iterator[_Own]:
    """For each cycle that all robots have behind them, the values of those that have changed."""
    changes: dict[int, _Own] = {}
    for name, trail in trails.items():
        for cycle, index in trail.entries:
            changes.setdefault(cycle, {})[name] = compiled[name].solution(index)
    for cycle in range(min((trail.cycle for trail in trails.values()), default=-1) + 1):
        yield changes.get(cycle, {})
