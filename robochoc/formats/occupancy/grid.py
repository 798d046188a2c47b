"""Occupancy grids: which pixels of a map are free, which are occupied, and which nobody knows.

As ROS 1's map_server and Nav2's write and read them (wiki.ros.org/map_server, "Map format"): a YAML file names an
image, says how large a pixel is and where the lower left corner lies, and from which occupancy on a pixel is free or
occupied. The occupancy of a pixel is 0 where it is white and 1 where it is black; with `negate` the other way round.
"""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import InvalidInputError, MistakeError, invalid_input, shortened
from robochoc.formats.dialects.yaml_tree import Node, Scalar, read_yaml
from robochoc.formats.occupancy.pgm import MAX_BYTES, Pixels, read_pgm

MAX_YAML = 64 * 1024
_SIDE_MAX_M = Fraction(100)
_SIDE_MIN_M = Fraction(1, 1000)
_FAR_M = Fraction(1_000_000)
"""No map lies further away from the origin of its frame."""
_MODES = ("trinary", "scale")
_KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")

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
    """

    name: str
    resolution: Fraction
    origin: tuple[Fraction, Fraction]
    free: Flags
    occupied: Flags

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
    with _told(path):
        content = _content(path, MAX_YAML)
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise MistakeError("is not text in UTF-8", "name the YAML file of the map, not its image") from None
        described = _Description(text)
    image = path.parent / described.image
    with _told(image):
        pixels, white = read_pgm(_content(image, MAX_BYTES))
    free, occupied = described.classified(pixels, white)
    return OccupancyGrid(path.stem, described.resolution, described.origin, free, occupied)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Raise `InvalidInputError`, with the file's name, for what is wrong in it."""
    try:
        yield
    except OSError as error:
        raise invalid_input(path, error.strerror or str(error), "name a file that can be read") from None
    except MistakeError as mistake:
        raise invalid_input(path, mistake.message, mistake.hint, mistake.line) from None


def _content(path: Path, most: int) -> bytes:
    if path.exists() and not stat.S_ISREG(path.stat().st_mode):
        raise MistakeError("is no file", "name a file")
    with path.open("rb") as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise MistakeError("is too large", f"it may have {most:,} bytes")
    return content


class _Description:
    """The description of a map in its YAML file. Raises `MistakeError` where something is wrong or missing."""

    def __init__(self, text: str) -> None:
        document = read_yaml(text, f"a map has the keys {', '.join(_KEYS)}")
        if document.root.entries is None:
            raise MistakeError("is no map", f"expected the keys {', '.join(_KEYS)}", document.root.line)
        for line, key in document.repeated:
            raise MistakeError(f"has the key {shortened(key)} twice", "keep one", line)
        self._entries = document.root.entries
        missing = [key for key in _KEYS if key not in self._entries]
        if missing:
            raise MistakeError(f"has no {missing[0]}", f"a map has the keys {', '.join(_KEYS)}")
        self.image = self._image()
        self.resolution = self._number("resolution", _SIDE_MIN_M, _SIDE_MAX_M)
        self.origin = self._origin()
        self._negate = self._negated()
        self._occupied = self._number("occupied_thresh", Fraction(0), Fraction(1))
        self._free = self._number("free_thresh", Fraction(0), self._occupied)
        self._check_mode()

    def classified(self, pixels: Pixels, white: int) -> tuple[Flags, Flags]:
        """Return which pixels are free, and which are occupied; rows from the lowest y on. An image has it on top."""
        # The occupancy of each shade, in units of 1 / white. Thresholds are compared in Python's integers: one that a
        # pixel meets exactly is met on every machine, and no number of decimal places overflows.
        shares = range(white + 1) if self._negate else range(white, -1, -1)
        free_below, occupied_above = self._free * white, self._occupied * white
        free = np.array([share < free_below for share in shares])
        occupied = np.array([share > occupied_above for share in shares])
        upright = pixels[::-1]
        return free[upright], occupied[upright]

    def _image(self) -> str:
        node = self._entries["image"]
        if not isinstance(node.scalar, str) or not node.scalar or "\0" in node.scalar:
            raise MistakeError("has an image that is no path", "name the image beside the YAML file", node.line)
        if not node.scalar.lower().endswith(".pgm"):
            hint = "convert it to PGM, which map_saver writes by default, and name that"
            raise MistakeError(f"has the image {shortened(node.scalar)}, which is no PGM", hint, node.line)
        return node.scalar

    def _number(self, key: str, least: Fraction, most: Fraction) -> Fraction:
        return _number(self._entries[key], key, least, most)

    def _origin(self) -> tuple[Fraction, Fraction]:
        node = self._entries["origin"]
        if node.items is None or len(node.items) != 3:  # noqa: PLR2004 - x, y, yaw
            raise MistakeError("has an origin that is no pose", "expected [x, y, yaw]", node.line)
        x, y, yaw = (_number(one, "origin", -_FAR_M, _FAR_M) for one in node.items)
        if yaw:
            raise MistakeError(f"is turned: its yaw is {float(yaw):g}", "only a yaw of 0 is read; turn it", node.line)
        return x, y

    def _negated(self) -> bool:
        node = self._entries["negate"]
        if node.scalar not in (0, 1):  # `False` and `True`, too
            raise MistakeError("has a negate that is neither 0 nor 1", "write 0: white is free", node.line)
        return bool(node.scalar)

    def _check_mode(self) -> None:
        node = self._entries.get("mode")
        if node is not None and node.scalar not in _MODES:
            told = shortened(str(node.scalar))
            raise MistakeError(f"has the mode {told}", f"{' and '.join(_MODES)} are read", node.line)


def _number(node: Node, key: str, least: Fraction, most: Fraction) -> Fraction:
    value: Scalar = node.scalar
    if isinstance(value, (int, Fraction)) and not isinstance(value, bool) and least <= value <= most:
        return Fraction(value)
    expected = f"expected a number from {float(least):g} to {float(most):g}"
    raise MistakeError(f"has a wrong {key}", expected, node.line)


__all__ = ["Counts", "Flags", "InvalidInputError", "OccupancyGrid", "before", "read_occupancy_grid"]
