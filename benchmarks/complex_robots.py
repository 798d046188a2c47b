"""A team of complex robots with private problems that are all different: what the solver's part compiles."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.model.problem import Child, Constraint, Domain, Parent, Relation, Robot, Semantics, Team, Variable

ROBOTS = 16
VARIABLES = 5
LEVELS = 6
SEED = 3


def complex_robots() -> Team:
    """16 robots of 5 variables in a chain; 7 private relations each, no two robots with the same."""
    chance = Random(SEED)
    levels = Domain("D", (range(1, LEVELS + 1),))
    names = [[f"V{number}.{place}" for place in range(1, VARIABLES + 1)] for number in range(1, ROBOTS + 1)]
    robots = []
    for number, own in enumerate(names):
        pairs = chance.sample(list(itertools.combinations(own, 2)), 7)
        private = tuple(Constraint("P", _relation(f"R{i}", chance, 0.4), pair, pair) for i, pair in enumerate(pairs))
        parents: tuple[Parent, ...] = ()
        if number:
            shared = (names[number - 1][-1], own[0])
            parents = (Parent(f"Robot{number}", (Constraint("S", _relation("S", chance, 0.3), shared, shared),)),)
        children = (Child(f"Robot{number + 2}", (own[-1],)),) if number + 1 < ROBOTS else ()
        robots.append(
            Robot(
                name=f"Robot{number + 1}",
                variables=tuple(Variable(name, levels) for name in own),
                private=tuple(Constraint(c.name, c.definition, c.scope, c.parameters, model=None) for c in private),
                parents=parents,
                children=children,
            )
        )
    return Team("crew", tuple(robots))


def _relation(name: str, chance: Random, tightness: float) -> Relation:
    pairs = itertools.product(range(1, LEVELS + 1), repeat=2)
    return Relation(name, 2, Semantics.CONFLICTS, tuple(pair for pair in pairs if chance.random() < tightness))
