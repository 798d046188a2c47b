"""Occupancy grids: the free, occupied and unknown pixels of a map.

The format is that of map_server in ROS 1 and Nav2 (wiki.ros.org/map_server, "Map format"). A YAML file has the name of
an image, the size of a pixel, the place of the lower left corner, the yaw of the map around this corner, and the
thresholds for free and occupied. The occupancy of a white pixel is 0, and of a black pixel 1; with `negate` the
reverse. In the mode `raw`, shades from 0 to 100 (of 255) are the occupancy in percent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from functools import cached_property
from math import isqrt
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import InvalidInputError, MistakeError, shortened
from robochoc.formats.yaml_tree import Node, Scalar, read_yaml
from robochoc.maps.file_content import as_input_errors, read_beginning, read_content
from robochoc.maps.occupancy.images import Image, is_image, read_image
from robochoc.maps.occupancy.pgm import MAX_BYTES
from robochoc.maps.occupancy.rotation import NO_ROTATION, Place, Rotation, split_yaw
from robochoc.system.lazy_dataclass import dataclass

MAX_YAML = 64 * 1024
_SIDE_MAX_M = Fraction(100)
_SIDE_MIN_M = Fraction(1, 1000)
_FAR_M = Fraction(1_000_000)
"""The largest distance of a map from the origin of its frame along an axis, in metres."""
_YAW = Fraction(1000)
_MODES = ("trinary", "scale", "raw")
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
_EXPECTED = f"a map has the keys {', '.join(_KEYS)}"
_MAGIC_BYTES = 8
_PERCENT = 100
_RAW = 255
"""White in the mode `raw`, for any value of white in the image."""

Flags = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class OccupancyGrid:
    """A map. Lengths are in metres, in the map's frame.

    Attributes:
        name: The name of the file, without its extension.
        resolution: The side length of a pixel.
        origin: The x and y of the lower left corner of the lower left pixel.
        free: Which pixels are free; rows are sorted by y, pixels in a row by x.
        occupied: Which pixels are occupied. A pixel that is neither free nor occupied is unknown.
        turn: The rotation of rows and columns around the origin; quarter turns have been undone.
    """

    name: str
    resolution: Fraction
    origin: Place
    free: Flags
    occupied: Flags
    rotation: Rotation = NO_ROTATION

    @property
    def corners(self) -> list[Place]:
        """The places of the four corners."""
        rows, columns = (size * self.resolution for size in self.free.shape)
        found = []
        for corner in ((Fraction(0), Fraction(0)), (columns, Fraction(0)), (Fraction(0), rows), (columns, rows)):
            x, y = self.rotation.rotated(corner)
            found.append((self.origin[0] + x, self.origin[1] + y))
        return found

    def in_pixels(self, place: Place) -> Place:
        """Return a place in pixels to the right of and above the lower left corner."""
        x, y = self.rotation.rotated_back((place[0] - self.origin[0], place[1] - self.origin[1]))
        return x / self.resolution, y / self.resolution

    @cached_property
    def free_sums(self) -> Counts:
        """The number of free pixels with smaller x and y, for each corner of a pixel (a summed-area table)."""
        return summed_area(self.free)


def summed_area(flags: Flags) -> Counts:
    """Return the number of set flags with smaller x and y, for each corner of a pixel (a summed-area table)."""
    counts: Counts = np.cumsum(np.cumsum(np.pad(flags, ((1, 0), (1, 0))), axis=0, dtype=np.int64), axis=1)
    return counts


def read_occupancy_grid(path: Path) -> OccupancyGrid:
    """Return the map described by a YAML file, with its image.

    Raises:
        InvalidInputError: One of these files cannot be read, is not valid, or is too large.
    """
    with as_input_errors(path):
        if is_image(read_beginning(path, _MAGIC_BYTES)):
            raise MistakeError("is an image", "name the YAML file of the map, which names its image")
        content = read_content(path, MAX_YAML)
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise MistakeError("is not text in UTF-8", "name the YAML file of the map, not its image") from None
        described = read_yaml(text, _Description, _EXPECTED)
        image = described.image_path(path)
    with as_input_errors(image):
        shades = read_image(read_content(image, MAX_BYTES), adds_alpha=described.mode == "trinary")
    free, occupied = described.classified(shades)
    return _without_quarter_turns(
        OccupancyGrid(path.stem, described.resolution, described.origin, free, occupied), described.yaw
    )


def _without_quarter_turns(grid: OccupancyGrid, yaw: Fraction) -> OccupancyGrid:
    """Return the map with a yaw of less than an eighth of a circle, after rotating rows and origin by quarter turns."""
    rows, columns = grid.free.shape
    quarters, rotation = split_yaw(yaw, Fraction(isqrt(rows * rows + columns * columns) + 1))
    free, occupied, (x, y) = grid.free, grid.occupied, grid.origin
    corner = (Fraction(0), Fraction(0))
    for _ in range(quarters):
        # The first row becomes the last column; the end of this column is the new corner.
        corner = (-corner[1], corner[0])
        corner = (corner[0] - free.shape[0], corner[1])
        free, occupied = free.T[:, ::-1], occupied.T[:, ::-1]
    right, up = rotation.rotated((corner[0] * grid.resolution, corner[1] * grid.resolution))
    return replace(grid, origin=(x + right, y + up), free=free, occupied=occupied, rotation=rotation)


class _Description:
    """Parses the description of a map in a YAML file. Raises `MistakeError` for invalid or missing entries."""

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
        """Return which pixels are free, and which are occupied, with rows in ascending order of y, unlike the image."""
        # Thresholds are compared as Python integers: equality is exact on every machine, and any number of decimal
        # places is possible without overflow.
        shares, full = self._shares(image.white)
        free_below, occupied_above = self._free * full, self._occupied * full
        free = np.array([share is not None and share < free_below for share in shares])[image.pixels]
        occupied = np.array([share is not None and share > occupied_above for share in shares])[image.pixels]
        if image.opaque is not None and self.mode == "scale":  # transparent pixels are unknown
            free, occupied = free & image.opaque, occupied & image.opaque
        return free[::-1], occupied[::-1]

    def _shares(self, white: int) -> tuple[Sequence[int | None], int]:
        """Return the occupancy of each shade (None: unknown), and the occupancy of a certainly occupied pixel."""
        if self.mode == "raw":
            percents = ((2 * _RAW * shade + white) // (2 * white) for shade in range(white + 1))
            return [percent if percent <= _PERCENT else None for percent in percents], _PERCENT
        return range(white + 1) if self._negate else range(white, -1, -1), white

    def _image(self) -> str:
        node = self._entries["image"]
        if not isinstance(node.scalar, str) or not node.scalar or "\0" in node.scalar:
            raise MistakeError("has an image that is not a path", "give the path of the image file", node.line)
        return node.scalar

    def image_path(self, path: Path) -> Path:
        """Return the path of the image for the YAML file at `path`."""
        image = path.parent / self.image
        if not image.exists():
            why = f"names the image {shortened(self.image)}, which does not exist"
            raise MistakeError(why, "its path is relative to the folder of this file", self._entries["image"].line)
        return image

    def _number(self, key: str, least: Fraction, most: Fraction) -> Fraction:
        return _number(self._entries[key], key, least, most)

    def _pose(self) -> tuple[Place, Fraction]:
        node = self._entries["origin"]
        if node.items is None or len(node.items) != 3:  # noqa: PLR2004 - x, y, yaw
            raise MistakeError("has an origin that is not a pose", "expected [x, y, yaw]", node.line)
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
        mode = "a list or mapping as its mode" if node.scalar is None else f"the mode {shortened(str(node.scalar))}"
        raise MistakeError(f"has {mode}", f"supported modes: {', '.join(_MODES)}", node.line)


def _number(node: Node, key: str, least: Fraction, most: Fraction) -> Fraction:
    value: Scalar = node.scalar
    if isinstance(value, (int, Fraction)) and not isinstance(value, bool) and least <= value <= most:
        return Fraction(value)
    expected = f"expected a number from {float(least):g} to {float(most):g}"
    raise MistakeError(f"has an invalid {key}", expected, node.line)


__all__ = ["Counts", "Flags", "InvalidInputError", "OccupancyGrid", "read_occupancy_grid", "summed_area"]
