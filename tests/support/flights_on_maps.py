"""Flights of random teams on random maps, and what is asked of their logs by other means than the planner's.

Distances from walls are measured to all pixels that are not free, one by one, as the map was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
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
from tests.support.maps import FREE, UNKNOWN, WALL, drawn_rows, write_map

Array = npt.NDArray[np.float64]


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


@dataclass(frozen=True)
class FlownTeam:
    """A team that was flown on a map, and how."""

    rows: list[str]
    side: float
    radius: float
    team: Team
    ground: GroundMap
    mission: Mission
    values: dict[str, int]
    flown: FlightLog

    def faults(self) -> list[str]:
        """Return what is wrong with the flight; nothing if all is well."""
        flown, told = self.flown, []
        counted = flown.positions[:, :, :2]
        apart = gaps(self.rows, self.side, counted.reshape(-1, 2)).reshape(counted.shape[:2])
        set_m = flown.nearest_wall.set_m if flown.nearest_wall else self.radius
        places = np.array([goal.at for goal in self.mission.legs[-1].goals.values()] + [*self._homes()])
        leave = float(gaps(self.rows, self.side, places[:, :2]).min())
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
        ends = np.array([goal.at for goal in self.mission.legs[-1].goals.values()])
        off = np.linalg.norm(flown.positions[-1] - ends, axis=1).max()
        if off > 0.02:
            told.append(f"a drone ends {off:.3f} m from its place")
        return told

    def _homes(self) -> list[tuple[float, float, float]]:
        return [drone.home for drone in self.mission.drones]


def flown_team(seed: int, folder: Path, conditions: FlightConditions | None = None) -> FlownTeam | str:
    """Return a random team on a random map, each robot sent to a random value of its own; or why it was not flown."""
    chance = Random(seed)
    side = chance.choice(("0.05", "0.1", "0.2", "0.25", "0.5"))
    columns, height = (max(12, min(80, int(chance.uniform(4, 9) / float(side)))) for _ in range(2))
    loose = chance.random() < 0.3
    share = chance.choice((0.03, 0.08))
    rows = drawn_rows(chance, min(columns, 40), min(height, 40), share) if loose else rooms(chance, columns, height)
    radius = chance.choice((0.1, 0.2, 0.2, 0.3))
    count = chance.randrange(1, 9)
    path = write_map(folder, rows, resolution=side)
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
    return FlownTeam(rows, float(side), radius, team, ground, mission, values, flown)
