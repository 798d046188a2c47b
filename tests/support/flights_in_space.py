"""Random houses of voxels, flights of random teams on them, and distances from walls by another way than the planner's.

Distances from walls are measured to all voxels that are not free, one by one, as the map was drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from random import Random

import numpy as np

from tests.support.flown_teams import Array, FlownTeam, flown_on
from tests.support.octomaps import FREE, OCCUPIED, Voxel, drawn_voxels, write_octomap


def house(chance: Random, sides: Voxel, first: Voxel = (0, 0, 0)) -> dict[Voxel, int]:
    """Return a random house: walls and floors with a hole in each, some pillars, and some of which nobody knows."""
    found = dict.fromkeys(product(*map(range, sides)), FREE)
    for _ in range(chance.randrange(1, 4)):
        axis = chance.randrange(3)
        at = chance.randrange(2, max(3, sides[axis] - 2))
        wide = [chance.randrange(2, 6) for _ in range(3)]
        low = [chance.randrange(max(1, side - some)) for side, some in zip(sides, wide, strict=True)]
        for place in found:
            hole = all(
                begin <= part < begin + some
                for other, (part, begin, some) in enumerate(zip(place, low, wide, strict=True))
                if other != axis
            )
            if place[axis] == at:
                found[place] = FREE if hole else OCCUPIED
    for _ in range(chance.randrange(6)):
        place = tuple(chance.randrange(side) for side in sides)
        found[place[0], place[1], place[2]] = chance.choice((OCCUPIED, 0))
    return {(x + first[0], y + first[1], z + first[2]): kind for (x, y, z), kind in found.items() if kind}


def gaps_in_space(voxels: Mapping[Voxel, int], side: float, points: Array) -> Array:
    """Return the distance (K,) of each of `points` (K, 3) from all voxels that are not free, far away ones included."""
    free = {at for at, kind in voxels.items() if kind == FREE}
    around = {tuple(part + move for part, move in zip(at, moves, strict=True)) for at in free for moves in _MOVES}
    solid = np.array(sorted(around - free), dtype=np.float64)
    found = np.full(len(points), np.inf)
    for some in np.array_split(np.arange(len(points)), 1 + len(points) * len(solid) // 2_000_000):
        places = points[some, None] / side
        off = np.maximum(np.maximum(solid[None] - places, places - solid[None] - 1), 0)
        found[some] = side * np.sqrt(np.square(off).sum(axis=2)).min(axis=1)
    inside = np.array([tuple(at) in free for at in np.floor(points / side).astype(int).tolist()], dtype=bool)
    return np.where(inside, found, 0.0)


_MOVES = [*product((-1, 0, 1), repeat=3)]


def flown_in_space(seed: int, folder: Path) -> FlownTeam | str:
    """Return a random team that was flown on a random OctoMap; or why it was not flown."""
    chance = Random(seed)
    side = chance.choice(("0.1", "0.2", "0.25", "0.5"))
    columns, rows, levels = (max(6, min(24, int(chance.uniform(2, 6) / float(side)))) for _ in range(3))
    first = chance.randrange(-20, 20), chance.randrange(-20, 20), chance.randrange(-5, 5)
    loose = chance.random() < 0.3
    sides = columns, rows, levels
    voxels = drawn_voxels(chance, sides, first, 0.04) if loose else house(chance, sides, first)
    radius = chance.choice((0.1, 0.2, 0.2, 0.3))
    count = chance.randrange(1, 7)
    path = write_octomap(folder / f"map{chance.choice(('.bt', '.ot'))}", voxels, side)
    return flown_on(path, seed, chance, count, radius, lambda places: gaps_in_space(voxels, float(side), places))
