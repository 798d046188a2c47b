"""Random buildings, flights of random teams on them, and distances from walls by another way than the planner's.

Distances from walls are measured to all pixels that are not free, one by one, as the map was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from random import Random

import numpy as np

from tests.support.flown_teams import Array, FlownTeam, flown_on
from tests.support.maps import FREE, UNKNOWN, WALL, drawn_rows, write_map


def rooms(chance: Random, columns: int, rows: int) -> list[str]:
    """Return a random building: rooms, doors between them, some pillars, and some of which nobody knows."""
    border = [WALL] * columns
    drawn = [border.copy(), *([WALL, *[FREE] * (columns - 2), WALL] for _ in range(rows - 2)), border.copy()]
    for _ in range(chance.randrange(1, 5)):
        upright = chance.random() < 0.5
        across, along = (columns, rows) if upright else (rows, columns)
        at, door = chance.randrange(3, across - 3), chance.randrange(1, along - 4)
        width = chance.randrange(1, 6)
        for step in range(along):
            x, y = (at, step) if upright else (step, at)
            drawn[y][x] = FREE if door <= step < min(along - 1, door + width) else WALL
    for _ in range(chance.randrange(5)):
        drawn[chance.randrange(rows)][chance.randrange(columns)] = chance.choice((WALL, UNKNOWN))
    return ["".join(row) for row in drawn]


def gaps(rows: Sequence[str], side: float, points: Array) -> Array:
    """Return the distance (K,) of each of `points` (K, 2) from all pixels that are not free, and from the outside."""
    x, y = points[:, 0], points[:, 1]
    found = np.minimum(np.minimum(x, y), np.minimum(len(rows[0]) * side - x, len(rows) * side - y))
    for row, drawn in enumerate(reversed(rows)):
        for column, one in enumerate(drawn):
            if one != FREE:
                right = np.maximum(np.maximum(column * side - x, x - (column + 1) * side), 0)
                up = np.maximum(np.maximum(row * side - y, y - (row + 1) * side), 0)
                found = np.minimum(found, np.hypot(right, up))
    return np.asarray(found)


def flown_team(seed: int, folder: Path) -> FlownTeam | str:
    """Return a random team that was flown on a random map; or why it was not flown."""
    chance = Random(seed)
    side = chance.choice(("0.05", "0.1", "0.2", "0.25", "0.5"))
    columns, height = (max(12, min(80, int(chance.uniform(4, 9) / float(side)))) for _ in range(2))
    loose = chance.random() < 0.3
    share = chance.choice((0.03, 0.08))
    rows = drawn_rows(chance, min(columns, 40), min(height, 40), share) if loose else rooms(chance, columns, height)
    radius = chance.choice((0.1, 0.2, 0.2, 0.3))
    count = chance.randrange(1, 9)
    path = write_map(folder, rows, resolution=side)
    return flown_on(path, seed, chance, count, radius, lambda places: gaps(rows, float(side), places[:, :2]))
