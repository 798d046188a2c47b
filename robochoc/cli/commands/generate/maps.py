"""`robochoc generate formation`, `coverage`, `patrol` and `swarm-on-map`: problems on a map with walls."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from robochoc.cli.options.generate import (
    OUTPUT,
    Command,
    Options,
    TeamOnMap,
    number_option,
    seed_option,
    writes_team,
)
from robochoc.cli.options.paths import InputPath
from robochoc.cli.options.sections import COMMON, SectionedCommand
from robochoc.cli.options.value_types import Finite, Number, WholeNumber

if TYPE_CHECKING:
    from robochoc.generators.maps.map_team import MapChoice

MAX_ROBOTS, MAX_CELLS = 100, 1000
"""The limits in `generators/maps/map_team.py`, repeated here because that module is not imported at the start."""
ON_MAP = ("--radius", "--speed", "--within", "--cell", "--cells")
"""The options in the section on robots and cells."""
_MAP_PARAMETERS = ("map", "agents", "at", "radius", "speed", "within", "cell", "cells")


def measure_option(name: str, text: str, default: float | None = None, unit: str = "M") -> Callable[..., Any]:
    """Return an option whose value is a length or another non-negative measure."""
    return click.option(
        name, default=default, show_default=default is not None, type=Finite(0), metavar=unit, help=text
    )


def map_options(command: Command) -> Command:
    """Add the options for maps, which `pop_map_choice` evaluates."""
    for option in reversed(
        (
            click.option(
                "--map",
                "map",
                type=InputPath(),
                required=True,
                metavar="FILE",
                help="Map of ROS's map_server (YAML file that names an image), or an OctoMap (.bt, .ot).",
            ),
            click.option(
                "--agents",
                type=WholeNumber(1, MAX_ROBOTS),
                metavar="N",
                help="Number of robots.  [default: the number of positions in --at]",
            ),
            click.option(
                "--at",
                default="",
                metavar="'X,Y X,Y'",
                help="Positions of the robots, in metres.  [default: random free cells]",
            ),
            measure_option("--radius", "Radius of a robot, which is also its minimum distance from walls.", 0.2),
            measure_option("--speed", "Speed of robots, in metres per second.", 0.5, "M/S"),
            measure_option("--within", "Longest travel time of a robot; farther cells are not values.", unit="SECONDS"),
            measure_option("--cell", "Side of a cell.  [default: as small as --cells allows]"),
            click.option(
                "--cells",
                type=WholeNumber(1, MAX_CELLS),
                metavar="N",
                help="Maximum number of free cells, which are the values.  [default: 100; with --cell: 1000]",
            ),
        )
    ):
        command = option(command)
    return command


def pop_map_choice(options: Options) -> MapChoice:
    """Remove the options for maps from `options`, and return the choice of map, robots and cells."""
    from robochoc.generators.maps.map_team import MapChoice

    given = {key: options.pop(key) for key in _MAP_PARAMETERS}
    return MapChoice(**{**given, "map": str(Path(given["map"]))})


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Shape": ("--shape", "--spacing", "--heading", "--anchor"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: robots choose the slots of a formation.",
)
@map_options
@click.option(
    "--shape",
    default="line",
    show_default=True,
    metavar="SHAPE",
    help="line, column, wedge, circle, grid, or a file with one slot per line: 'AHEAD,LEFT' in metres.",
)
@measure_option("--spacing", "Distance between neighbours in the shape.", 1.0)
@click.option(
    "--heading",
    default=0.0,
    show_default=True,
    type=Number(-360, 360),
    metavar="DEGREES",
    help="Direction of the formation: counterclockwise from x.",
)
@click.option(
    "--anchor", default="", metavar="X,Y", help="Centre of the shape.  [default: the mean position of all robots]"
)
@seed_option
@writes_team("formation-MAP-SHAPE-AGENTS-SEED")
def formation(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `formation`'s own
    """Formations on a map: each robot chooses a slot, and the sum of travel times is minimised.

    A robot's values are the slots that it can reach around walls and inflated obstacles. No two robots choose the same
    slot. Slots in walls are moved to the nearest free cell. Waypoints are in cells; map.json in the folder has the
    walls. On an OctoMap all places have a Z: cells are cubes, and drones fly through free ones.

    \b
    robochoc generate formation --map building.yaml --agents 4 --shape wedge --anchor 3,2
    """  # noqa: D301 - \b keeps click from wrapping the lines
    from robochoc.generators.maps.formation import formation as on_map

    return on_map(pop_map_choice(problem), **problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Coverage": ("--sensing", "--worth"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: robots see as much area as possible.",
)
@map_options
@measure_option("--sensing", "Range of sight, along free lines.", 3.0)
@measure_option("--worth", "Worth of seeing a square (or cubic) metre, as travel time.", 10.0, "SECONDS")
@seed_option
@writes_team("coverage-MAP-AGENTS-SEED")
def coverage(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `coverage`'s own
    """Coverage of a map (Cortes et al. 2004): robots choose cells from which they see much together.

    The cost is the travel time of all robots plus the worth of the area that no robot sees. An area that two robots see
    counts once; an area that three see counts less. A robot's values are the cells that it can reach.

    \b
    robochoc generate coverage --map building.yaml --agents 3 --cells 40 --within 12
    """  # noqa: D301 - \b keeps click from wrapping the lines
    from robochoc.generators.maps.coverage import coverage as on_map

    return on_map(pop_map_choice(problem), **problem)


@click.command(
    cls=SectionedCommand,
    sections={
        COMMON: ("--map", "--agents", "--at"),
        "Points of interest": ("--points", "--visit", "--idle", "--rounds", "--apart"),
        "Robots and cells": ON_MAP,
        "Output": OUTPUT,
    },
    short_help="On a map: robots choose the points of interest to visit next.",
)
@map_options
@number_option("--points", "Number of random points, far from each other.", most=100, default=6)
@click.option("--visit", default="", metavar="'X,Y X,Y'", help="The points, in metres, instead of random ones.")
@number_option("--idle", "Points were last visited 0 to N seconds ago.", least=0, most=1_000_000, default=120)
@number_option("--rounds", "Number of visits that each robot plans.", most=4, default=1)
@measure_option("--apart", "Robots that are closer than this incur a cost.", 2.0)
@seed_option
@writes_team("patrol-MAP-AGENTS-POINTS-ROUNDS-SEED")
def patrol(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `patrol`'s own
    """Patrols on a map (Machado et al. 2002, Portugal and Rocha 2013): each robot visits a point in each round.

    The cost is the travel time of all robots plus the idle time of the points that no robot visits. No point is visited
    twice. With --rounds, a robot has one variable per round; it flies to the point of the first.

    \b
    robochoc generate patrol --map building.yaml --agents 3 --points 8
    robochoc generate patrol --map building.yaml --agents 2 --points 6 --rounds 2
    """  # noqa: D301 - \b keeps click from wrapping the lines
    from robochoc.generators.maps.patrol import patrol as on_map

    return on_map(pop_map_choice(problem), **problem)


@click.command("swarm-on-map", short_help="On a map: drones choose real positions.")
@click.option(
    "--map", "map", type=InputPath(), required=True, metavar="FILE", help="Map of ROS's map_server (YAML file)."
)
@number_option("--agents", "Number of drones.", most=MAX_ROBOTS)
@click.option(
    "--at", default="", metavar="'X,Y X,Y'", help="Starts of the drones, in metres.  [default: random, 1 m apart]"
)
@measure_option("--radius", "Radius of a drone, which is also its minimum distance from walls.", 0.2)
@measure_option("--speed", "Speed of drones, in metres per second.", 0.5, "M/S")
@number_option("--points", "Points of the first grid along the longer side.", least=2, most=1000, default=9)
@number_option("--targets", "Number of targets that drones watch; 0: they form a formation.", least=0, default=0)
@seed_option
@writes_team("swarm-MAP-AGENTS[-POINTS][-targetsTARGETS]-SEED")
def swarm_on_map(**problem: Any) -> TeamOnMap:  # noqa: ANN401 - `swarm_on_map`'s own
    """Drones on a map choose real positions near their homes, in a formation or near targets.

    Positions are outside of walls, and can be reached from the drone's start. Costs are squares of distances, as in
    `robochoc generate swarm`. Robot3 has the variables x3 and y3, in metres with a precision of 0.01.

    \b
    robochoc generate swarm-on-map --map building.yaml --agents 4
    robochoc generate swarm-on-map --map building.yaml --agents 4 --targets 12
    """  # noqa: D301 - \b keeps click from wrapping the lines
    from robochoc.generators.maps.swarm_on_map import swarm_on_map as on_map

    return on_map(str(problem.pop("map")), **problem)
