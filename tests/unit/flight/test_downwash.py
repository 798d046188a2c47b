"""Drones keep more distance above each other than beside each other: the planner, and the check at every step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from robochoc.flight.coordination.motion import MotionLimits, RoutePlan
from robochoc.flight.coordination.spacing import TooCloseError
from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.flight import Flight, fly
from robochoc.flight.layout import Point
from robochoc.flight.mission import Goal
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.flight.quadrotor.separation import SeparationMonitor
from tests.support.cases import looped
from tests.support.flights import planar

LIMITS = MotionLimits()


def apart(places: Array, downwash: float) -> float:
    """The least distance of two of `places` (..., N, 3), heights divided by `downwash`: by hand, pair by pair."""
    flat = np.array(places)
    flat[..., 2] /= downwash
    pairs = [(one, other) for one in range(flat.shape[-2]) for other in range(one)]
    return float(min(np.sqrt(np.square(flat[..., one, :] - flat[..., other, :]).sum(-1)).min() for one, other in pairs))


def sampled(plan: RoutePlan) -> Array:
    return np.array([plan.at(s).position for s in np.arange(0, plan.duration_s + 0.01, 0.01).tolist()])


def swapped(number: int, seed: int, downwash: float) -> tuple[Array, Array]:
    """Random places, far enough from each other, and the same in another order, moved a little."""
    chance = np.random.default_rng(seed)
    starts: list[Point] = []
    while len(starts) < number:
        x, y, z = (chance.random(3) * [4, 4, 4 * downwash] + [0, 0, 1]).tolist()
        if len(starts) == 0 or apart(np.array([*starts, (x, y, z)]), downwash) > 0.7:
            starts.append((x, y, z))
    return np.array(starts), np.roll(np.array(starts), 1, axis=0)


@looped("seed", range(4))
@looped("downwash", [1.5, 3.0])
def test_routes_keep_the_ellipsoid_at_all_times(downwash: float, seed: int) -> None:
    starts, goals = swapped(6, seed, downwash)
    plan = plan_routes(starts, goals, distance=0.6, downwash=downwash)
    places = sampled(plan)
    assert apart(places, downwash) >= 0.6 - 1e-6
    assert plan.at(0).position == pytest.approx(starts)
    assert plan.at(plan.duration_s).position == pytest.approx(goals)


def test_without_it_drones_are_balls() -> None:
    starts, goals = swapped(5, 1, 1.0)
    plain, same = plan_routes(starts, goals, distance=0.6), plan_routes(starts, goals, distance=0.6, downwash=1.0)
    assert np.array_equal(sampled(plain), sampled(same))


def test_limits_are_of_the_real_motion() -> None:
    """Up 6 m: no faster than a drone without downwash, and no slower."""
    start, goal = np.array([[0.0, 0, 1]]), np.array([[0.0, 0, 7]])
    plain = plan_routes(start, goal, distance=0.5, limits=LIMITS)
    tall = plan_routes(start, goal, distance=0.5, limits=LIMITS, downwash=4.0)
    assert tall.duration_s == pytest.approx(plain.duration_s)
    assert np.abs(np.diff(sampled(tall)[:, 0, 2])).max() <= LIMITS.speed * 0.01 + 1e-9


def test_places_right_above_each_other_need_so_many_distances() -> None:
    starts, goals = np.array([[0.0, 0, 0], [3, 0, 0]]), np.array([[0.0, 0, 2], [0, 0, 3.2]])
    plan_routes(starts, goals, distance=0.5, downwash=2.0)
    with pytest.raises(TooCloseError):
        plan_routes(starts, goals, distance=0.5, downwash=3.0)


def test_the_check_at_every_step_divides_heights() -> None:
    monitor = SeparationMonitor(2, 2.0)
    monitor.observe(np.array([[0.0, 0.3], [0, 0], [0, 0.8]]), 1.0)
    assert monitor.nearest is not None
    assert monitor.nearest.distance_m == pytest.approx(0.5)


def test_a_flight_keeps_the_ellipsoid() -> None:
    mission = planar(4, "Robot2.2")
    flown = fly(mission, FlightConditions(distance=0.3, downwash=2.5))
    assert flown.nearest is not None
    assert flown.nearest.distance_m >= 0.3
    assert flown.nearest.distance_m == pytest.approx(apart(flown.positions, 2.5), abs=0.01)
    assert flown.errors_m.max() < 0.01


@pytest.mark.parametrize(("downwash", "over"), [(1.0, True), (2.0, False)])
def test_a_drone_flies_right_over_another_one_only_without_it(downwash: float, *, over: bool) -> None:
    homes = np.array([[0.0, 0, 0], [1, 0, 0]])
    flight = Flight(["a", "b"], homes, FlightConditions(distance=0.5, downwash=downwash))
    flight.fly("up", {0: Goal((0.0, 0.0, 2.7)), 1: Goal((1.0, 0.0, 2.0))})
    flight.fly("over", {0: Goal((2.0, 0.0, 2.7))})
    flown = flight.log()
    assert flown.nearest is not None
    assert flown.nearest.distance_m >= 0.5
    assert (apart(flown.positions, 2.0) < 0.5) == over


def test_goals_too_near_above_each_other_are_refused() -> None:
    homes = np.array([[0.0, 0, 0], [2, 0, 0]])
    flight = Flight(["a", "b"], homes, FlightConditions(distance=0.5, downwash=3.0))
    with pytest.raises(ValueError, match=r"0\.4 m apart with heights divided by the downwash of 3|0\.40 m apart with"):
        flight.fly("", {0: Goal((0.0, 0.0, 2.0)), 1: Goal((0.0, 0.0, 3.2))})


@looped("downwash", [0.5, float("nan"), float("inf"), 101])
def test_a_factor_makes_a_drone_taller_not_flatter(downwash: float) -> None:
    with pytest.raises(ValueError, match="it must be a number from 1 to 100"):
        FlightConditions(downwash=downwash)


def test_nothing_else_may_be_in_the_way() -> None:
    tall = FlightConditions(downwash=2.0)
    with pytest.raises(ValueError, match="downwash cannot be combined with motor failures or obstacles"):
        replace(tall, obstacles=((1.0, 1.0, 1.0),))
    with pytest.raises(ValueError, match="downwash cannot be combined with motor failures or obstacles"):
        replace(tall, failures=(MotorFailure("a", 1.0),))
    flight = Flight(["a"], np.zeros((1, 3)), tall)
    with pytest.raises(ValueError, match="downwash cannot be combined with obstacles"):
        flight.fly("", {0: Goal((0.0, 0.0, 2.0))}, blocks=[(1.0, 1.0, 1.0)])
