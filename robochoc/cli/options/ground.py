"""`--map`: the ground below a flight, as the application draws it."""

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
    help="Where robots stand in the beginning, and which cells are blocked: JSON.",
)


def ground_map(file: Path | None) -> GroundMap | None:
    """Return the map in `file`, if there is one. Raises `Failure`."""
    from robochoc.formats import on_one_line
    from robochoc.formats.ground_map import MAX_BYTES, read_ground_map

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
