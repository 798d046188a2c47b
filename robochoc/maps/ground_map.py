"""The ground below a mission, as a map: where robots stand, which cells are blocked, and where walls are.

Robots' files do not have it. It is a file beside them, `map.json` in the team's folder, or handed over (`robochoc fly
--map`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from robochoc.system.decode_errors import describe_decode_error

MAX_BYTES = 8 << 20
MAX_BLOCKED = 10_000
"""Blocked cells of a map: each is a block to draw, and a point that routes avoid."""
ALL_SIDES = 0b111111
"""The sides of a cube, from which it is seen."""
MAX_PIXELS = 4_000_000
"""As many as an image of a map may have (`occupancy/pgm.py`)."""
MAX_VOXELS = 16_000_000
"""As many as a three-dimensional map may have (`octomap/voxels.py`)."""
_SIDE_MAX = 1_000
_FAR = 1_000_000

_Metres = Annotated[float, msgspec.Meta(ge=-_FAR, le=_FAR)]
_Coordinate = Annotated[int, msgspec.Meta(ge=1, le=_SIDE_MAX)]
_First = Annotated[int, msgspec.Meta(ge=-_FAR, le=_FAR)]


class BlockedCell(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cell that is blocked from an epoch on."""

    x: _Coordinate
    y: _Coordinate
    epoch: Annotated[int, msgspec.Meta(ge=0)] = 0


class WallVoxels(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The voxels of a three-dimensional map, and the robots for which ways between them were found.

    Voxels are flags in bytes (`occupancy/packed.py`): by z, then y, then x, each from the lowest on. Lengths are in
    metres.

    Attributes:
        columns: The number of voxels along x.
        rows: The same along y.
        levels: The same along z.
        resolution: The side of a voxel.
        corner: The x, y and z of the lowest corner of the first voxel.
        radius: The robots' radius: their centres are no nearer to voxels that are not free, nor to the outside.
        speed: The speed, in m/s, of which travel times were told.
        free: Which voxels are free.
        occupied: Which are occupied. A voxel that is neither is not known.
    """

    columns: Annotated[int, msgspec.Meta(ge=1, le=MAX_VOXELS)]
    rows: Annotated[int, msgspec.Meta(ge=1, le=MAX_VOXELS)]
    levels: Annotated[int, msgspec.Meta(ge=1, le=MAX_VOXELS)]
    resolution: Annotated[float, msgspec.Meta(gt=0, le=1_000)]
    corner: tuple[_Metres, _Metres, _Metres]
    radius: Annotated[float, msgspec.Meta(ge=0, le=1_000)]
    speed: Annotated[float, msgspec.Meta(gt=0, le=1_000)]
    free: bytes
    occupied: bytes


class Volume(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The third dimension of a map. Levels are numbered from 1, the lowest first.

    Attributes:
        levels: The number of levels.
        first: The z of topics in the first level.
        starts: The levels at which robots are in the beginning, by their names. All others stand on the ground.
        blocked: The cells that are blocked: column, row and level.
        sides: From which sides each blocked cell is seen: 1 from a lower x, 2 from a higher one, 4 and 8 for y, 16 and
            32 for z, added up. Empty: from all.
        walls: Walls that drones fly around; None: they fly straight. A map with walls has a scale.
        heights: The z at which robots are exactly, in metres, by their names.
    """

    levels: _Coordinate
    first: _First = 1
    starts: dict[str, _Coordinate] = {}
    blocked: Annotated[
        tuple[tuple[_Coordinate, _Coordinate, _Coordinate], ...], msgspec.Meta(max_length=MAX_BLOCKED)
    ] = ()
    sides: Annotated[
        tuple[Annotated[int, msgspec.Meta(ge=0, le=ALL_SIDES)], ...], msgspec.Meta(max_length=MAX_BLOCKED)
    ] = ()
    walls: WallVoxels | None = None
    heights: dict[str, _Metres] = {}

    def z(self, level: int) -> int:
        """Return the z of topics at a level."""
        return self.first + level - 1


class WallPixels(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The pixels of a map of a building, and the robots for which ways around its walls were found.

    Pixels are flags in bytes (`occupancy/packed.py`): rows from the lowest y on. Lengths are in metres.

    Attributes:
        columns: The number of pixels in a row.
        rows: The number of rows.
        resolution: The side of a pixel.
        corner: The x and the y of the lower left corner of the lower left pixel.
        radius: The robots' radius: their centres are no nearer to pixels that are not free, nor to the outside.
        speed: The speed, in m/s, of which travel times were told.
        free: Which pixels are free.
        occupied: Which are occupied. A pixel that is neither is not known.
        yaw: The counterclockwise angle, in radians, by which the pixels are turned around `corner`.
    """

    columns: Annotated[int, msgspec.Meta(ge=1, le=MAX_PIXELS)]
    rows: Annotated[int, msgspec.Meta(ge=1, le=MAX_PIXELS)]
    resolution: Annotated[float, msgspec.Meta(gt=0, le=100)]
    corner: tuple[_Metres, _Metres]
    radius: Annotated[float, msgspec.Meta(ge=0, le=1_000)]
    speed: Annotated[float, msgspec.Meta(gt=0, le=1_000)]
    free: bytes
    occupied: bytes
    yaw: Annotated[float, msgspec.Meta(ge=-7, le=7)] = 0.0


class GroundMap(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A map. Columns and rows are numbered from 1; unless `first` says otherwise, they are the x and y of topics.

    Attributes:
        columns: The number of columns.
        rows: The number of rows.
        starts: Where robots stand in the beginning, by their names: column and row.
        blocked: The cells that are blocked.
        first: The x and y of topics in the first column and row.
        scale: Metres a unit of topics; None: the map does not say.
        volume: The third dimension, if the map has one.
        walls: Walls that drones fly around; None: there are none. A map with walls has a scale.
        places: Where robots stand exactly, in metres, by their names.
    """

    columns: _Coordinate
    rows: _Coordinate
    starts: dict[str, tuple[_Coordinate, _Coordinate]] = {}
    blocked: Annotated[tuple[BlockedCell, ...], msgspec.Meta(max_length=MAX_BLOCKED)] = ()
    first: tuple[_First, _First] = (1, 1)
    scale: Annotated[float, msgspec.Meta(gt=0, le=_SIDE_MAX)] | None = None
    volume: Volume | None = None
    walls: WallPixels | None = None
    places: dict[str, tuple[_Metres, _Metres]] = {}

    def x_and_y(self, column: int, row: int) -> tuple[int, int]:
        """Return the x and y of topics in a column and a row."""
        return self.first[0] + column - 1, self.first[1] + row - 1


def ground_map_json(ground: GroundMap) -> bytes:
    """Return the content of the JSON file of a map."""
    return msgspec.json.encode(ground) + b"\n"


def read_ground_map(content: bytes) -> GroundMap:
    """Return the map in the content of a JSON file.

    Raises:
        ValueError: It is not a map, or something lies beside it.
    """
    if len(content) > MAX_BYTES:
        raise ValueError(f"it has more than {MAX_BYTES:,} bytes")
    try:
        found = msgspec.json.decode(content, type=GroundMap)
    except UnicodeDecodeError:
        raise ValueError("it is not UTF-8") from None
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except msgspec.DecodeError as error:
        raise ValueError(describe_decode_error(error, GroundMap)) from None
    for what, (x, y) in (*found.starts.items(), *(("a blocked cell", (cell.x, cell.y)) for cell in found.blocked)):
        if x > found.columns or y > found.rows:
            raise ValueError(f"{what} is at ({x}, {y}), beside the map of {found.columns} x {found.rows} cells")
    if found.volume:
        _check_volume(found, found.volume)
    _check_walls(found)
    return found


def _check_volume(ground: GroundMap, volume: Volume) -> None:
    sides = (ground.columns, ground.rows, volume.levels)
    for cell in volume.blocked:
        if any(at > side for at, side in zip(cell, sides, strict=True)):
            raise ValueError(f"a blocked cell is at {cell}, beside the map of {' x '.join(map(str, sides))} cells")
    if volume.sides and len(volume.sides) != len(volume.blocked):
        raise ValueError(f"it has sides of {len(volume.sides)} blocked cells, and {len(volume.blocked)} of these")
    for name, level in volume.starts.items():
        if level > volume.levels:
            raise ValueError(f"{name} is at level {level}, above the map's {volume.levels}")


def _check_walls(ground: GroundMap) -> None:
    volume = ground.volume
    walls, voxels = ground.walls, volume.walls if volume else None
    if (walls or voxels or ground.places or (volume and volume.heights)) and ground.scale is None:
        raise ValueError("it has walls or places, which are in metres, and no scale")
    if walls and volume:
        raise ValueError("it has walls in the plane, and a volume")
    if walls:
        _check_flags(walls, walls.columns * walls.rows, MAX_PIXELS, "pixels")
    if voxels:
        _check_flags(voxels, voxels.columns * voxels.rows * voxels.levels, MAX_VOXELS, "voxels")


def _check_flags(walls: WallPixels | WallVoxels, count: int, most: int, what: str) -> None:
    if count > most:
        raise ValueError(f"its walls have {count:,} {what}, more than {most:,}")
    for name, content in (("free", walls.free), ("occupied", walls.occupied)):
        if len(content) != -(-count // 8):
            raise ValueError(f"its walls have {count:,} {what}, and {name} has flags for {8 * len(content):,}")
