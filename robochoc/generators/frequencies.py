"""Frequency assignment: radio links choose frequencies so that links near each other interfere little.

This is the minimum interference problem of the CELAR instances: Cabon, de Givry, Lobjois, Schiex and Warners, "Radio
link frequency assignment", Constraints 4 (1999). A robot is a link, and its variable is the number of its frequency.
Two links within a range must be separated by a number of frequencies, the more the nearer they are; a violated
separation costs its weight, which is drawn from the four weights of CELAR's instance 6. Links are at integer places.
"""

from __future__ import annotations

import itertools

from robochoc.generators.draws import MAX_AGENTS, MAX_VALUES, check_bounds, limited, random_integer, seeded
from robochoc.model.assembly import assemble
from robochoc.model.expression import Apply, Constant, Name
from robochoc.model.problem import Constraint, Domain, Predicate, ProblemKind, Team, Variable

WEIGHTS = (1, 10, 100, 1000)
MAX_SIDE = 10_000


def frequencies(
    *, agents: int, frequencies: int, side: int = 100, distance: int = 40, separation: int = 3, seed: int = 0
) -> Team:
    """Return a random frequency assignment problem.

    `Robot3` owns `V3`.

    Args:
        agents: The number of links.
        frequencies: The number of frequencies.
        side: The largest coordinate: links are in a square, at integer coordinates from 0 to `side`.
        distance: The distance at which links interfere.
        separation: The separation of links at the same place; at `distance` it is 1.
        seed: The same seed gives the same problem on every machine.

    Raises:
        ValueError: A number is out of bounds, or the team would have too many constraints.
    """
    check_bounds({"agents": (agents, 1, MAX_AGENTS), "frequencies": (frequencies, 1, MAX_VALUES)})
    check_bounds({"side": (side, 1, MAX_SIDE), "distance": (distance, 1, 2 * MAX_SIDE)})
    check_bounds({"separation": (separation, 1, MAX_VALUES)})
    chance = seeded(seed)
    places = [(random_integer(chance, 0, side), random_integer(chance, 0, side)) for _ in range(agents)]
    constraints = []
    for one, other in itertools.combinations(range(agents), 2):
        square = sum((a - b) ** 2 for a, b in zip(places[one], places[other], strict=True))
        if square > distance**2:
            continue
        required = 1 + (separation - 1) * (distance**2 - square) // distance**2
        weight = WEIGHTS[random_integer(chance, 0, len(WEIGHTS) - 1)]
        scope = (f"V{one + 1}", f"V{other + 1}")
        constraints.append(Constraint(f"C{one + 1}.{other + 1}", _apart(required), scope, scope, cost=weight))
    values = Domain("Frequencies", (range(1, frequencies + 1),))
    return assemble(
        f"frequencies-{agents}-{frequencies}-{side}-{distance}-{separation}-{seed}",
        {f"Robot{link}": [Variable(f"V{link}", values)] for link in range(1, agents + 1)},
        limited(constraints),
        kind=ProblemKind.DISWCSP,
    )


def _apart(required: int) -> Predicate:
    """Return the predicate that two frequencies are at least `required` apart."""
    apart = Apply("abs", (Apply("sub", (Name("X"), Name("Y"))),))
    return Predicate(f"apart{required}", ("X", "Y"), Apply("ge", (apart, Constant(required))))
