"""Swarms: drones that choose real positions near their homes, and in a formation with their neighbours.

The costs are squares of distances, as in formations by relative positions (Olfati-Saber, Fax and Murray, Proceedings of
the IEEE 95, 2007) and in experiments with functional DCOPs (Choudhury, Mahmud and Khan, AAAI 2020).
"""

from __future__ import annotations

from collections.abc import Iterable
from decimal import Decimal
from fractions import Fraction
from typing import TYPE_CHECKING

from robochoc.generators.draws import MAX_NODES, check_bounds, limited, random_integer, seeded
from robochoc.model.assembly import Extras, assemble
from robochoc.model.constraint import Constraint, Domain, Function, Predicate, Variable
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Constant, Name, Type, parse
from robochoc.model.expression.fixed_point import VALUE_PLACES, fixed_point
from robochoc.model.problem import ProblemKind, Team, Topic
from robochoc.model.real import RealInterval, RealParameters, grid
from robochoc.model.waypoints import waypoint

if TYPE_CHECKING:
    from robochoc.maps.reachability.free_area import Rectangle

PLACES = 2
MOST_SIDE = 1000
POINTS = 9
HEIGHT = 1
"""The height of all waypoints in metres."""


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
    domain = real_domain("Side", 0, most, points)
    drones = Drones()
    for drone in range(1, agents + 1):
        home = (random_integer(chance, 0, most), random_integer(chance, 0, most))
        drones.add(drone, (domain, domain), home)
        if drone > 1:
            drones.keep(drone, (random_integer(chance, -most // 4, most // 4) for _ in range(2)))
            drones.separate(drone)
    return drones.team(f"swarm-{agents}-{side}" + f"-{points}" * (points != POINTS) + f"-{seed}")


def real_domain(name: str, low: int, high: int, points: int) -> Domain:
    """Return the domain of coordinates from `low` to `high`, in hundredths, with a grid of some points."""
    return Domain(name, grid(low, high, points), real=RealInterval(low, high, PLACES))


class Drones:
    """The variables, waypoints and constraints of drones with real positions. Lengths are in hundredths of a metre."""

    def __init__(self) -> None:
        self._owned: dict[str, list[Variable]] = {}
        self._topics: dict[str, tuple[Topic]] = {}
        self._constraints: list[Constraint] = []
        self._apart = _predicate("apart", ("X1", "Y1", "X2", "Y2"), "ge(sqr(X1 - X2) + sqr(Y1 - Y2), 0.25)")

    def add(
        self, drone: int, domains: tuple[Domain, Domain], home: tuple[int, int], outside: Iterable[Rectangle] = ()
    ) -> None:
        """Add a drone with its home, outside of some rectangles in metres."""
        own = _position_of(drone)
        self._owned[f"Robot{drone}"] = [Variable(name, domain) for name, domain in zip(own, domains, strict=True)]
        self._topics[f"Robot{drone}"] = (
            waypoint(
                f"/robot{drone}/waypoint", Topic.type, (Name(own[0]), Name(own[1]), Constant(HEIGHT)), own, PLACES
            ),
        )
        a, b = map(_decimal, home)
        near = _function(f"home{drone}", ("X", "Y"), f"(sqr(X - {a}) + sqr(Y - {b})) * 0.1")
        self._constraints.append(Constraint(near.name, near, own, own))
        for number, rectangle in enumerate(outside, 1):
            free = _predicate(f"free{drone}.{number}", ("X", "Y"), _is_outside(rectangle))
            self._constraints.append(Constraint(free.name, free, own, own))

    def keep(self, drone: int, displacement: Iterable[int]) -> None:
        """Add the displacement of a drone from the drone above it."""
        a, b = map(_decimal, displacement)
        self._charge(f"keep{drone}", drone, f"sqr(X2 - X1 - {a}) + sqr(Y2 - Y1 - {b})")

    def cover(self, target: int, place: tuple[int, int], drone: int) -> None:
        """Add a target, which costs its squared distance from the nearer of a drone and the drone above it."""
        a, b = map(_decimal, place)
        distances = [f"sqr(X{number} - {a}) + sqr(Y{number} - {b})" for number in (1, 2)]
        self._charge(f"target{target}", drone, f"min({', '.join(distances)})")

    def separate(self, drone: int) -> None:
        """Keep a drone and the drone above it 0.5 m apart."""
        scope = (*_position_of(drone // 2), *_position_of(drone))
        self._constraints.append(Constraint(f"apart{drone}", self._apart, scope, scope))

    def _charge(self, name: str, drone: int, cost: str) -> None:
        scope = (*_position_of(drone // 2), *_position_of(drone))
        function = _function(name, self._apart.parameters, cost)
        self._constraints.append(Constraint(name, function, scope, scope))

    def team(self, name: str) -> Team:
        """Return the team of all drones."""
        costs = CostUnits(places=VALUE_PLACES)
        extras = Extras(topics=self._topics)
        return assemble(
            name, self._owned, limited(self._constraints), kind=ProblemKind.DISWCSP, costs=costs, extras=extras
        )


def _position_of(drone: int) -> tuple[str, str]:
    return f"x{drone}", f"y{drone}"


def _is_outside(rectangle: Rectangle) -> str:
    """Return the condition for a position outside of a rectangle, or on its border."""
    far = []
    for name, (low, high) in zip("XY", rectangle, strict=True):
        middle, half = ((low + high) / 2, (high - low) / 2)
        far.append(f"ge(abs({name} - {_exact(middle)}), {_exact(half)})")
    return f"or({', '.join(far)})"


def _exact(number: Fraction) -> str:
    """Return a number as a decimal; the corners of pixels have few decimal places."""
    digits = Decimal(number.numerator) / number.denominator
    return f"{digits:f}"


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
