"""Flights of random teams on random maps, and what is asked of their logs by other means than the planner's."""

from __future__ import annotations

from collections.abc import Callable
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
from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.generators.maps.patrol import patrol
from robochoc.maps.ground_map import GroundMap, ground_map_json, read_ground_map
from robochoc.model.problem import Team
from tests.support.outcomes import outcome_of

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class FlownTeam:
    """A team that was flown on a map, and how."""

    gaps: Callable[[Array], Array]
    """Returns the distances (K,) of places (K, 3) from all that is not free, as the map was drawn."""
    radius: float
    team: Team
    ground: GroundMap
    mission: Mission
    flown: FlightLog

    def faults(self) -> list[str]:
        """Return what is wrong with the flight; nothing if all is well."""
        flown, told = self.flown, []
        apart = self.gaps(flown.positions.reshape(-1, 3))
        set_m = flown.nearest_wall.set_m if flown.nearest_wall else self.radius
        ends = np.array([goal.at for goal in self.mission.legs[-1].goals.values()])
        homes = np.array([drone.home for drone in self.mission.drones])
        leave = float(self.gaps(np.vstack((ends, homes))).min())
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


def flown_on(
    path: Path, seed: int, chance: Random, count: int, radius: float, gaps: Callable[[Array], Array]
) -> FlownTeam | str:
    """Return a random team on a map, each robot sent to a value of its own; or why it was not flown."""
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
    mission = mission_of(
        outcome_of(values, team=team.name),
        team,
        ground=ground,
    )
    conditions = FlightConditions(distance=chance.choice((None, None, 0.3)), downwash=chance.choice((1, 1, 1, 2)))
    try:
        flown = fly(mission, conditions)
    except ValueError as refused:
        return str(refused)
    return FlownTeam(gaps, radius, team, ground, mission, flown)
