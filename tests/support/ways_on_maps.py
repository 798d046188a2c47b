"""Ways of random teams on random maps, as a flight looks for them, without the simulation of the flight."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import numpy.typing as npt

from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.wall_watch import WallWatch
from robochoc.generators.maps.coverage import coverage
from robochoc.generators.maps.formation import formation
from robochoc.generators.maps.map_team import MapChoice
from robochoc.maps.ground_map import GroundMap, ground_map_json, read_ground_map
from robochoc.model.problem import Team
from tests.support.flights_on_maps import rooms
from tests.support.maps import drawn_rows, write_map
from tests.support.outcomes import outcome_of

NO_TEAM = "no team"
_RADII = (0, 0.01, 0.05, 0.1, 0.12, 0.15, 0.2, 0.2, 0.2, 0.23, 0.25, 0.3, 0.37, 0.5)
_YAWS = ("0", "0", "0", "1.5707963267948966", "0.3", "-1.1")


def drawn_team(chance: Random, seed: int, folder: Path) -> tuple[Team, GroundMap]:
    """Return a random team on a random map. Raises `ValueError` where robots do not fit on it."""
    side = chance.choice(("0.05", "0.1", "0.2", "0.25", "0.3", "0.5", "1"))
    columns, height = (max(12, min(40, int(chance.uniform(3, 8) / float(side)))) for _ in range(2))
    share = chance.choice((0.03, 0.08, 0.15, 0.25))
    rows = drawn_rows(chance, columns, height, share) if chance.random() < 0.5 else rooms(chance, columns, height)
    radius = chance.choice((*_RADII, round(chance.uniform(0, 0.6), 3)))
    origin = f"[{chance.choice((0, -1.234, 7.7))}, {chance.choice((0, 3.1))}, {chance.choice(_YAWS)}]"
    choice = MapChoice(
        map=str(write_map(folder, rows, resolution=side, origin=origin)),
        agents=chance.randrange(1, 9),
        radius=radius,
        cell=chance.choice((None, None, 0.25, 0.3, 0.5, 0.1, float(side))),
        cells=chance.choice((40, 80, 150)),
    )
    if chance.random() < 0.7:
        team, ground = coverage(choice, seed, sensing=0)
    else:
        team, ground = formation(choice, seed, shape=chance.choice(("line", "wedge", "circle")))
    return team, read_ground_map(ground_map_json(ground))


def refused_way(seed: int, folder: Path) -> str:
    """Return why a flight of a random team, first to some of its cells and then to others, is refused; or nothing."""
    chance = Random(seed)
    try:
        team, ground = drawn_team(chance, seed, folder)
        missions = [_sent(chance, team, ground) for _ in range(2)]
    except ValueError:
        return NO_TEAM
    first = missions[0]
    assert first.walls is not None
    homes = np.array([drone.home for drone in first.drones])
    watch = WallWatch(first.walls, [drone.name for drone in first.drones])
    try:
        watch.floor_plan(homes)
        starts = homes
        for mission in missions:
            goals = _goals(mission)
            watch.with_routes(watch.floor_plan(np.vstack((starts, goals))), np.arange(len(homes)), starts, goals)
            starts = goals
    except ValueError as refused:
        return str(refused)
    return ""


def _sent(chance: Random, team: Team, ground: GroundMap) -> Mission:
    """Return a mission in which each robot goes to a random value of its own, no two to the same one."""
    values: dict[str, int] = {}
    for robot in team.robots:
        left = [value for value in robot.variables[0].domain if value not in values.values()]
        if not left:
            raise ValueError("there are more robots than cells")
        values[robot.variables[0].name] = chance.choice(left)
    return mission_of(
        outcome_of(values, team=team.name),
        team,
        ground=ground,
    )


def _goals(mission: Mission) -> npt.NDArray[np.float64]:
    return np.array([mission.legs[-1].goals[number].at for number in range(len(mission.drones))])
