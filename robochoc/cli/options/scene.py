"""The options `--html` and `--serve`, which show the 3D scene, and `--map`, the map of the ground below it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import click

from robochoc.cli.options.paths import InputPath, OutputFile
from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.formats.problems import ReadProblem
    from robochoc.maps.ground_map import GroundMap

Command = TypeVar("Command", bound=Callable[..., object])


def html_option(*short: str) -> Callable[[Command], Command]:
    """Return the option `--html FILE` with further spellings."""
    return click.option(
        "--html",
        *short,
        "html",
        type=OutputFile(),
        metavar="FILE",
        help="Write the 3D scene: one HTML file, for a browser.",
    )


serve_option = click.option("--serve", is_flag=True, help="Show the 3D scene on this machine until Ctrl-C.")
map_option = click.option(
    "--map",
    "ground",
    type=InputPath(),
    metavar="FILE",
    help="JSON map: positions of robots, walls, blocked cells.  [default: the team's map.json]",
)


def ground_map(file: Path | None, folder: Path | None) -> GroundMap | None:
    """Return the map in `file`, or in the team's `folder` if no file is given, or None. Raises `Failure`."""
    from robochoc.formats import on_one_line
    from robochoc.formats.team_reader import GROUND_FILE

    if file is None and folder and (folder / GROUND_FILE).is_file():
        file = folder / GROUND_FILE
    if file is None:
        return None
    from robochoc.maps.ground_map import MAX_BYTES, read_ground_map

    try:
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        return read_ground_map(content)
    except OSError as error:
        raise Failure(INVALID, on_one_line(f"{file}: {error.strerror or error}")) from error
    except ValueError as error:
        raise Failure(INVALID, on_one_line(f"{file}: {error}")) from error


def problem_map(problem: ReadProblem, folder: Path) -> GroundMap | None:
    """Return the map of a problem in another tool's file, or in a team's `folder`, or None. Raises `Failure`."""
    from robochoc.formats.team_reader import GROUND_FILE

    if problem.foreign and (content := problem.files.get(GROUND_FILE)):
        from robochoc.maps.ground_map import read_ground_map

        return read_ground_map(content)
    return ground_map(None, folder)


def readable_map(problem: ReadProblem, folder: Path) -> GroundMap | None:
    """Return the map of a problem, or None if it is missing or invalid.

    The map only adds positions to printed values, so an invalid map must not end a run that does not need it.
    """
    try:
        return problem_map(problem, folder)
    except Failure:
        return None
