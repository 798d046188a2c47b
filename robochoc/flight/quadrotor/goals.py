"""The goals of a leg: the given points, or nearby free points if an obstacle is in the way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from robochoc.flight.layout import Point
from robochoc.flight.mission import Goal
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.conditions import DISTANCE_MIN_M
from robochoc.flight.quadrotor.free_points import free_point, nearest_distances, nearest_two
from robochoc.flight.quadrotor.rigid_bodies import Mask
from robochoc.maps.routes.distances import SLACK_M, squashed
from robochoc.maps.routes.wall_plan import WallPlan
from robochoc.system.lazy_dataclass import dataclass

MARGIN_M = 0.1
"""The margin of routes beyond the distance. Tracking errors use 1 cm of it in calm air, and 6 cm when a drone takes off
into a wind of 5 m/s (`tests/unit/flight/test_rigid_bodies.py`). Errors of two drones may add up.
"""
_SHARE = 0.999
"""The fraction of the distance between starts or goals that is planned, so that rounding excludes no route."""
_STAGGER_S = 2.0
"""The longest time between the starts of the first and the last row."""
_ROW_S = 0.25
_LOW_M = 1e-6


@dataclass(frozen=True)
class Hazards:
    """Points (M, 3) for drones to keep away from, and the distances to keep (M,)."""

    points: Array
    radii: Array

    def hits(self, place: Array) -> bool:
        """Return whether `place` is too near to one of the points."""
        return bool((np.sqrt(np.square(self.points - place).sum(1)) < self.radii).any())


class LegGoals:
    """The destinations `places` (N, 3): the `goals`, or the `starts` of drones without a goal, except failed drones.

    Heights are divided by `downwash` for all distances.

    Raises:
        ValueError: Two goals are nearer to each other than `distance`.
    """

    def __init__(
        self,
        names: Sequence[str],
        goals: Mapping[int, Goal],
        starts: Array,
        failed: Mask,
        distance: float,
        downwash: float = 1.0,
    ) -> None:
        self._downwash = downwash
        self.who = np.flatnonzero(~failed)
        self.goals = {number: goal for number, goal in goals.items() if not failed[number]}
        self.places = np.array(starts)
        for number, goal in self.goals.items():
            self.places[number] = goal.at
        self._distance = distance
        check_separation("goals", names, {number: goal.at for number, goal in self.goals.items()}, distance, downwash)

    def planned_distance(self, starts: Array, hazards: Hazards | None = None) -> float:
        """Return the distance for routes from `starts` (N, 3), including the margin as far as the places allow it."""
        leave = min(nearest_two(self._flat(starts[self.who])), nearest_two(self._flat(self.places[self.who])))
        if hazards is not None:
            apart = nearest_distances(self._flat(hazards.points), self._ends(starts))
            leave = min(leave, float(apart[apart >= self._distance].min(initial=np.inf)))
        return max(self._distance, min(self._distance + MARGIN_M, _SHARE * leave))

    def give_way(
        self, hazards: Hazards, preferred: Array, ground: float, floor_plan: WallPlan | None = None
    ) -> list[tuple[int, str]]:
        """Replace places that are not free; return the affected drones, each with a description of the change.

        Goals are moved away from hazards. Drones that stay in place are moved away from the goals of others. Each moved
        place becomes the free point nearest to the drone's `preferred` point (N, 3), without a wall of the `floor_plan`
        in between.

        Raises:
            ValueError: Walls leave no free point.
        """
        moved = []
        going = np.array([number for number in self.who.tolist() if number in self.goals], dtype=np.intp)
        for number in self.who.tolist():
            goal, place = self.goals.get(number), self.places[number].copy()
            others = self.places[self.who[self.who != number]]
            if goal is not None and hazards.hits(place):
                why = "something is there"
            elif (
                goal is None
                and nearest_distances(self._flat(place[None]), self._flat(self.places[going]))[0]
                < needed_distance(self._distance) - SLACK_M
            ):
                why = "another drone flies to its place"
            else:
                continue
            low = place[2] <= ground + _LOW_M
            radii = np.full(len(others), self._distance + MARGIN_M)
            taken, radii = self._flat(np.vstack((others, hazards.points))), np.concatenate((radii, hazards.radii))
            wish = self._flat(preferred[number])
            spot = free_point(wish, taken, radii, ground / self._downwash, low=bool(low), floor_plan=floor_plan)
            self.places[number] = squashed(spot, 1 / self._downwash)
            off = float(np.sqrt(np.square(self.places[number] - place).sum()))
            moved.append((number, f"{'lands' if low else 'hovers'} {off:.2f} m beside its place: {why}"))
        return moved

    def standing(self, hazards: Hazards, starts: Array, planned: float) -> Array:
        """Return the hazards that routes can avoid because no drone starts or ends too near to them."""
        return np.asarray(hazards.points[nearest_distances(self._flat(hazards.points), self._ends(starts)) >= planned])

    def _ends(self, starts: Array) -> Array:
        return self._flat(np.vstack((starts[self.who], self.places[self.who])))

    def _flat(self, points: Array) -> Array:
        return squashed(points, self._downwash)


def needed_distance(distance: float) -> float:
    """Return the distance between places with which drones keep `distance` despite tracking errors."""
    return distance + min(MARGIN_M, distance / 4)


def check_separation(
    what: str, names: Sequence[str], places: Mapping[int, Point], distance: float, downwash: float = 1.0
) -> None:
    """Raise `ValueError` if two of `places`, given by drone number, are too near for drones to keep `distance`."""
    least = needed_distance(distance) - SLACK_M
    if nearest_two(squashed(np.array([*places.values()]).reshape(-1, 3), downwash)) >= least:
        return
    places = {number: (x, y, z / downwash) for number, (x, y, z) in places.items()}
    heights = f" with heights divided by the downwash of {downwash:g}" * (downwash != 1)
    for (first, one), (second, other) in combinations(places.items(), 2):
        gap = math.dist(one, other)
        if gap < least:
            apart = f"{gap:.2f}" if gap >= DISTANCE_MIN_M else f"{gap:.1g}"
            asked = f"the minimum is {distance:g} m" + (
                f", which requires {needed_distance(distance):g} m" if gap >= distance - SLACK_M else ""
            )
            step = "use a smaller distance, or a larger scale" if distance > DISTANCE_MIN_M else "use a larger scale"
            if not gap and what == "goals":
                step = "add a constraint that keeps the drones apart"
            raise ValueError(
                f"the {what} of {names[first]} and {names[second]} are {apart} m apart{heights}, and {asked}: {step}"
            )


def start_delays(goals: Mapping[int, Goal], homes: Array) -> Array:
    """Return the drones' delays (N,), in seconds: landing drones start first, others row by row (x of the homes)."""
    lands = np.array([number in goals and goals[number].lands for number in range(len(homes))])
    _, rows = np.unique(homes[:, 0], return_inverse=True)
    turns = np.where(lands, 0, rows.reshape(-1) + bool(lands.any()))
    return np.asarray(turns * min(_ROW_S, _STAGGER_S / max(int(turns.max()), 1)))
