"""Small maps of buildings with random walls, and the lengths of the ways in them, by a search of a few lines."""

from __future__ import annotations

import heapq
from fractions import Fraction
from pathlib import Path
from random import Random

Pixel = tuple[int, int]
RESOLUTION = Fraction(1, 2)
ORIGIN = (Fraction(-1), Fraction(2))


class SmallMap:
    """A map of `columns` x `rows` pixels of `RESOLUTION` metres; column and row of the occupied ones are in `walls`."""

    def __init__(self, columns: int, rows: int, walls: set[Pixel]) -> None:
        self.columns, self.rows, self.walls = columns, rows, walls
        self._found: dict[Pixel, dict[Pixel, int]] = {}

    @classmethod
    def drawn(cls, chance: Random) -> SmallMap:
        """Return a random map."""
        columns, rows = chance.randint(4, 9), chance.randint(4, 7)
        pixels = [(x, y) for x in range(columns) for y in range(rows)]
        return cls(columns, rows, set(chance.sample(pixels, len(pixels) * chance.randint(0, 4) // 10)))

    @property
    def free(self) -> list[Pixel]:
        """The free pixels."""
        return [(x, y) for x in range(self.columns) for y in range(self.rows) if (x, y) not in self.walls]

    def write(self, folder: Path) -> str:
        """Write the map, and return the name of its file."""
        lines = [
            " ".join("0" if (x, y) in self.walls else "255" for x in range(self.columns))
            for y in reversed(range(self.rows))
        ]
        (folder / "small.pgm").write_text(f"P2 {self.columns} {self.rows} 255\n" + "\n".join(lines) + "\n")
        x, y = map(float, ORIGIN)
        (folder / "small.yaml").write_text(
            f"image: small.pgm\nresolution: {float(RESOLUTION)}\norigin: [{x}, {y}, 0]\n"
            "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
        )
        return "small.yaml"

    def place(self, pixel: Pixel) -> list[float]:
        """Return the centre of a pixel, in metres."""
        return [float(ORIGIN[axis] + (pixel[axis] + Fraction(1, 2)) * RESOLUTION) for axis in (0, 1)]

    def length(self, start: Pixel, end: Pixel) -> Fraction | None:
        """Return the length of the shortest way in metres; None if there is none."""
        if start not in self._found:
            self._found[start] = self._search(start)
        steps = self._found[start].get(end)
        return None if steps is None else steps * RESOLUTION / 15

    def _search(self, start: Pixel) -> dict[Pixel, int]:
        free, found, waiting = set(self.free), dict[Pixel, int](), [(0, start)]
        while waiting:
            length, (x, y) = heapq.heappop(waiting)
            if (x, y) in found:
                continue
            found[x, y] = length
            for dx, dy in ((dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy):
                if {(x + dx, y + dy), (x + dx, y), (x, y + dy)} <= free:
                    heapq.heappush(waiting, (length + (21 if dx and dy else 15), (x + dx, y + dy)))
        return found
