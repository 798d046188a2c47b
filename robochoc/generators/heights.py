"""Flight heights: drones choose heights that trade energy for safety, the two objectives of the problem.

The energy of a drone is its weight times its height. Its risk is its exposure times the square of the distance to the
maximum height, since obstacles are near the ground. Two drones whose paths cross add a risk if they fly at the same
height, and half of it at neighbouring heights. The crossings are the edges of a random graph. This family is not taken
from a paper.
"""

from __future__ import annotations

from robochoc.generators.coloring import random_graph_of
from robochoc.generators.draws import MAX_AGENTS, MAX_COST, check_bounds, random_integer, seeded
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Team, Variable

MAX_LEVELS = 100
ENERGY, RISK = "energy", "risk"


def heights(
    *,
    agents: int,
    levels: int = 5,
    degree: float = 2.0,
    weight: int = 3,
    exposure: int = 3,
    crossing: int = 6,
    seed: int = 0,
) -> Team:
    """Return a random problem of flight heights, with the objectives `energy` and `risk`.

    `Robot3` owns `V3`.

    Args:
        agents: The number of drones.
        levels: The number of heights, from 1.
        degree: The average number of drones whose paths cross that of a drone.
        weight: The maximum energy of a drone per height; the minimum is 1.
        exposure: The maximum exposure of a drone; the minimum is 1.
        crossing: The maximum risk of two drones at neighbouring heights; the minimum is 1.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds.
    """
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "levels": (levels, 2, MAX_LEVELS)})
    check_bounds({"weight": (weight, 1, MAX_COST), "exposure": (exposure, 1, MAX_COST)})
    check_bounds({"crossing": (crossing, 1, MAX_COST)})
    graph = random_graph_of(agents, degree)
    chance = seeded(seed)
    domain = Domain("Heights", (range(1, levels + 1),))
    below = Apply("sub", (Constant(levels), Name("X")))
    constraints = []
    for drone in range(1, agents + 1):
        own = (f"V{drone}",)
        energy = _times(random_integer(chance, 1, weight), Name("X"))
        risk = _times(random_integer(chance, 1, exposure), Apply("mul", (below, below)))
        constraints.append(_cost(f"E{drone}", ("X",), energy, own, ENERGY))
        constraints.append(_cost(f"R{drone}", ("X",), risk, own, RISK))
    near = Apply("max", (Constant(0), Apply("sub", (Constant(2), Apply("dist", (Name("X"), Name("Y")))))))
    for one, other in graph.draw(chance):
        risk = _times(random_integer(chance, 1, crossing), near)
        constraints.append(_cost(f"C{one}.{other}", ("X", "Y"), risk, (f"V{one}", f"V{other}"), RISK))
    return assemble(
        f"heights-{agents}-{levels}-{graph.label}-{weight}-{exposure}-{crossing}-{seed}",
        {f"Robot{drone}": [Variable(f"V{drone}", domain)] for drone in range(1, agents + 1)},
        constraints,
        kind=ProblemKind.DISWCSP,
    )


def _times(factor: int, expression: Expression) -> Expression:
    return Apply("mul", (Constant(factor), expression))


def _cost(name: str, formals: tuple[str, ...], body: Expression, scope: tuple[str, ...], objective: str) -> Constraint:
    return Constraint(name, Function(name, formals, body), scope, scope, objective=objective)
