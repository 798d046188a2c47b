"""Flights of random teams on random OctoMaps, and what is asked of their logs by other means than the planner's.

Distances from walls are measured to all voxels that are not free, one by one, as the map was drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product
from pathlib import Path
from random import Random

import numpy as np
import numpy.typing as npt

from robochoc.flight.flight import fly
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.quadrotor.conditions import FlightConditions
from robochoc.formats.ground_map import GroundMap, ground_map_json, read_ground_map
from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.patrol import patrol
from robochoc.generators.maps.reach import MapChoice
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from tests.support.octomaps import FREE, OCCUPIED, Voxel, drawn_voxels, write_octomap

Array = npt.NDArray[np.float64]


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


@dataclass(frozen=True)
class FlownInSpace:
    """A team that was flown on an OctoMap, and how."""

    voxels: Mapping[Voxel, int]
    side: float
    radius: float
    team: Team
    ground: GroundMap
    mission: Mission
    flown: FlightLog

    def faults(self) -> list[str]:
        """Return what is wrong with the flight; nothing if all is well."""
        flown, told = self.flown, []
        apart = gaps_in_space(self.voxels, self.side, flown.positions.reshape(-1, 3))
        set_m = flown.nearest_wall.set_m if flown.nearest_wall else self.radius
        ends = np.array([goal.at for goal in self.mission.legs[-1].goals.values()])
        homes = np.array([drone.home for drone in self.mission.drones])
        leave = float(gaps_in_space(self.voxels, self.side, np.vstack((ends, homes))).min())
        if apart.min() < set_m:
            told.append(f"{apart.min():.4f} m from a wall, and {set_m:g} m are set")
        if set_m < min(self.radius, leave) - 0.0401:
            told.append(f"{set_m:.4f} m from walls are set, the radius is {self.radius:g} m, places leave {leave:.4f}")
        if flown.nearest_wall and abs(flown.nearest_wall.distance_m - apart.min()) > 1e-6:
            told.append(f"{flown.nearest_wall} is told, and {apart.min():.6f} m it was")
        if not flown.nearest_wall and apart.min() < self.radius + 0.29:
            told.append(f"no wall is told, and one was {apart.min():.3f} m away")
        flat = flown.positions / np.array([1, 1, flown.downwash])
        for one, other in combinations(range(len(flown.names)), 2):
            gap = np.linalg.norm(flat[:, one] - flat[:, other], axis=1).min()
            if gap < flown.distance:
                told.append(f"drones {one} and {other} are {gap:.4f} m apart, and {flown.distance:g} m are set")
        if np.abs(flown.positions[0] - homes).max() > 0.01:
            told.append("a drone does not begin where its robot is")
        off = np.linalg.norm(flown.positions[-1] - ends, axis=1).max()
        if off > 0.02:
            told.append(f"a drone ends {off:.3f} m from its place")
        return told


def flown_in_space(seed: int, folder: Path, conditions: FlightConditions | None = None) -> FlownInSpace | str:
    """Return a random team on a random OctoMap, each robot sent to a value of its own; or why it was not flown."""
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
    choice = MapChoice(
        map=str(path), agents=count, radius=radius, speed=chance.choice((0.3, 0.5, 0.8)), cells=chance.choice((40, 80))
    )
    family = chance.choice(("formation", "coverage", "patrol"))
    try:
        if family == "formation":
            team, ground = formation(choice, seed, shape=chance.choice(("line", "wedge", "circle", "grid")))
        elif family == "coverage":
            team, ground = coverage(choice, seed)
        else:
            team, ground = patrol(choice, seed, points=count + 2)
    except ValueError as refused:
        return f"no team: {refused}"
    if (ground.scale or 0) < 0.25:
        return "no team: drones do not fit into its cells"
    values: dict[str, int] = {}
    for robot in team.robots:
        variable = robot.variables[0]
        free = [value for value in variable.domain if value not in values.values()]
        if not free:
            return "no team: more robots than cells"
        values[variable.name] = chance.choice(free)
    ground = read_ground_map(ground_map_json(ground))
    mission = mission_of(Outcome(team.name, "abt", "simulator", 0, Verdict.SOLUTION, values), team, ground=ground)
    given = FlightConditions(distance=chance.choice((None, None, 0.3)), downwash=chance.choice((1, 1, 1, 2)))
    try:
        flown = fly(mission, conditions or given)
    except ValueError as refused:
        return str(refused)
    return FlownInSpace(voxels, float(side), radius, team, ground, mission, flown)
