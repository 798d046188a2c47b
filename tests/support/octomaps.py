"""OctoMaps for tests, written node by node, and what is asked of them by other means: voxels as dictionaries."""

from __future__ import annotations

import heapq
import struct
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from random import Random

FREE, OCCUPIED = 1, 2
DEPTH = 16
MIDDLE = 1 << (DEPTH - 1)

Voxel = tuple[int, int, int]
"""The x, y and z of a voxel, from the middle of the tree on."""
Voxels = Mapping[Voxel, int]
"""What is known: free or occupied."""
_Node = int | list["_Node"]
"""What a leaf is, 0 where it is not known; or the eight children."""


def drawn_voxels(chance: Random, sides: Voxel, first: Voxel = (0, 0, 0), walls: float = 0.2) -> dict[Voxel, int]:
    """Return a random map of so many voxels along each axis, of which about the share `walls` is not free."""
    found: dict[Voxel, int] = {}
    for x, y, z in product(*map(range, sides)):
        at = first[0] + x, first[1] + y, first[2] + z
        if chance.random() >= walls:
            found[at] = FREE
        elif chance.random() < 0.8:
            found[at] = OCCUPIED
    return found


def write_octomap(path: Path, voxels: Voxels, resolution: str = "0.5") -> Path:
    """Write a map as `.bt` or `.ot`, by the ending of its name; equal children are joined, as OctoMap prunes them."""
    tree = _tree([(x + MIDDLE, y + MIDDLE, z + MIDDLE, kind) for (x, y, z), kind in voxels.items()], DEPTH)
    binary = path.suffix == ".bt"
    kind = "OcTree binary file" if binary else "OcTree file"
    head = f"# Octomap {kind}\n# (written for a test)\nid OcTree\nsize {_size(tree)}\nres {resolution}\ndata\n"
    nodes = b"".join((_binary if binary else _full)(tree))
    path.write_bytes(head.encode() + (nodes if tree else b""))
    return path


def _tree(voxels: list[tuple[int, int, int, int]], level: int) -> _Node:
    if not voxels:
        return 0
    if not level:
        return voxels[0][3]
    below: list[list[tuple[int, int, int, int]]] = [[] for _ in range(8)]
    bit = level - 1
    for x, y, z, kind in voxels:
        below[(x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2].append((x, y, z, kind))
    children = [_tree(some, bit) for some in below]
    return children[0] if isinstance(children[0], int) and children[0] and children == children[:1] * 8 else children


def _size(node: _Node) -> int:
    """Return the number of nodes."""
    return sum(map(_size, node)) + 1 if isinstance(node, list) else int(node > 0)


def _binary(node: _Node) -> Iterator[bytes]:
    if isinstance(node, list):
        word = sum((child if isinstance(child, int) else 3) << 2 * place for place, child in enumerate(node))
        yield struct.pack("<H", word)
        for child in node:
            yield from _binary(child)


def _full(node: _Node) -> Iterator[bytes]:
    if isinstance(node, list):
        yield struct.pack("<fB", 3.5, sum(1 << place for place, child in enumerate(node) if child))
        for child in node:
            yield from _full(child)
    elif node:
        yield struct.pack("<fB", 0.0 if node == OCCUPIED else -0.1, 0)


def voxels_fitting(voxels: Voxels, radius: float) -> set[Voxel]:
    """Return the free voxels that are further than a radius, in voxels, from all that is not free."""
    free = {at for at, kind in voxels.items() if kind == FREE}
    reach = range(-int(radius), int(radius) + 1)
    around = [move for move in product(reach, repeat=3) if sum(part * part for part in move) <= radius * radius]
    return {at for at in free if all(_moved(at, move) in free for move in around)}


def ways_in_space(start: Voxel, among: set[Voxel]) -> dict[Voxel, int]:
    """Return the lengths of the shortest ways: 15, 21 and 26 a step; none cuts a corner."""
    done: dict[Voxel, int] = {}
    queue = [(0, start)]
    while queue:
        length, at = heapq.heappop(queue)
        if at in done:
            continue
        done[at] = length
        for move in product((-1, 0, 1), repeat=3):
            axes = sum(map(abs, move))
            box = product(*({0, part} for part in move))
            if axes and all(_moved(at, some) in among for some in box):
                heapq.heappush(queue, (length + (15, 21, 26)[axes - 1], _moved(at, move)))
    return done


def _moved(at: Voxel, move: tuple[int, ...]) -> Voxel:
    return at[0] + move[0], at[1] + move[1], at[2] + move[2]
