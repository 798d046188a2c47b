"""The map below a mission: places of robots, blocked cells, and walls.

The map is in a separate file, not in the robots' files: `map.json` in the team's folder, or given by `robochoc fly
--map`.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from robochoc.maps.stops import RobotStops
from robochoc.system.decode_errors import describe_decode_error

MAX_BYTES = 8 << 20
MAX_BLOCKED = 10_000
"""The maximum number of blocked cells, each of which is drawn as a block, and avoided by routes as a point."""
ALL_SIDES = 0b111111
"""The value of visible sides for all sides of a cube."""
MAX_PIXELS = 4_000_000
"""The maximum number of pixels, as for images of maps (`occupancy/pgm.py`)."""
MAX_VOXELS = 16_000_000
"""The maximum number of voxels, as for three-dimensional maps (`octomap/voxels.py`)."""
SIDE_MAX = 1_000_000
"""The maximum number of columns and rows, of which only places are stored."""
_BLOCKED_MAX = 1_000
_FAR = 1_000_000

_Metres = Annotated[float, msgspec.Meta(ge=-_FAR, le=_FAR)]
_Coordinate = Annotated[int, msgspec.Meta(ge=1, le=_BLOCKED_MAX)]
_Column = Annotated[int, msgspec.Meta(ge=1, le=SIDE_MAX)]
_First = Annotated[int, msgspec.Meta(ge=-_FAR, le=_FAR)]


class BlockedCell(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A cell that is blocked from epoch `epoch` on."""

    x: _Coordinate
    y: _Coordinate
    epoch: Annotated[int, msgspec.Meta(ge=0)] = 0


class WallVoxels(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The voxels of a three-dimensional map, and the radius and speed of robots for which travel times were computed.

    Voxels are flags in bytes (`occupancy/packed.py`), sorted by z, then y, then x. Lengths are in metres.

    Attributes:
        columns: The number of voxels along x.
        rows: The number of voxels along y.
        levels: The number of voxels along z.
        resolution: The side length of a voxel.
        corner: The x, y and z of the lowest corner of the first voxel.
        radius: The robots' radius: their centres keep this distance from voxels that are not free, and the outside.
        speed: The speed of the travel times, in m/s.
        free: Which voxels are free.
        occupied: Which voxels are occupied. A voxel that is neither free nor occupied is unknown.
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
        starts: The initial levels of robots, by name. All other robots are on the ground.
        blocked: The blocked cells: column, row and level.
        sides: The visible sides of each blocked cell, as a sum: 1 if visible from a lower x, 2 from a higher x, 4 and 8
            for y, 16 and 32 for z. Empty: all sides.
        walls: Walls that drones fly around; None: drones fly straight. A map with walls has a scale.
        heights: The exact z of robots in metres, by name.
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
    """The pixels of a map of a building, and the radius and speed of robots for which travel times were computed.

    Pixels are flags in bytes (`occupancy/packed.py`), sorted by y, then x. Lengths are in metres.

    Attributes:
        columns: The number of pixels in a row.
        rows: The number of rows.
        resolution: The side length of a pixel.
        corner: The x and y of the lower left corner of the lower left pixel.
        radius: The robots' radius: their centres keep this distance from pixels that are not free, and the outside.
        speed: The speed of the travel times, in m/s.
        free: Which pixels are free.
        occupied: Which pixels are occupied. A pixel that is neither free nor occupied is unknown.
        yaw: The counterclockwise angle, in radians, by which the pixels are rotated around `corner`.
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
    """A map. Columns and rows are numbered from 1; with the default of `first`, they are the x and y of topics.

    Attributes:
        columns: The number of columns.
        rows: The number of rows.
        starts: The initial cells (column and row) of robots, by name.
        blocked: The blocked cells.
        first: The x and y of topics in the first column and row.
        scale: The length of a unit of topics, in metres; None: not known.
        volume: The third dimension, if the map has one.
        walls: Walls that drones fly around; None: no walls. A map with walls has a scale.
        places: The exact places of robots in metres, by name.
        stops: The places of robots' tasks, by the robot's name.
    """

    columns: _Column
    rows: _Column
    starts: dict[str, tuple[_Column, _Column]] = {}
    blocked: Annotated[tuple[BlockedCell, ...], msgspec.Meta(max_length=MAX_BLOCKED)] = ()
    first: tuple[_First, _First] = (1, 1)
    scale: Annotated[float, msgspec.Meta(gt=0, le=1_000)] | None = None
    volume: Volume | None = None
    walls: WallPixels | None = None
    places: dict[str, tuple[_Metres, _Metres]] = {}
    stops: dict[str, RobotStops] = {}

    def x_and_y(self, column: int, row: int) -> tuple[int, int]:
        """Return the x and y of topics in a column and a row."""
        return self.first[0] + column - 1, self.first[1] + row - 1


def ground_map_json(ground: GroundMap) -> bytes:
    """Return the content of the JSON file of a map."""
    return msgspec.json.encode(ground) + b"\n"


def read_ground_map(content: bytes) -> GroundMap:
    """Return the map in the content of a JSON file.

    Raises:
        ValueError: The content is not a valid map, or a robot or cell is outside of it.
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
            raise ValueError(f"{what} is at ({x}, {y}), outside the map of {found.columns} x {found.rows} cells")
    if found.volume:
        _check_volume(found, found.volume)
    _check_walls(found)
    return found


def _check_volume(ground: GroundMap, volume: Volume) -> None:
    sides = (ground.columns, ground.rows, volume.levels)
    for cell in volume.blocked:
        if any(at > side for at, side in zip(cell, sides, strict=True)):
            raise ValueError(f"a blocked cell is at {cell}, outside the map of {' x '.join(map(str, sides))} cells")
    if volume.sides and len(volume.sides) != len(volume.blocked):
        raise ValueError(f"it has {len(volume.sides)} sides, but {len(volume.blocked)} blocked cells")
    for name, level in volume.starts.items():
        if level > volume.levels:
            raise ValueError(f"{name} is at level {level}, above the map's {volume.levels}")


def _check_walls(ground: GroundMap) -> None:
    volume = ground.volume
    walls, voxels = ground.walls, volume.walls if volume else None
    if (walls or voxels or ground.places or (volume and volume.heights)) and ground.scale is None:
        raise ValueError("it has walls or places, which are in metres, but no scale")
    if walls and volume:
        raise ValueError("it has both walls in the plane and a volume: remove one")
    if walls:
        _check_flags(walls, walls.columns * walls.rows, MAX_PIXELS, "pixels")
    if voxels:
        _check_flags(voxels, voxels.columns * voxels.rows * voxels.levels, MAX_VOXELS, "voxels")


def _check_flags(walls: WallPixels | WallVoxels, count: int, most: int, what: str) -> None:
    if count > most:
        raise ValueError(f"its walls have {count:,} {what}, more than {most:,}")
    for name, content in (("free", walls.free), ("occupied", walls.occupied)):
        if len(content) != -(-count // 8):
            raise ValueError(f"its walls have {count:,} {what}, but {name} has flags for {8 * len(content):,}")
