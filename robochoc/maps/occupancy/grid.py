"""Occupancy grids: which pixels of a map are free, which are occupied, and which nobody knows.

As ROS 1's map_server and Nav2's write and read them (wiki.ros.org/map_server, "Map format"): a YAML file names an
image, says how large a pixel is, where the lower left corner lies and how far the map is turned around it, and from
which occupancy on a pixel is free or occupied. The occupancy of a pixel is 0 where it is white and 1 where it is black;
with `negate` the other way round. In the mode `raw`, shades from 0 to 100 of 255 are the occupancy in percent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import isqrt
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import InvalidInputError, MistakeError, shortened
from robochoc.formats.yaml_tree import Node, Scalar, read_yaml
from robochoc.maps.map_content import beginning_of, content_of, told
from robochoc.maps.occupancy.images import Image, is_image, read_image
from robochoc.maps.occupancy.pgm import MAX_BYTES
from robochoc.maps.occupancy.turn import UNTURNED, Place, Turn, turn_of

MAX_YAML = 64 * 1024
_SIDE_MAX_M = Fraction(100)
_SIDE_MIN_M = Fraction(1, 1000)
_FAR_M = Fraction(1_000_000)
"""No map lies further away from the origin of its frame."""
_YAW = Fraction(1000)
_MODES = ("trinary", "scale", "raw")
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_EXPECTED = f"a map has the keys {', '.join(_KEYS)}"
_MAGIC_BYTES = 8
_PERCENT = 100
_RAW = 255
"""White in the mode `raw`, whatever it is in the image."""

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A map. Lengths are in metres, in the map's frame.

    Attributes:
        name: The name of its file, without the ending.
        resolution: The side of a pixel.
        origin: The x and the y of the lower left corner of the lower left pixel.
        free: Which pixels are free: rows from the lowest y on, in each the lowest x first.
        occupied: Which are occupied. A pixel that is neither is not known.
        turn: How far rows and columns are turned around the origin; by quarters they have been turned back.
    """

    name: str
    resolution: Fraction
    origin: Place
    free: Flags
    occupied: Flags
    turn: Turn = UNTURNED

    @property
    def corners(self) -> list[Place]:
        """The places of the four corners."""
        rows, columns = (size * self.resolution for size in self.free.shape)
        found = []
        for corner in ((Fraction(0), Fraction(0)), (columns, Fraction(0)), (Fraction(0), rows), (columns, rows)):
            x, y = self.turn.turned(corner)
            found.append((self.origin[0] + x, self.origin[1] + y))
        return found

    def in_pixels(self, place: Place) -> Place:
        """Return where a place lies, in pixels to the right of the lower left corner and above it."""
        x, y = self.turn.back((place[0] - self.origin[0], place[1] - self.origin[1]))
        return x / self.resolution, y / self.resolution

    @cached_property
    def free_before(self) -> Counts:
        """For each corner of a pixel, how many pixels with a smaller x and y are free (a summed-area table)."""
        return before(self.free)


def before(flags: Flags) -> Counts:
    """Return for each corner of a pixel how many flags with a smaller x and y are set (a summed-area table)."""
    counts: Counts = np.cumsum(np.cumsum(np.pad(flags, ((1, 0), (1, 0))), axis=0, dtype=np.int64), axis=1)
    return counts


def read_occupancy_grid(path: Path) -> OccupancyGrid:
    """Return the map that a YAML file describes, with the image that it names.

    Raises:
        InvalidInputError: One of the files cannot be read, is no such file, or is too large.
    """
    with told(path):
        if is_image(beginning_of(path, _MAGIC_BYTES)):
            raise MistakeError("is an image", "name the YAML file of the map, which names its image")
        content = content_of(path, MAX_YAML)
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise MistakeError("is not text in UTF-8", "name the YAML file of the map, not its image") from None
        described = read_yaml(text, _Description, _EXPECTED)
        image = described.image_beside(path)
    with told(image):
        shades = read_image(content_of(image, MAX_BYTES), adds_alpha=described.mode == "trinary")
    free, occupied = described.classified(shades)
    return _upright(OccupancyGrid(path.stem, described.resolution, described.origin, free, occupied), described.yaw)


def _upright(grid: OccupancyGrid, yaw: Fraction) -> OccupancyGrid:
    """Return a map that is turned by a yaw. By quarters its rows are turned: it then has another lower left corner."""
    rows, columns = grid.free.shape
    quarters, turn = turn_of(yaw, Fraction(isqrt(rows * rows + columns * columns) + 1))
    free, occupied, (x, y) = grid.free, grid.occupied, grid.origin
    corner = (Fraction(0), Fraction(0))
    for _ in range(quarters):
        # The first row becomes the last column; where that ends is what the new corner was.
        corner = (-corner[1], corner[0])
        corner = (corner[0] - free.shape[0], corner[1])
        free, occupied = free.T[:, ::-1], occupied.T[:, ::-1]
    right, up = turn.turned((corner[0] * grid.resolution, corner[1] * grid.resolution))
    return replace(grid, origin=(x + right, y + up), free=free, occupied=occupied, turn=turn)


class _Description:
    """The description of a map in its YAML file. Raises `MistakeError` where something is wrong or missing."""

    def __init__(self, root: Node) -> None:
        if not root.is_mapping:
            raise MistakeError("is not a map", f"expected the keys {', '.join(_KEYS)}", root.line)
        self._entries = {key: root.needed(key, "the map", _EXPECTED) for key in _KEYS}
        self._given_mode = root.get("mode")
        self.image = self._image()
        self.resolution = self._number("resolution", _SIDE_MIN_M, _SIDE_MAX_M)
        self.origin, self.yaw = self._pose()
        self.mode = self._mode()
        self._negate = self._negated()
        self._occupied = self._number("occupied_thresh", Fraction(0), Fraction(1))
        self._free = self._number("free_thresh", Fraction(0), self._occupied)

    def classified(self, image: Image) -> tuple[Flags, Flags]:
        """Return which pixels are free, and which are occupied; rows from the lowest y on. An image has it on top."""
        # Thresholds are compared in Python's integers: one that a pixel meets exactly is met on every machine, and no
        # number of decimal places overflows.
        shares, whole = self._shares(image.white)
        free_below, occupied_above = self._free * whole, self._occupied * whole
        free = np.array([share is not None and share < free_below for share in shares])[image.pixels]
        occupied = np.array([share is not None and share > occupied_above for share in shares])[image.pixels]
        if image.opaque is not None and self.mode == "scale":  # what is not opaque is not known
            free, occupied = free & image.opaque, occupied & image.opaque
        return free[::-1], occupied[::-1]

    def _shares(self, white: int) -> tuple[Sequence[int | None], int]:
        """Return the occupancy of each shade, and that of what is occupied for certain; None is not known."""
        if self.mode == "raw":
            percents = ((2 * _RAW * shade + white) // (2 * white) for shade in range(white + 1))
            return [percent if percent <= _PERCENT else None for percent in percents], _PERCENT
        return range(white + 1) if self._negate else range(white, -1, -1), white

    def _image(self) -> str:
        node = self._entries["image"]
        if not isinstance(node.scalar, str) or not node.scalar or "\0" in node.scalar:
            raise MistakeError("has an image that is no path", "name the image beside the YAML file", node.line)
        return node.scalar

    def image_beside(self, path: Path) -> Path:
        """Return where the image is that the file at `path` names."""
        image = path.parent / self.image
        if not image.exists():
            why = f"names the image {shortened(self.image)}, which does not exist"
            raise MistakeError(why, "its path counts from the folder of this file", self._entries["image"].line)
        return image

    def _number(self, key: str, least: Fraction, most: Fraction) -> Fraction:
        return _number(self._entries[key], key, least, most)

    def _pose(self) -> tuple[Place, Fraction]:
        node = self._entries["origin"]
        if node.items is None or len(node.items) != 3:  # noqa: PLR2004 - x, y, yaw
            raise MistakeError("has an origin that is no pose", "expected [x, y, yaw]", node.line)
        x, y, yaw = (
            _number(one, name, -most, most)
            for one, name, most in zip(node.items, ("origin", "origin", "yaw"), (_FAR_M, _FAR_M, _YAW), strict=True)
        )
        return (x, y), yaw

    def _negated(self) -> bool:
        node = self._entries["negate"]
        if node.scalar not in (0, 1):  # `False` and `True`, too
            raise MistakeError("has a negate that is neither 0 nor 1", "write 0: white is free", node.line)
        if node.scalar and self.mode == "raw":
            hint = "ROS 1 and Nav2 read it differently: write negate 0, or another mode"
            raise MistakeError("has negate 1 in the mode raw", hint, node.line)
        return bool(node.scalar)

    def _mode(self) -> str:
        node = self._given_mode
        if node is None:
            return _MODES[0]
        for mode in _MODES:
            if node.scalar == mode:
                return mode
        told = "a list or mapping as its mode" if node.scalar is None else f"the mode {shortened(str(node.scalar))}"
        raise MistakeError(f"has {told}", f"{', '.join(_MODES)} are read", node.line)


def _number(node: Node, key: str, least: Fraction, most: Fraction) -> Fraction:
    value: Scalar = node.scalar
    if isinstance(value, (int, Fraction)) and not isinstance(value, bool) and least <= value <= most:
        return Fraction(value)
    expected = f"expected a number from {float(least):g} to {float(most):g}"
    raise MistakeError(f"has a wrong {key}", expected, node.line)


__all__ = ["Counts", "Flags", "InvalidInputError", "OccupancyGrid", "before", "read_occupancy_grid"]
