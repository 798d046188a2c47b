"""`--map`: the ground below a flight, as the application draws it, or as it lies in the team's folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from robochoc.cli.options.paths import InputPath
from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from robochoc.formats.ground_map import GroundMap

map_option = click.option(
    "--map",
    "ground",
    type=InputPath(),
    metavar="FILE",
    help="Where robots stand, walls and blocked cells: JSON.  [default: the team's map.json]",
)


def ground_map(file: Path | None, folder: Path | None) -> GroundMap | None:
    """Return the map in `file`, or else in the `folder` of the team; None if there is none. Raises `Failure`."""
    from robochoc.formats import on_one_line
    from robochoc.formats.folder import GROUND_FILE
    from robochoc.formats.ground_map import MAX_BYTES, read_ground_map

    if file is None and folder and (folder / GROUND_FILE).is_file():
        file = folder / GROUND_FILE
    if file is None:
        return None
    try:
        with file.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
        return read_ground_map(content)
    except OSError as error:
        raise Failure(INVALID, on_one_line(f"{file}: {error.strerror or error}")) from error
    except ValueError as wrong:
        raise Failure(INVALID, on_one_line(f"{file}: {wrong}")) from wrong


def map_beside(folder: Path) -> GroundMap | None:
    """Return the map in the `folder` of a team; None if there is none that can be read.

    It is for places that are told beside values: a run that needs no map does not fail for one.
    """
    try:
        return ground_map(None, folder)
    except Failure:
        return None
