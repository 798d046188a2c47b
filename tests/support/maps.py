"""Maps for tests, and what is asked of them by other means than the generators': pixels as dictionaries, one by one."""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import floor
from pathlib import Path
from random import Random

WALL, FREE, UNKNOWN = "#", ".", "?"
_SHADES = {WALL: 0, FREE: 254, UNKNOWN: 205}  # as map_saver writes them: 205 is just above a free_thresh of 0.196

ROOMS = ["#########", "#...#...#", "#...#...#", "#.......#", "#...#...#", "#...#...#", "#########"]
"""Two rooms with a door, for pixels of 0.5 m."""
Pixel = tuple[int, int]
"""Column and row, from the lower left."""


def write_map(
    folder: Path, rows: Sequence[str], *, resolution: str = "0.5", origin: str = "[0, 0, 0]", name: str = "plan"
) -> Path:
    """Write a map drawn with `#`, `.` and `?`, the upper row first. Return the path of its YAML file."""
    pixels = "\n".join(" ".join(str(_SHADES[one]) for one in row) for row in rows)
    (folder / f"{name}.pgm").write_text(f"P2\n{len(rows[0])} {len(rows)}\n255\n{pixels}\n")
    path = folder / f"{name}.yaml"
    path.write_text(
        f"image: {name}.pgm\nresolution: {resolution}\norigin: {origin}\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def drawn_rows(chance: Random, columns: int, rows: int, walls: float = 0.2) -> list[str]:
    """Return a random map, of which about the share `walls` is not free."""
    return [
        "".join(
            (WALL if chance.random() < 0.8 else UNKNOWN) if chance.random() < walls else FREE for _ in range(columns)
        )
        for _ in range(rows)
    ]


def free_pixels(rows: Sequence[str]) -> set[Pixel]:
    """Return the free pixels."""
    return {(x, y) for y, row in enumerate(reversed(rows)) for x, one in enumerate(row) if one == FREE}


def fitting(rows: Sequence[str], radius: Fraction) -> set[Pixel]:
    """Return the pixels that are further than a radius, in pixels, from all that is not free and from the outside."""
    free = free_pixels(rows)
    reach = floor(radius)
    around = [
        (x, y) for x in range(-reach, reach + 1) for y in range(-reach, reach + 1) if x * x + y * y <= radius * radius
    ]
    return {(x, y) for x, y in free if all((x + right, y + up) in free for right, up in around)}


def ways(start: Pixel, among: set[Pixel]) -> Mapping[Pixel, int]:
    """Return the lengths of the shortest ways from a pixel: 15 along an edge, 21 across a corner that is not cut."""
    done: dict[Pixel, int] = {}
    queue = [(0, start)]
    while queue:
        length, (x, y) = heapq.heappop(queue)
        if (x, y) in done:
            continue
        done[x, y] = length
        for right in (-1, 0, 1):
            for up in (-1, 0, 1):
                beside = {(x + right, y), (x, y + up), (x + right, y + up)}
                if (right or up) and beside <= among:
                    heapq.heappush(queue, (length + (21 if right and up else 15), (x + right, y + up)))
    return done


def touched(start: tuple[Fraction, Fraction], end: tuple[Fraction, Fraction], pixel: Pixel) -> bool:
    """Return whether a straight line touches a pixel, its border included; places are in pixels.

    By separating axes: they do not touch if they lie apart along x, along y, or across the line.
    """
    (a, b), (c, d), (x, y) = start, end, pixel
    if max(a, c) < x or min(a, c) > x + 1 or max(b, d) < y or min(b, d) > y + 1:
        return False
    sides = [(c - a) * (up - b) - (d - b) * (right - a) for right in (x, x + 1) for up in (y, y + 1)]
    return min(sides) <= 0 <= max(sides)
