"""Graph colouring: hard, soft (with as few neighbours of the same colour as possible), or weighted.

* `soft` is the usual first benchmark for optimisation protocols (Modi et al., "Adopt", AIJ 161, 2005; Zhang et al.,
  "Distributed stochastic search and distributed breakout", AIJ 161, 2005): each violated constraint costs 1.
* `weighted`: equal colours at the ends of an edge cost the weight of the edge, an integer or decimal drawn from 1 unit
  to a maximum (Koljonen, Alava, Peltomaki and Tirkkonen, "Distributed generalized graph coloring", SASO 2010).
* `hard` is a DisCSP: neighbours must have different colours.

The graph is drawn uniformly among all graphs with a given mean degree, or is one of those in `generators/graphs.py`.
"""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum

from robochoc.formats import PREDEFINED
from robochoc.generators.draws import (
    MAX_COST,
    MAX_NODES,
    MAX_VALUES,
    check_bounds,
    check_places,
    random_integer,
    seeded,
)
from robochoc.generators.graphs import Graph, uniform
from robochoc.generators.random_csp import places_label, team_of_edges
from robochoc.model.cost_units import PLAIN_COSTS, CostUnits
from robochoc.model.problem import INFINITE, Constraint, ProblemKind, Team
from robochoc.system.suggestions import member


class Conflicts(StrEnum):
    """The cost of neighbours with the same colour."""

    SOFT = "soft"
    WEIGHTED = "weighted"
    HARD = "hard"


def coloring(
    agents: int,
    colors: int,
    degree: float,
    seed: int = 0,
    *,
    connected: bool = False,
    conflicts: Conflicts | str = Conflicts.SOFT,
    max_cost: int = 10,
    places: int = 0,
) -> Team:
    """Return a random graph colouring problem, with `agents` robots and `degree` neighbours on average.

    `Robot3` owns `V3`. `conflicts` selects the cost of two neighbours with the same colour.

    Args:
        agents: The number of robots.
        colors: The number of colours.
        degree: The average number of neighbours.
        seed: The same seed gives the same problem on every machine.
        connected: True if graphs are drawn until one is connected.
        conflicts: The cost of neighbours with the same colour: 1, a random weight, or infinite.
        max_cost: The maximum weight.
        places: The decimal places of weights.

    Raises:
        ValueError: There is no such graph. The message names the number to change.
    """
    check_bounds({"agents": (agents, 1, MAX_NODES), "colors": (colors, 1, MAX_VALUES)})
    graph = random_graph_of(agents, degree, connected=connected)
    return coloring_of(graph, colors, seed, conflicts=conflicts, max_cost=max_cost, places=places)


def random_graph_of(agents: int, degree: float, *, connected: bool = False) -> Graph:
    """Return a uniformly random graph with `degree` neighbours on average.

    Raises:
        ValueError: There is no such graph.
    """
    check_bounds({"agents": (agents, 1, MAX_NODES)})
    if not 0 <= degree <= agents - 1:
        raise ValueError(f"degree is {degree}; among {agents} robots it must be from 0 to {agents - 1}")
    return uniform(agents, round(agents * degree / 2), str(float(degree)), connected=connected)


def coloring_of(
    graph: Graph,
    colors: int,
    seed: int = 0,
    *,
    conflicts: Conflicts | str = Conflicts.SOFT,
    max_cost: int = 10,
    places: int = 0,
) -> Team:
    """Return the problem of colouring `graph`; for the parameters see `coloring`.

    Raises:
        ValueError: A number is out of bounds.
    """
    conflicts = member(Conflicts, "conflicts", conflicts)
    check_bounds({"colors": (colors, 1, MAX_VALUES), "max-cost": (max_cost, 1, MAX_COST)})
    check_places(places)
    chance = seeded(seed)
    edges = graph.draw(chance)
    soft = {
        (higher, lower): Constraint(f"C{higher}.{lower}", PREDEFINED["ne"], scope, scope, cost=1)
        for higher, lower in edges
        for scope in ((f"V{higher}", f"V{lower}"),)
    }
    label, units = "", PLAIN_COSTS
    match conflicts:
        case Conflicts.SOFT:
            constraints = soft
        case Conflicts.HARD:
            label = "-hard"
            constraints = {edge: replace(one, cost=INFINITE) for edge, one in soft.items()}
        case Conflicts.WEIGHTED:
            units = CostUnits(places=places)
            label = f"-weighted{max_cost}{places_label(units)}"
            most = max_cost * 10**places
            constraints = {edge: replace(one, cost=random_integer(chance, 1, most)) for edge, one in soft.items()}
    kind = ProblemKind.DISCSP if conflicts == Conflicts.HARD else ProblemKind.DISWCSP
    name = f"coloring-{graph.agents}-{colors}-{graph.label}{label}-{seed}{graph.suffix}"
    return team_of_edges(name, graph.agents, colors, constraints, kind, units)
