"""`robochoc generate` of problems on a map: who goes where, around the walls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generated import (
    OUTPUT,
    Command,
    Options,
    TeamOnMap,
    number,
    seed_option,
    team_written,
)
from robochoc.cli.options.numbers import Number, WholeNumber
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.sections import COMMON, SectionedCommand

if TYPE_CHECKING:
    from robochoc.generators.maps.reach import MapChoice

MAX_ROBOTS, MAX_CELLS = 100, 1000
"""As `generators/maps/reach.py` has them, which is not imported at the start."""
ON_MAP = ("--radius", "--speed", "--within", "--cell", "--cells")
"""The section on robots and cells."""
_OWN = ("map", "agents", "at", "radius", "speed", "within", "cell", "cells")


def metres(name: str, text: str, default: float | None = None, unit: str = "M") -> Callable[..., Any]:
    """Return an option that takes a length, or another measure that is not negative."""
    return click.option(
        name, default=default, show_default=default is not None, type=Number(0), metavar=unit, help=text
    )


def map_options(command: Command) -> Command:
    """Add the options of maps, which `choice_of` takes out again."""
    for option in reversed(
        (
            click.option(
                "--map",
                "map",
                type=InputPath(),
                required=True,
                metavar="FILE",
                help="Map of ROS's map_server (YAML, which names an image), or an OctoMap (.bt, .ot).",
            ),
            click.option(
                "--agents",
                type=WholeNumber(1, MAX_ROBOTS),
                metavar="N",
                help="Number of robots.  [default: as many as --at has]",
            ),
            click.option(
                "--at", default="", metavar="'X,Y X,Y'", help="Where robots are, in metres.  [default: in free cells]"
            ),
            metres("--radius", "Radius of a robot: it fits through doors of twice that, and flights keep it.", 0.2),
            metres("--speed", "Metres a second.", 0.5, "M/S"),
            metres("--within", "Robots get as far as they come in so many seconds.", unit="SECONDS"),
            metres("--cell", "Side of a cell.  [default: as small as --cells allows]"),
            click.option(
                "--cells",
                type=WholeNumber(1, MAX_CELLS),
                metavar="N",
                help="Maximum number of free cells, which are values.  [default: 100; with --cell: 1000]",
            ),
        )
    ):
        command = option(command)
    return command


def choice_of(options: Options) -> MapChoice:
    """Take the options of maps out of `options`, and return what they say."""
    from robochoc.generators.maps.reach import MapChoice

    given = {key: options.pop(key) for key in _OWN}
    return MapChoice(**{**given, "map": str(Path(given["map"]))})


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Shape": ("--shape", "--spacing", "--heading", "--anchor"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: robots take the slots of a formation.",
)
@map_options
@click.option(
    "--shape",
    default="line",
    show_default=True,
    metavar="SHAPE",
    help="line, column, wedge, circle, grid, or a file with 'AHEAD,LEFT' in metres in each line.",
)
@metres("--spacing", "Between neighbours in the shape.", 1.0)
@click.option(
    "--heading",
    default=0.0,
    show_default=True,
    type=Number(-360, 360),
    metavar="DEGREES",
    help="Where the formation looks: counterclockwise from x.",
)
@click.option("--anchor", default="", metavar="X,Y", help="Middle of the shape.  [default: the mean of all robots]")
@seed_option
@team_written("formation-MAP-SHAPE-AGENTS-SEED")
def formation(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `formation`'s own
    """Formations on a map: each robot takes a slot, and the sum of their travel times is minimised.

    A robot's values are the slots that it can get to, around walls and inflated obstacles. No two take the same. Slots
    in walls move to the nearest free cell. Waypoints are in cells; map.json beside the robots has the walls. On an
    OctoMap all places have a Z: cells are cubes, and drones fly through free ones.

    \b
    robochoc generate formation --map docs/examples/building/building.yaml --agents 4 --shape wedge --anchor 3,2
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.generators.maps.formation import formation as on_map

    return on_map(choice_of(problem), **problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Coverage": ("--sensing", "--worth"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: robots see as much as they can.",
)
@map_options
@metres("--sensing", "How far robots see, along free lines.", 3.0)
@metres("--worth", "Travel time that it is worth to see a square metre, or a cubic one.", 10.0, "SECONDS")
@seed_option
@team_written("coverage-MAP-AGENTS-SEED")
def coverage(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `coverage`'s own
    """Coverage of a map (Cortes et al. 2004): robots choose cells from which they see much together.

    The cost is the travel time of all robots and the worth of what they do not see. What two robots both see counts
    once; of what three see, it counts less. A robot's values are the cells that it can get to.

    \b
    robochoc generate coverage --map docs/examples/building/building.yaml --agents 3 --cells 40 --within 12
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.generators.maps.coverage import coverage as on_map

    return on_map(choice_of(problem), **problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Points of interest": ("--points", "--visit", "--idle", "--rounds", "--apart"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: who visits which point of interest next.",
)
@map_options
@number("--points", "Number of points that are drawn, far from each other.", most=100, default=6)
@click.option("--visit", default="", metavar="'X,Y X,Y'", help="The points, in metres, in the place of drawn ones.")
@number("--idle", "Nobody has been at a point for 0 to N seconds.", least=0, most=1_000_000, default=120)
@number("--rounds", "Visits that each robot plans.", most=4, default=1)
@metres("--apart", "Robots that are nearer to each other pay for it.", 2.0)
@seed_option
@team_written("patrol-MAP-AGENTS-POINTS-ROUNDS-SEED")
def patrol(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `patrol`'s own
    """Patrols on a map (Machado et al. 2002, Portugal and Rocha 2013): each robot visits a point in each round.

    The cost is the travel time of all robots, and how long the points that nobody visits have been idle. No point is
    visited twice. With --rounds a robot has a variable for each round; it flies to the first.

    \b
    robochoc generate patrol --map docs/examples/building/building.yaml --agents 3 --points 8
    robochoc generate patrol --map docs/examples/building/building.yaml --agents 2 --points 6 --rounds 2
    """  # noqa: D301 - \\b is how click is told to leave the lines as they are
    from robochoc.generators.maps.patrol import patrol as on_map

    return on_map(choice_of(problem), **problem)
