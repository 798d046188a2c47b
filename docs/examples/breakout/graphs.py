"""Graph colouring as a team: a robot a node, and robots at the ends of an edge take different colours."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from robochoc.model.expression import Type, parse
from robochoc.model.problem import Child, Constraint, Domain, Parent, Predicate, Robot, Team, Variable

DIFFER = Predicate("differ", ("X", "Y"), parse("ne(X, Y)", ("X", "Y"), Type.BOOLEAN))


def colouring(nodes: int, edges: Sequence[tuple[int, int]], colours: int = 3) -> Team:
    """Robots `R0`, `R1`, ... in this order, each with one variable; `edges` name the smaller node first."""
    return Team("colouring", tuple(_robot(node, edges, colours) for node in range(nodes)))


def soluble(nodes: int, edges: int, chance: Random, colours: int = 3) -> Team:
    """A random graph that can be coloured: edges join only nodes whose hidden colours differ."""
    hidden = [node % colours for node in range(nodes)]
    chance.shuffle(hidden)
    allowed = [(a, b) for b in range(nodes) for a in range(b) if hidden[a] != hidden[b]]
    return colouring(nodes, sorted(chance.sample(allowed, edges)), colours)


def _robot(node: int, edges: Sequence[tuple[int, int]], colours: int) -> Robot:
    return Robot(
        name=f"R{node}",
        variables=(Variable(f"V{node}", Domain("colours", (range(1, colours + 1),))),),
        parents=tuple(Parent(f"R{a}", (_differ(f"V{a}", f"V{b}"),)) for a, b in edges if b == node),
        children=tuple(Child(f"R{b}", (f"V{node}",)) for a, b in edges if a == node),
    )


def _differ(left: str, right: str) -> Constraint:
    return Constraint("differ", DIFFER, (left, right), (left, right))
