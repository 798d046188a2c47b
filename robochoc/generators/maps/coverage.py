"""Coverage of a map: robots choose their cells so that together they see much of the map and do not travel far.

The aim is the same as in Cortes, Martinez, Karatas and Bullo, "Coverage control for mobile sensing networks", IEEE
Transactions on Robotics and Automation 20 (2004), and for mobile sensing teams (Zivan and others, JAAMAS 29, 2015),
for one step, in which each robot chooses among the cells that it can reach.

A robot sees the free cells within its sensing range to which a straight line is free. The worth of seen area is
measured in travel time. The area seen by the team is a union, and thus a function over all robots. Here it is
approximated by pairs: the sum of the areas seen by robots, minus the areas seen by both robots of a pair. The union is
never smaller (the second Bonferroni inequality, 1936), and equal if no cell is seen by three robots. So constraints are
binary, and the cost is never less than the travel time and the worth of the unseen area.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations
from math import floor

from robochoc.generators.draws import limited, seeded
from robochoc.generators.maps.map_team import (
    MapChoice,
    all_different,
    cost_constraint,
    exact,
    label_of,
    reachability_of,
    variables_of,
    waypoints_of,
)
from robochoc.maps.ground_map import GroundMap
from robochoc.maps.reachability.line_of_sight import lines_of_sight
from robochoc.maps.reachability.reachability import PLACES, Reachability
from robochoc.model.assembly import assemble
from robochoc.model.constraint import Constraint, Relation, Semantics
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team

MAX_TUPLES = 1_000_000
"""The maximum number of pairs of cells with overlapping views, summed over all pairs of robots."""

Seen = Mapping[int, frozenset[int]]
"""The cells seen from each cell."""


def coverage(choice: MapChoice, seed: int = 0, *, sensing: float = 3.0, worth: float = 10.0) -> tuple[Team, GroundMap]:
    """Return the problem of covering a map, and the map in the form for flights.

    `Robot3` owns `V3`, the number of a cell. Costs are in seconds.

    Args:
        choice: The map and the robots.
        seed: The same seed gives the same places of robots on every machine.
        sensing: The sensing range of robots, in metres.
        worth: The worth of a square metre, or of a cubic metre on a three-dimensional map, in seconds of travel time.

    Raises:
        InvalidInputError: A file is not a valid map.
        ValueError: A number is out of bounds, or a robot cannot reach any cell.
    """
    range_m, seconds = exact("sensing", sensing, 0, 1000), exact("worth", worth, 0, 10_000)
    reachability = reachability_of(choice, seeded(seed))
    for number, own in enumerate(reachability.seconds, 1):
        if not own:
            raise ValueError(f"robot {number} cannot reach any cell; use smaller cells, or allow more time")
    seen = lines_of_sight(reachability.cells).visible_cells(range_m)
    a_cell = worth_of_a_cell(reachability, seconds)
    most = [max(len(seen[cell]) for cell in own) for own in reachability.seconds]
    gains = (
        cost_constraint(
            "unseen", f"V{number}", {cell: time + a_cell * (best - len(seen[cell])) for cell, time in own.items()}
        )
        for number, (own, best) in enumerate(zip(reachability.seconds, most, strict=True), 1)
    )
    team = assemble(
        f"coverage-{label_of(choice.map)}-{len(reachability.starts)}-{seed}",
        variables_of(reachability, reachability.seconds),
        limited([*gains, *all_different(reachability.seconds), *_overlaps(reachability.seconds, seen, a_cell)]),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(places=PLACES, constant=a_cell * (len(reachability.cells.free) - sum(most))),
        extras=waypoints_of(reachability),
    )
    return team, reachability.ground()


def worth_of_a_cell(reachability: Reachability, seconds: Fraction) -> int:
    """Return the worth of seeing a cell, in units of costs, from the worth of a square or cubic metre in `seconds`."""
    exactly: Fraction = reachability.cells.side ** len(reachability.cells.first) * seconds * 10**PLACES
    return floor(exactly + Fraction(1, 2))


def _overlaps(values: Sequence[Mapping[int, int]], seen: Seen, a_cell: int) -> Iterator[Constraint]:
    """Yield the costs of cells that are seen by both robots of a pair."""
    bits = {cell: sum(1 << other for other in others) for cell, others in seen.items()}
    left = MAX_TUPLES
    for (one, own), (other, others) in combinations(enumerate(values, 1), 2):
        twice = {
            (cell, second): (bits[cell] & bits[second]).bit_count()
            for cell in own
            for second in others
            if bits[cell] & bits[second]
        }
        left -= len(twice)
        if left < 0:
            raise ValueError(
                f"more than {MAX_TUPLES:,} pairs of cells have overlapping fields of view;"
                " use larger cells, fewer robots, or smaller values of sensing or within"
            )
        if twice and a_cell:
            costs = tuple(a_cell * count for count in twice.values())
            relation = Relation(f"overlap{one}.{other}", 2, Semantics.SOFT, tuple(twice), costs)
            yield Constraint("overlap", relation, (f"V{one}", f"V{other}"), (f"V{one}", f"V{other}"))
