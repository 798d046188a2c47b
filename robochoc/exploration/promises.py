"""The promises of incomplete protocols about costs, as their traits declare them.

They hold in every order of deliveries, if no message is lost:

- `Traits.cost_never_rises`: no cycle ends with a higher cost than the cycle before. A cycle is complete when all robots
  have chosen their values for it, which each robot records (`Findings.trail`). So a state in the middle of a cycle does
  not count.
- `Traits.optimal_groups`: if no robot changed its value in the last cycle, no group of this size can lower the
  cost. Groups that share no constraint need not be excluded: if such a group could, so could a part of it.
- `Traits.share_of_optimum`: the profit of an allocation with one task for each robot is at least this share of the
  maximum.
- `Protocol.most_above_bound`: the cost at the end is at most so much above the lower bound.

Costs are compared as the protocols compare them: violated hard constraints count first.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from robochoc.exploration.local_steps import LocalState
from robochoc.model.costs import user_cost
from robochoc.model.problem import INFINITE
from robochoc.protocols.findings import Trail
from robochoc.protocols.settings import read_settings
from robochoc.run.incumbent import lower_bound, shortfalls_by_cycle
from robochoc.run.phases import RunPhase
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.objective import Objective

Shortfall = tuple[int, float]


class Promises:
    """The promises of the protocol of `phase` for a team.

    Args:
        compiled: The team.
        phase: The search.
        minimum: The minimum cost of a solution, or `INFINITE` if there is none.
    """

    def __init__(self, compiled: CompiledTeam, phase: RunPhase, minimum: float) -> None:
        self._compiled, self._traits, self._minimum = compiled, phase.traits, minimum
        groups = phase.traits.optimal_groups
        settings = read_settings(phase.protocol, phase.parameters.settings)
        self._group_size: int = getattr(settings, groups) if isinstance(groups, str) else groups
        self._objective = Objective(compiled.team)
        self._seen: dict[tuple[object, ...], str] = {}

    def on_the_way(self, robots: Sequence[LocalState]) -> str:
        """Return the broken promise in a state at any time; empty if there is none."""
        trails = self._trails(robots) if self._traits.cost_never_rises else {}
        if not trails:
            return ""
        key = tuple([(trail.cycle, *trail.entries) for trail in trails.values()])
        if key not in self._seen:
            self._seen[key] = self._rise(trails)
        return self._seen[key]

    def at_the_end(self, robots: Sequence[LocalState]) -> str:
        """Return the broken promise when the search is over; empty if there is none."""
        return self._better_group(robots) or self._low_profit(robots) or self._excess(robots)

    def _rise(self, trails: Mapping[str, Trail]) -> str:
        found = list(shortfalls_by_cycle(self._compiled, trails, self._objective))
        for cycle, (before, after) in enumerate(itertools.pairwise(found), 1):
            if after > before:
                return f"the cost rises from {_text(before)} to {_text(after)} in cycle {cycle}; it must never rise"
        return ""

    def _better_group(self, robots: Sequence[LocalState]) -> str:
        trails = self._trails(robots)
        if not self._group_size or not trails or not _is_quiet(trails):
            return ""
        own = self._assignments(robots)
        now = self._shortfall(own)
        for moves in self._moves():
            after = self._shortfall({**own, **moves})
            if after < now:
                return (
                    f"no robot has moved in the last cycle, but {', '.join(moves)} could lower the cost"
                    f" from {_text(now)} to {_text(after)}"
                )
        return ""

    def _moves(self) -> Iterator[dict[str, dict[str, int]]]:
        """Yield each combination of new values of a group, by robot."""
        names = self._compiled.team.order
        for group in itertools.combinations(names, min(self._group_size, len(names))):
            values = [
                [domain.solution(index) for index in range(len(domain.values))]
                for domain in map(self._compiled.__getitem__, group)
            ]
            for chosen in itertools.product(*values):
                yield dict(zip(group, chosen, strict=True))

    def _low_profit(self, robots: Sequence[LocalState]) -> str:
        share, team = self._traits.share_of_optimum, self._compiled.team
        one_task_each = all(len(robot.variables) == 1 for robot in team.robots)
        if not share or not one_task_each or self._minimum == INFINITE:
            return ""
        broken, cost = self._shortfall(self._assignments(robots))
        profit, most = user_cost(team, cost), user_cost(team, self._minimum)
        if broken or Fraction(profit) < Fraction(most) * Fraction(share):
            return f"the profit is {profit}, less than {share:g} of the maximum {most}"
        return ""

    def _excess(self, robots: Sequence[LocalState]) -> str:
        known = [one.most_above_bound for one in robots if one.most_above_bound is not None]
        bound = lower_bound({str(place): one.findings for place, one in enumerate(robots)})
        if not known or bound is None or sum(known) == INFINITE:
            return ""
        broken, cost = self._shortfall(self._assignments(robots))
        if broken or cost > bound + sum(known):
            return f"the cost {_text((broken, cost))} is more than {sum(known)} above the bound {bound}"
        return ""

    def _trails(self, robots: Sequence[LocalState]) -> dict[str, Trail]:
        """Return each robot's trail; empty unless all robots have one."""
        trails = [one.findings.trail for one in robots]
        if None in trails:
            return {}
        return {name: trail for name, trail in zip(self._compiled.team.order, trails, strict=True) if trail}

    def _assignments(self, robots: Sequence[LocalState]) -> dict[str, dict[str, int]]:
        return {name: one.assignment for name, one in zip(self._compiled.team.order, robots, strict=True)}

    def _shortfall(self, own: Mapping[str, Mapping[str, int]]) -> Shortfall:
        self._objective.reset()
        self._objective.change(own)
        return self._objective.shortfall


def _is_quiet(trails: Mapping[str, Trail]) -> bool:
    """Return whether all robots have completed the same cycle, and none has changed its value in it."""
    cycles = {trail.cycle for trail in trails.values()}
    return len(cycles) == 1 and all(cycle < trail.cycle for trail in trails.values() for cycle, _ in trail.entries)


def _text(shortfall: Shortfall) -> str:
    broken, cost = shortfall
    return f"{cost}, with {broken} violated," if broken else f"{cost}"
