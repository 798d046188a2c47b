"""Reads the leaves of OctoMap's octrees from `.bt` and `.ot` files.

OctoMap: Hornung, Wurm, Bennewitz, Stachniss and Burgard, "OctoMap: an efficient probabilistic 3D mapping framework
based on octrees", Autonomous Robots 34 (2013). An octree with 16 levels covers a cube of 65,536 voxels per side, whose
centre is the origin of the frame. A file has a text header, and the nodes in depth-first order:

- `.bt`: two bytes for each inner node, with two bits for each of its eight children: 1 for a free leaf, 2 for an
  occupied leaf, 3 for an inner node, and 0 for unknown.
- `.ot`: for each node the logarithm of its odds as a float, three bytes for its colour in trees with colours, and a
  byte with a bit for each existing child. A leaf is occupied if its odds are at least even, as by default in OctoMap.

Bits 0, 1 and 2 of a child's number are set if the child is in the upper half along x, y and z.

Nodes are not visited one by one. A single sort finds the end of each subtree from the number of outstanding children
before each node (the Lukasiewicz path of the tree). Then each level of the tree is read at once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from robochoc.formats.diagnostics import MistakeError, shortened, suggestion
from robochoc.system.lazy_dataclass import dataclass

DEPTH = 16
"""The number of levels below the root. A leaf in the last level is a voxel."""
MAX_BYTES = 32 * 1024 * 1024
MAX_NODES = 4_000_000
"""The maximum number of nodes stored in a file; in `.bt` files these are inner nodes."""
_BINARY, _FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"
_HEADER_MAX = 64 * 1024
_SIDE_MIN_M, _SIDE_MAX_M = Fraction(1, 1000), Fraction(100)
_KEYS = ("id", "size", "res")
_NUMBER = re.compile(r"[0-9]{1,20}(?:\.[0-9]{1,30})?(?:e[+-]?[0-9]{1,2})?")
_COUNT = re.compile(r"[0-9]{1,10}")
_BYTES_OF_NODE = {"OcTree": 5, "1": 5, "OcTreeStamped": 5, "ColorOcTree": 8}
"""The supported types of trees, and the size of a node in `.ot` files, in bytes."""
_FREE, _OCCUPIED, _INNER = 1, 2, 3

Integers = npt.NDArray[np.int64]
Corners = npt.NDArray[np.uint16]
"""Positions in the tree, below 2 ** 16 on each axis; in two bytes each, since there may be millions."""


@dataclass(frozen=True, eq=False)
class Leaves:
    """Leaves of one size. A side has 2 ** `exponent` voxels.

    Attributes:
        exponent: The binary logarithm of a leaf's side in voxels.
        corners: The x, y and z of each leaf's lowest corner, in leaves from the lowest corner of the tree.
        occupied: Which leaves are occupied. The others are free.
    """

    exponent: int
    corners: Corners
    occupied: npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Octree:
    """An octree: the side length of a voxel in metres, and the known leaves, the largest first."""

    resolution: Fraction
    leaves: tuple[Leaves, ...]


def is_octomap(begin: bytes) -> bool:
    """Return whether a file that begins with `begin` is an OctoMap."""
    return begin.startswith((_BINARY, _FULL))


def read_octree(content: bytes) -> Octree:
    """Return the octree in a file.

    Raises:
        MistakeError: The content is not a valid OctoMap, is incomplete, or has more than `MAX_NODES`.
    """
    header = _Header(content)
    if not header.size:
        _check_end(content, header.end)
        return Octree(header.resolution, ())
    nodes = _BinaryNodes(content, header) if content.startswith(_BINARY) else _FullNodes(content, header)
    found = Octree(header.resolution, tuple(nodes.leaves()))
    _check_end(content, nodes.end)
    return found


def _check_end(content: bytes, end: int) -> None:
    """Raise `MistakeError` if anything but whitespace follows the last node."""
    if content[end:].strip():
        raise MistakeError(
            f"has {len(content) - end:,} bytes after its last node", "the file is damaged: save the map again"
        )


class _Header:
    """The header of a file: lines with a keyword and a value, up to `data`."""

    def __init__(self, content: bytes) -> None:
        if not is_octomap(content):
            raise MistakeError("is not an OctoMap file", f"it begins with '{_BINARY.decode()}' or '{_FULL.decode()}'")
        found: dict[str, tuple[int, str]] = {}
        self.end = number = 0
        while True:
            number += 1
            end = content.find(b"\n", self.end, _HEADER_MAX)
            if end < 0:
                raise MistakeError("has a header without end", "the line 'data' ends it, before the nodes", number)
            line = content[self.end : end].decode("ascii", "replace").split(None, 1)
            self.end = end + 1
            if line == ["data"]:
                break
            if line and not line[0].startswith("#"):
                if line[0] not in _KEYS:
                    raise MistakeError(
                        f"has the unknown line '{shortened(line[0])}' in its header",
                        suggestion(line[0], _KEYS, "lines"),
                        number,
                    )
                if line[0] in found:
                    raise MistakeError(f"has the line '{line[0]}' twice in its header", "delete one", number)
                found[line[0]] = (number, line[1].strip() if len(line) > 1 else "")
        for key in _KEYS:
            if key not in found:
                raise MistakeError(f"has no {key} in its header", "it needs the lines id, size, res and data", number)
        self.type = self._type(*found["id"])
        self.size = self._size(*found["size"])
        self.resolution = self._number("res", *found["res"], _SIDE_MIN_M, _SIDE_MAX_M)

    @staticmethod
    def _type(line: int, name: str) -> str:
        if name not in _BYTES_OF_NODE:
            hint = "supported types: OcTree, ColorOcTree, OcTreeStamped"
            raise MistakeError(f"has a tree of the type {shortened(name)}", hint, line)
        return name

    @staticmethod
    def _size(line: int, text: str) -> int:
        if not _COUNT.fullmatch(text):
            raise MistakeError("has an invalid size", "expected the number of nodes", line)
        return int(text)

    @staticmethod
    def _number(key: str, line: int, text: str, least: Fraction, most: Fraction) -> Fraction:
        if _NUMBER.fullmatch(text) and least <= Fraction(text) <= most:
            return Fraction(text)
        expected = f"expected a number from {float(least):g} to {float(most):g}"
        raise MistakeError(f"has an invalid {key}", expected, line)


class _Nodes:
    """The nodes of a file, in depth-first order.

    Args:
        begin: The offset of the first node.
        size: The size of a node, in bytes.
        children: The number of stored children of each possible node in the file.
    """

    def __init__(self, begin: int, size: int, children: Integers) -> None:
        self._begin, self._size = begin, size
        left = np.cumsum(children - 1) + 1  # outstanding nodes after each node
        ends = np.flatnonzero(left == 0)
        if not ends.size:
            known = f"ends after {len(children):,} nodes"
            if len(children) >= MAX_NODES:
                raise MistakeError(f"has more than {MAX_NODES:,} nodes", "use a coarser map")
            raise MistakeError(f"{known}, but the tree has more", "the file is incomplete")
        self.count = int(ends[0]) + 1
        self.children = children[: self.count]
        self._end = self._ends(left)

    @property
    def end(self) -> int:
        """The offset of the first byte after the last node."""
        return self._begin + self.count * self._size

    def _ends(self, left: Integers) -> Integers:
        """Return the node after each node's subtree: the first node with fewer outstanding nodes before it."""
        count = self.count
        before = np.concatenate(([1], left[:count]))
        keys = before * (count + 1) + np.arange(count + 1)
        order = np.sort(keys)
        found: Integers = order[np.searchsorted(order, keys[:-1] - (count + 1), side="right")] % (count + 1)
        return found

    def place(self, node: int) -> str:
        """Return the position of a node in the file, as text."""
        return f"byte {self._begin + node * self._size}"

    def after_subtree(self, nodes: Integers) -> Integers:
        """Return the nodes after the subtrees of `nodes`."""
        return self._end[nodes]

    def check_depth(self, exponent: int, nodes: Integers) -> None:
        """Raise `MistakeError` if there are inner nodes below the last level."""
        if exponent < 1 and nodes.size:
            raise MistakeError(
                f"has a node below level {DEPTH} at {self.place(int(nodes[0]))}",
                "the file is damaged: save the map again",
            )


class _BinaryNodes(_Nodes):
    """The inner nodes in a `.bt` file."""

    def __init__(self, content: bytes, header: _Header) -> None:
        count = min((len(content) - header.end) // 2, MAX_NODES)
        self._words = np.frombuffer(content, dtype="<u2", count=count, offset=header.end).astype(np.int64)
        children = np.zeros(count, dtype=np.int64)
        for child in range(8):
            children += self._kind(self._words, child) == _INNER
        super().__init__(header.end, 2, children)
        self._expected = header.size

    def leaves(self) -> Iterator[Leaves]:
        """Yield the known leaves, level by level."""
        nodes, corners = np.zeros(1, dtype=np.int64), np.zeros((1, 3), dtype=np.int64)
        found, exponent = 1, DEPTH
        while nodes.size:
            self.check_depth(exponent, nodes)
            exponent -= 1
            words, following = self._words[nodes], nodes + 1
            empty = nodes[words == 0]
            if empty.size:
                raise MistakeError(
                    f"has a node without children at {self.place(int(empty[0]))}",
                    "the file is damaged: save the map again",
                )
            inner: list[tuple[Integers, Integers]] = []
            known: list[tuple[Corners, npt.NDArray[np.bool_]]] = []
            for child in range(8):
                kinds, places = self._kind(words, child), _child_corners(corners, child)
                deeper, leaf = kinds == _INNER, (kinds == _FREE) | (kinds == _OCCUPIED)
                inner.append((following[deeper], places[deeper]))
                following[deeper] = self.after_subtree(following[deeper])
                known.append((places[leaf].astype(np.uint16), kinds[leaf] == _OCCUPIED))
            nodes, corners = (np.concatenate(parts) for parts in zip(*inner, strict=True))
            leaves, occupied = (np.concatenate(parts) for parts in zip(*known, strict=True))
            found += len(nodes) + len(leaves)
            yield Leaves(exponent, leaves, occupied)
        if found != self._expected:
            raise _other_count(found, self._expected)

    @staticmethod
    def _kind(words: Integers, child: int) -> Integers:
        return (words >> (2 * child)) & 3


class _FullNodes(_Nodes):
    """The nodes in an `.ot` file, including leaves."""

    def __init__(self, content: bytes, header: _Header) -> None:
        size = _BYTES_OF_NODE[header.type]
        count = min((len(content) - header.end) // size, MAX_NODES)
        rows = np.frombuffer(content, dtype=np.uint8, count=count * size, offset=header.end).reshape(count, size)
        self._odds = np.ascontiguousarray(rows[:, :4]).view("<f4").ravel()
        self._bits = rows[:, -1]
        super().__init__(header.end, size, np.bitwise_count(self._bits).astype(np.int64))
        self._expected = header.size

    def leaves(self) -> Iterator[Leaves]:
        """Yield the known leaves, level by level. A leaf with NaN as odds is unknown."""
        nodes, corners = np.zeros(1, dtype=np.int64), np.zeros((1, 3), dtype=np.int64)
        exponent = DEPTH
        while nodes.size:
            is_leaf = self.children[nodes] == 0
            known = is_leaf & ~np.isnan(self._odds[nodes])
            yield Leaves(exponent, corners[known].astype(np.uint16), self._odds[nodes[known]] >= 0)
            nodes, corners = nodes[~is_leaf], corners[~is_leaf]
            self.check_depth(exponent, nodes)
            exponent -= 1
            following = nodes + 1
            inner: list[tuple[Integers, Integers]] = []
            for child in range(8):
                there = (self._bits[nodes] >> child) & 1 == 1
                inner.append((following[there], _child_corners(corners, child)[there]))
                following[there] = self.after_subtree(following[there])
            nodes, corners = (np.concatenate(parts) for parts in zip(*inner, strict=True))
        if self.count != self._expected:
            raise _other_count(self.count, self._expected)


def _other_count(found: int, expected: int) -> MistakeError:
    return MistakeError(
        f"has {found:,} nodes, but its header states {expected:,}", "the file is damaged: save the map again"
    )


def _child_corners(corners: Integers, child: int) -> Integers:
    """Return the corners of the child number `child` of each node, in units of the side of a child."""
    upper: Integers = np.array([child & 1, child >> 1 & 1, child >> 2 & 1], dtype=np.int64)
    return 2 * corners + upper
