"""Encounters with obstacles that the planner does not know."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.trajectory import Trajectory

_LOOK_S = 0.05
"""The step at which trajectories are sampled: at 2 m/s a drone flies 0.1 m meanwhile."""
_LOOK_M = 0.1


class ObstacleEncounter(NamedTuple):
    """A drone's trajectory is nearer than `keep` to an obstacle, last at second `until` of the trajectory."""

    obstacle: int
    drone: int
    until: float
    keep: float


def encounters(trajectory: Trajectory, obstacles: dict[int, Array], keep: float) -> list[ObstacleEncounter]:
    """Return all encounters with `obstacles`, which are given by their numbers."""
    if not obstacles:
        return []
    times = np.append(np.arange(0.0, trajectory.plan.duration_s, _LOOK_S), trajectory.plan.duration_s)
    places = np.stack([trajectory.plan.at(float(s)).position for s in times])
    found = []
    for number, obstacle in obstacles.items():
        near = np.square(places - obstacle).sum(2) < (keep + _LOOK_M) ** 2
        for place in np.flatnonzero(near.any(0)).tolist():
            until = float(times[np.flatnonzero(near[:, place])[-1]])
            found.append(ObstacleEncounter(number, int(trajectory.who[place]), until, keep))
    return found
