"""Swarms: drones that choose real positions near their homes, and in a formation with their neighbours.

The costs are squares of distances, as in formations by relative positions (Olfati-Saber, Fax and Murray, Proceedings of
the IEEE 95, 2007) and in experiments with functional DCOPs (Choudhury, Mahmud and Khan, AAAI 2020).
"""

from __future__ import annotations

from robochoc.generators.draws import MAX_NODES, check_bounds, random_integer, seeded
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Type, parse
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.real import RealInterval, RealParameters, grid

PLACES = 2
MOST_SIDE = 1000


def swarm(*, agents: int, side: int = 10, points: int = 9, seed: int = 0) -> Team:
    """Return a swarm of drones in a square.

    `Robot3` owns its position `x3` and `y3` in metres, with a precision of 0.01 m. A tenth of the squared distance from
    its home is a cost. It should be at a random displacement from the drone above it in a binary tree, `Robot1`: the
    squared deviation is a cost. Both must keep 0.5 m apart.

    Args:
        agents: The number of drones.
        side: The side of the square in metres.
        points: The number of points of the grid, for x and y.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds.
    """
    check_bounds({"agents": (agents, 1, MAX_NODES), "side": (side, 2, MOST_SIDE), "points": (points, 2, MOST_SIDE)})
    chance = seeded(seed)
    most = side * 10**PLACES
    domain = Domain("Side", grid(0, most, points), real=RealInterval(0, most, PLACES))
    apart = _predicate("apart", ("X1", "Y1", "X2", "Y2"), "ge(sqr(X1 - X2) + sqr(Y1 - Y2), 0.25)")
    owned, constraints = {}, []
    for drone in range(1, agents + 1):
        owned[f"Robot{drone}"] = [Variable(f"x{drone}", domain), Variable(f"y{drone}", domain)]
        own = (f"x{drone}", f"y{drone}")
        a, b = (_decimal(random_integer(chance, 0, most)) for _ in range(2))
        home = _function(f"home{drone}", ("X", "Y"), f"(sqr(X - {a}) + sqr(Y - {b})) * 0.1")
        constraints.append(Constraint(home.name, home, own, own))
        if drone > 1:
            above = drone // 2
            a, b = (_decimal(random_integer(chance, -most // 4, most // 4)) for _ in range(2))
            keep = _function(f"keep{drone}", apart.parameters, f"sqr(X2 - X1 - {a}) + sqr(Y2 - Y1 - {b})")
            scope = (f"x{above}", f"y{above}", *own)
            constraints += [Constraint(keep.name, keep, scope, scope), Constraint(f"apart{drone}", apart, scope, scope)]
    name = f"swarm-{agents}-{side}" + f"-{points}" * (points != 9) + f"-{seed}"  # noqa: PLR2004 - the default
    return assemble(name, owned, constraints, kind=ProblemKind.DISWCSP, costs=CostUnits(places=VALUE_PLACES))


def _decimal(hundredths: int) -> str:
    return f"{'-' * (hundredths < 0)}{abs(hundredths) // 100}.{abs(hundredths) % 100:02}"


def _function(name: str, parameters: tuple[str, ...], body: str) -> Function:
    source = parse(body, parameters, Type.INTEGER, decimals=True)
    steps = fixed_point(source, parameters, PLACES, Type.INTEGER, VALUE_PLACES)
    return Function(name, parameters, steps, real=RealParameters(parameters, PLACES, source), places=VALUE_PLACES)


def _predicate(name: str, parameters: tuple[str, ...], body: str) -> Predicate:
    source = parse(body, parameters, Type.BOOLEAN, decimals=True)
    steps = fixed_point(source, parameters, PLACES, Type.BOOLEAN, 0)
    return Predicate(name, parameters, steps, real=RealParameters(parameters, PLACES, source))
