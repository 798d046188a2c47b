"""The ground below a mission, as a map: where robots stand in the beginning, and which cells are blocked.

Files of teams do not have it: whoever draws a map hands it over beside the result (`robochoc fly --map`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

MAX_BYTES = 4 << 20
MAX_BLOCKED = 10_000
"""Blocked cells of a map: each is a block to draw, and a point that routes avoid."""
_SIDE_MAX = 1_000

_Coordinate = Annotated[int, msgspec.Meta(ge=1, le=_SIDE_MAX)]


class BlockedCell(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cell that is blocked from an epoch on."""

    x: _Coordinate
    y: _Coordinate
    epoch: Annotated[int, msgspec.Meta(ge=0)] = 0


class GroundMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A map. Columns and rows are numbered from 1: they are the x and y of the robots' topics.

    Attributes:
        columns: The number of columns.
        rows: The number of rows.
        starts: Where robots stand in the beginning, by their names: column and row.
        blocked: The cells that are blocked.
    """

    columns: _Coordinate
    rows: _Coordinate
    starts: dict[str, tuple[_Coordinate, _Coordinate]] = {}
    blocked: Annotated[tuple[BlockedCell, ...], msgspec.Meta(max_length=MAX_BLOCKED)] = ()


def read_ground_map(content: bytes) -> GroundMap:
    """Return the map in the content of a JSON file.

    Raises:
        ValueError: It is not a map, or something lies beside it.
    """
    if len(content) > MAX_BYTES:
        raise ValueError(f"it has more than {MAX_BYTES:,} bytes")
    try:
        found = msgspec.json.decode(content, type=GroundMap)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(str(error)) from None
    for what, (x, y) in (*found.starts.items(), *(("a blocked cell", (cell.x, cell.y)) for cell in found.blocked)):
        if x > found.columns or y > found.rows:
            raise ValueError(f"{what} is at ({x}, {y}), beside the map of {found.columns} x {found.rows} cells")
    return found
