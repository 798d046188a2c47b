"""Formations on a map: robots are assigned to the slots of a shape, with the minimum sum of travel times.

The shapes are those of Balch and Arkin, "Behavior-based formation control for multirobot teams", IEEE Transactions on
Robotics and Automation 14 (1998), line, column and wedge, and also a circle, a square grid, or offsets from a file. The
slots are assigned to robots (ST-SR-IA in Gerkey and Mataric, IJRR 23, 2004): no two robots have the same slot, and the
sum of their travel times is minimised. All slots have the same worth, and a robot chooses among the slots that it can
reach.

A slot that is in a wall or unreachable is moved to the nearest cell that a robot can reach and that has no slot yet.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from enum import StrEnum
from fractions import Fraction
from math import ceil, cos, pi, radians, sin, sqrt
from pathlib import Path

from robochoc.formats.diagnostics import invalid_input, shortened
from robochoc.generators.draws import check_bounds, limited, seeded
from robochoc.generators.maps.map_team import (
    MAX_ROBOTS,
    MapChoice,
    all_different,
    check_dimensions,
    cost_constraint,
    label_of,
    places_in,
    reachability_of,
    variables_of,
    waypoints_of,
)
from robochoc.maps.ground_map import GroundMap
from robochoc.maps.reachability.cells import Place
from robochoc.maps.reachability.reachability import PLACES, Reachability, off_map
from robochoc.model.assembly import assemble
from robochoc.model.cost_units import CostUnits
from robochoc.model.problem import ProblemKind, Team

MAX_SPACING = 1000.0
MAX_BYTES = 64 * 1024
MAX_SLOTS = MAX_ROBOTS
_MM = 1000
"""Offsets are rounded to millimetres, since the last digits of sines differ between machines."""
_OFFSET = re.compile(r"([+-]?\d{1,6}(?:\.\d{1,6})?)[,\s]\s*([+-]?\d{1,6}(?:\.\d{1,6})?)")

Offset = tuple[float, float]
"""The distances ahead of the anchor and to its left, in metres."""


class FormationShape(StrEnum):
    """The shapes of formations."""

    LINE = "line"
    COLUMN = "column"
    WEDGE = "wedge"
    CIRCLE = "circle"
    GRID = "grid"


SHAPES = tuple(map(str, FormationShape))


def formation(
    choice: MapChoice,
    seed: int = 0,
    *,
    shape: str = FormationShape.LINE,
    spacing: float = 1.0,
    heading: float = 0.0,
    anchor: str = "",
) -> tuple[Team, GroundMap]:
    """Return the problem of assigning the slots of a formation, and the map in the form for flights.

    `Robot3` owns `V3`, the number of a cell. Costs are in seconds.

    Args:
        choice: The map and the robots.
        seed: The same seed gives the same places of robots on every machine.
        shape: One of `SHAPES`, or the path of a file with offsets in metres, `ahead,left` in each line.
        spacing: The distance between neighbours in the shape, in metres.
        heading: The direction of the formation, in degrees counterclockwise from the x axis.
        anchor: The centre of the shape, `X,Y` or `X,Y,Z`; the shape is level. Empty: the mean place of all robots.

    Raises:
        InvalidInputError: A file is not a valid map, or not a valid list of offsets.
        ValueError: A number is out of bounds, or a robot cannot reach any slot.
    """
    check_bounds({"spacing": (spacing, 0.001, MAX_SPACING), "heading": (heading, -360, 360)})
    middle = places_in(anchor, "anchor")
    if len(middle) > 1:
        raise ValueError(f"anchor has {len(middle)} places; give one place")
    reachability = reachability_of(choice, seeded(seed))
    check_dimensions(middle, reachability.cells, "anchor")
    if middle and reachability.cells.pixel(middle[0]) is None:
        raise ValueError(off_map(f"the anchor {anchor}", reachability.cells))
    agents = len(reachability.starts)
    offsets = _offsets(shape, agents, spacing)
    slots = slots_of(reachability, offsets, middle[0] if middle else _mean(reachability.starts), heading)
    values = [sorted(set(slots) & own.keys()) for own in reachability.seconds]
    for number, own in enumerate(values, 1):
        if not own:
            raise ValueError(f"robot {number} cannot reach any slot; move the anchor, or allow more time")
    travel = [
        cost_constraint("travel", f"V{number}", {cell: seconds[cell] for cell in own})
        for number, (own, seconds) in enumerate(zip(values, reachability.seconds, strict=True), 1)
    ]
    label = shape if shape in SHAPES else label_of(shape)
    team = assemble(
        f"formation-{label_of(choice.map)}-{label}-{agents}-{seed}",
        variables_of(reachability, values),
        limited([*travel, *all_different(values)]),
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(places=PLACES),
        extras=waypoints_of(reachability),
    )
    return team, reachability.ground()


def slots_of(reachability: Reachability, offsets: Sequence[Offset], anchor: Place, heading: float) -> list[int]:
    """Return the cell for each slot: the nearest cell that a robot can reach and that has no slot yet.

    Of equally near cells, the cell with the lowest number is used.

    Raises:
        ValueError: There are fewer reachable cells than slots.
    """
    left = set(reachability.reached)
    if len(left) < len(offsets):
        raise ValueError(f"robots can reach {len(left)} cells, fewer than {len(offsets)} slots; use smaller cells")
    slots = []
    for x, y in _turned(offsets, heading):
        slots.append(reachability.nearest((anchor[0] + x, anchor[1] + y, *anchor[2:]), left))
        left.remove(slots[-1])
    return slots


def _turned(offsets: Sequence[Offset], heading: float) -> Iterator[tuple[Fraction, Fraction]]:
    """Yield the offsets in the map's frame, in whole millimetres."""
    turn = radians(heading)
    for ahead, aside in offsets:
        x, y = ahead * cos(turn) - aside * sin(turn), ahead * sin(turn) + aside * cos(turn)
        yield Fraction(round(x * _MM), _MM), Fraction(round(y * _MM), _MM)


def _offsets(shape: str, agents: int, spacing: float) -> list[Offset]:
    """Return the slots of a shape around its anchor, one per robot; a file may have more slots."""
    numbers = range(agents)
    middle = (agents - 1) / 2
    match shape:
        case FormationShape.LINE:
            return [(0.0, (number - middle) * spacing) for number in numbers]
        case FormationShape.COLUMN:
            return [((middle - number) * spacing, 0.0) for number in numbers]
        case FormationShape.WEDGE:  # the first slot at the tip, the others behind it, alternately left and right
            ranks = [(number + 1) // 2 for number in numbers]
            return [(-rank * spacing, rank * spacing * (1 - 2 * (number % 2))) for number, rank in enumerate(ranks)]
        case FormationShape.CIRCLE:
            radius = spacing / (2 * sin(pi / agents)) if agents > 1 else 0.0
            angles = [2 * pi * number / agents for number in numbers]
            return [(radius * cos(angle), radius * sin(angle)) for angle in angles]
        case FormationShape.GRID:
            side = ceil(sqrt(agents))
            corner = (side - 1) / 2
            return [((corner - number // side) * spacing, (number % side - corner) * spacing) for number in numbers]
        case _:
            return _read_offsets(shape, agents)


def _read_offsets(name: str, agents: int) -> list[Offset]:
    path = Path(name)
    if not path.is_file():
        raise ValueError(f"shape {name[:50]!r} is not one of {', '.join(SHAPES)}, nor a file")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        reason = error.strerror or error
        raise invalid_input(path, f"cannot be read: {reason}", "check the path and its permissions") from None
    if len(content) > MAX_BYTES:
        raise invalid_input(path, "is too large", f"use at most {MAX_BYTES:,} bytes")
    found = []
    for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), 1):
        words = line.partition("#")[0].strip()
        matched = _OFFSET.fullmatch(words)
        if matched:
            found.append((float(matched[1]), float(matched[2])))
        elif words:
            message = f"invalid offset '{shortened(words)}'"
            raise invalid_input(path, message, "write metres ahead and to the left: 1.5,-2", number)
    if not agents <= len(found) <= MAX_SLOTS:
        hint = f"expected from {agents}, one per robot, to {MAX_SLOTS}"
        raise invalid_input(path, f"has {len(found)} slots", hint)
    return found


def _mean(places: Sequence[Place]) -> Place:
    return tuple(sum(parts) / Fraction(len(places)) for parts in zip(*places, strict=True))
