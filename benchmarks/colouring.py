"""A random 3-colouring problem: connected, 3-colourable by construction, the same for the same seed."""

from __future__ import annotations

import random

from robochoc.formats import PREDEFINED
from robochoc.model.problem import Child, Constraint, Domain, Parent, Robot, Team, Variable

AGENTS = 20
EDGES = 40
"""Average degree 4."""
SEED = 0

Edge = tuple[int, int]


def edges(seed: int = SEED, agents: int = AGENTS, count: int = EDGES) -> list[Edge]:
    """Pairs (lower, higher) of agents, between colours of a hidden solution; drawn again until connected."""
    chance = random.Random(seed)
    while True:
        hidden = [chance.randrange(3) for _ in range(agents)]
        possible = [(i, j) for j in range(agents) for i in range(j) if hidden[i] != hidden[j]]
        drawn = sorted(chance.sample(possible, count))
        if _connected(drawn, agents):
            return drawn


def _connected(graph: list[Edge], agents: int) -> bool:
    reached, before = {0}, 0
    while len(reached) > before:
        before = len(reached)
        reached.update(agent for edge in graph if reached.intersection(edge) for agent in edge)
    return len(reached) == agents


def colouring(seed: int = SEED, agents: int = AGENTS, count: int = EDGES) -> Team:
    """The problem as a team: a robot an agent, the lower number the higher priority."""
    graph = edges(seed, agents, count)
    return Team(f"colouring-{agents}-{seed}", tuple(_robot(agent, graph) for agent in range(agents)))


def _robot(agent: int, graph: list[Edge]) -> Robot:
    colours = Domain("Colours", (range(3),))
    return Robot(
        name=f"Robot{agent}",
        variables=(Variable(f"V{agent}", colours),),
        parents=tuple(Parent(f"Robot{i}", (_differ(i, j),)) for i, j in graph if j == agent),
        children=tuple(Child(f"Robot{j}", (f"V{i}",)) for i, j in graph if i == agent),
    )


def _differ(i: int, j: int) -> Constraint:
    names = (f"V{i}", f"V{j}")
    return Constraint(f"C{i}.{j}", PREDEFINED["neq"], names, names)
