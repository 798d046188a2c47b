"""Small problems and short runs for protocols that encrypt or share each cost."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from robochoc.model.problem import INFINITE, Constraint, Relation, Robot, Team
from robochoc.run.registry import protocol_named

MOST_CIPHERS = 4_000
DEAREST = 2


def affordable(protocol: str, draw: Callable[[], Team], most: int = MOST_CIPHERS) -> Team:
    """The next team that is drawn; for a protocol with encrypted tables the next small one, with small costs."""
    if not protocol_named(protocol).traits.encrypted_tables:
        return draw()
    while True:
        team = cheap(draw())
        if ciphers_at_most(team) <= most:
            return team


def short_settings(protocol: str, cycles: int) -> dict[str, str]:
    """Return settings for a short run: this number of `cycles`, or two on secret shares, in the smallest field."""
    known = protocol_named(protocol).settings
    settings = {"cycles": str(2 if hasattr(known, "bits") else cycles), "bits": "31"}
    return {name: value for name, value in settings.items() if hasattr(known, name)}


def cheap(team: Team) -> Team:
    """`team` with costs of at most `DEAREST`, but for the infinite ones."""

    def reduced(constraint: Constraint) -> Constraint:
        definition = constraint.definition
        if isinstance(definition, Relation):
            costs = tuple(map(_reduced, definition.costs))
            definition = replace(definition, costs=costs, default_cost=_reduced(definition.default_cost))
        return replace(constraint, definition=definition, cost=_reduced(constraint.cost))

    def of(robot: Robot) -> Robot:
        parents = tuple(replace(one, constraints=tuple(map(reduced, one.constraints))) for one in robot.parents)
        return replace(robot, private=tuple(map(reduced, robot.private)), parents=parents)

    return replace(team, robots=tuple(map(of, team.robots)))


def ciphers_at_most(team: Team) -> int:
    """An upper bound on the ciphers of a table, if costs are at most `DEAREST` and all weights 1."""
    sizes = [math.prod(len(variable.domain) + 1 for variable in robot.variables) for robot in team.robots]
    levels = 1 + DEAREST * len(list(team.constraints()))
    return levels * math.prod(sizes) // min(sizes)


def _reduced(cost: float) -> float:
    return cost if cost == INFINITE else cost % (DEAREST + 1)
