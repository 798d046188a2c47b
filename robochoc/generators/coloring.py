"""Graph colouring with too few colours: as few neighbours as possible are to have the same one.

The usual first benchmark of protocols that minimise (Modi et al., "Adopt", AIJ 161, 2005; Zhang et al., "Distributed
stochastic search and distributed breakout", AIJ 161, 2005): each constraint that is broken costs 1. The graph has a
given mean degree, and every such graph is as likely as any other.
"""

from __future__ import annotations

from random import Random

from robochoc.formats import PREDEFINED
from robochoc.generators.random_csp import MAX_AGENTS, MAX_VALUES, random_graph, team_of_edges
from robochoc.model.problem import Constraint, ProblemKind, Team


def coloring(agents: int, colors: int, degree: float, seed: int = 0, *, connected: bool = False) -> Team:
    """Return the graph colouring problem of `agents` robots with `degree` neighbours on average that `seed` stands for.

    `Robot3` owns `V3`. Two neighbours of the same colour cost 1.

    Args:
        agents: The number of robots.
        colors: The number of colours.
        degree: The average number of neighbours.
        seed: The same seed makes the same problem on every machine.
        connected: Whether graphs are drawn until one is connected.

    Raises:
        ValueError: if there is no such graph. The text says which number to change.
    """
    for what, number, most in (("agents", agents, MAX_AGENTS), ("colors", colors, MAX_VALUES)):
        if not 1 <= number <= most:
            raise ValueError(f"{what} is {number}; it must be from 1 to {most}")
    if not 0 <= degree <= agents - 1:
        raise ValueError(f"degree is {degree}; among {agents} robots it must be from 0 to {agents - 1}")
    chance = Random(seed)  # noqa: S311 - a problem, not a secret
    edges = random_graph(chance, agents, round(agents * degree / 2), connected=connected)
    scopes = {(higher, lower): (f"V{higher}", f"V{lower}") for higher, lower in edges}
    constraints = {
        edge: Constraint(f"C{edge[0]}.{edge[1]}", PREDEFINED["ne"], scope, scope, cost=1)
        for edge, scope in scopes.items()
    }
    name = f"coloring-{agents}-{colors}-{float(degree)}-{seed}{'-connected' * connected}"
    return team_of_edges(name, agents, colors, constraints, ProblemKind.DISWCSP)
