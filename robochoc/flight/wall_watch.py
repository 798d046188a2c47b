"""Walls during a flight: the floor plan for each leg, and the closest approach of drones to walls.

Drones keep the radius for which the team was generated between their centres and everything that is not free. If the
team was not generated, or by an earlier version, or if its places are between voxels, places may be a little nearer to
a wall; drones then keep the distance of these places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from robochoc.flight.coordination.motion import PEAK, MotionLimits
from robochoc.flight.log import SAMPLE_RATE_HZ, NearestWall
from robochoc.maps.routes.distances import Array
from robochoc.maps.routes.voxel_plan import VoxelPlan
from robochoc.maps.routes.wall_plan import WallPlan, wall_plan_of
from robochoc.maps.walls import Walls

_SPARES_M = (0.06, 0.04, 0.02, 0.0)
"""Margins beyond the radius. The largest margin with which all drones have routes is used."""
_ERROR_M = 0.04
"""The allowance for tracking errors: 3 cm in sharp turns in calm air."""
_SHARE = 0.999
"""The fraction of a place's distance from walls that routes keep, so that rounding excludes no route."""
_CLOSE_M = 1e-6
_LEAST_S = 1.0
"""The minimum time from one corner to the next."""
_LEAST_M = 0.03
"""The minimum distance of places from a wall."""
_NEAR_M = 0.3
"""Distances from walls larger than the sum of the radius and this value are not reported."""


class WallWatch:
    """Measures the distances of the drones `names` from walls. Each sample is checked once."""

    def __init__(self, walls: Walls, names: Sequence[str]) -> None:
        self._names = names
        self._radius = walls.radius
        self._speed = walls.speed
        self._plan = wall_plan_of(walls)
        self._plans: dict[float, WallPlan] = {}
        self._kept = walls.radius
        self._checked = 0
        self._nearest: tuple[float, int, int] | None = None

    def limits(self, usual: MotionLimits) -> MotionLimits:
        """Return limits for motion with the mean speed of the robots for these walls, at most the `usual` limits."""
        return replace(usual, speed=min(usual.speed, PEAK * self._speed), least_s=_LEAST_S)

    def floor_plan(self, places: Array) -> WallPlan:
        """Return the plan for routes between `places` (K, 3); K is a multiple of the number of drones, in their order.

        Raises:
            ValueError: A place is in a wall, or too near to one.
        """
        wish = self._radius + _SPARES_M[0]
        apart = self._plan.clearances(places, wish)
        worst = int(apart.argmin())
        leave = float(apart[worst])
        if leave < min(_LEAST_M, self._radius):
            where = "in a wall" if not leave else f"{leave:.2g} m from a wall"
            name = self._names[worst % len(self._names)]
            place = self._point_text(places[worst])
            raise ValueError(f"{name} is at {place}, {where} or an unknown part of the map: choose another position")
        return self._keeping(wish) if leave >= wish else self._leaving(leave)

    def floor(self, place: Array) -> float | None:
        """Return the height of the floor below a place; None if only the ground is known, or the place is in a wall."""
        return self._plan.floor(place) if isinstance(self._plan, VoxelPlan) else None

    def with_routes(self, plan: WallPlan, who: NDArray[np.intp], starts: Array, goals: Array) -> WallPlan:
        """Return `plan`, or a plan with a smaller distance from walls if only that has routes for the drones `who`.

        Raises:
            ValueError: One of these drones has no route from its start to its goal, which are given for all (N, 3).
        """
        without = [number for number in who.tolist() if plan.route(starts[number], goals[number]) is None]
        if not without:
            return plan
        if plan.keep > _SHARE * self._radius:  # doors may be only just wide enough for the radius
            wider = (self._radius + spare for spare in _SPARES_M)
            less = next((keep for keep in wider if keep < plan.keep - _CLOSE_M), self._radius)
            return self.with_routes(self._leaving(less), who, starts, goals)
        ends = f"from {self._point_text(starts[without[0]])} to {self._point_text(goals[without[0]])}"
        has_heights = isinstance(self._plan, VoxelPlan)
        hint = "generate the team with a larger radius" if has_heights else "generate the team again"
        raise ValueError(
            f"{self._names[without[0]]} has no route around the walls {ends} that keeps its radius of"
            f" {self._radius:g} m: {hint}"
        )

    def nearest(self, positions: Array, failures: Sequence[tuple[int, str, float]]) -> NearestWall | None:
        """Return the closest approach in all `positions` (T, N, 3) so far, without the positions of failed drones."""
        new = positions[self._checked :]
        if len(new):
            counts = np.ones(new.shape[:2], dtype=np.bool_)
            for drone, _, at_s in failures:
                counts[max(round(at_s * SAMPLE_RATE_HZ) - self._checked, 0) :, drone] = False
            apart = self._plan.clearances(new[counts], self._radius + _NEAR_M)
            if len(apart) and apart.min() < min(self._radius + _NEAR_M, self._nearest[0] if self._nearest else np.inf):
                worst = int(apart.argmin())
                sample, drone = np.argwhere(counts)[worst].tolist()
                self._nearest = (float(apart[worst]), sample + self._checked, drone)
            self._checked = len(positions)
        if self._nearest is None:
            return None
        distance, sample, drone = self._nearest
        return NearestWall(distance, drone, sample / SAMPLE_RATE_HZ, self._kept)

    def _point_text(self, place: Array) -> str:
        """Return a place as text, with its height only on a three-dimensional map."""
        parts = place if isinstance(self._plan, VoxelPlan) else place[:2]
        return f"({', '.join(f'{part:.2f}' for part in parts)})"

    def _leaving(self, leave: float) -> WallPlan:
        """Return the plan for places, or doors, that allow only a smaller distance."""
        self._kept = min(self._kept, max(leave - _ERROR_M, leave / 2))
        return self._keeping(_SHARE * leave)

    def _keeping(self, keep: float) -> WallPlan:
        if keep not in self._plans:
            self._plans[keep] = self._plan.keeping(keep)
        return self._plans[keep]
