"""What a flight is made of: wind, the nearest two, attitudes, free spots, leg_goals, the clock."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robochoc.flight.coordination.motion import MotionLimits
from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.log import ClosestApproach
from robochoc.flight.mission import Goal
from robochoc.flight.quadrotor.airframe import Array
from robochoc.flight.quadrotor.free_points import free_point, nearest_distances
from robochoc.flight.quadrotor.goals import Hazards, LegGoals, start_delays
from robochoc.flight.quadrotor.separation import SeparationMonitor
from robochoc.flight.quadrotor.simulation import DT, Wind, quaternions
from robochoc.flight.quadrotor.trajectory import STOP_S, Trajectory
from tests.support.examples import examples


def test_gusts_have_the_spread_that_is_asked_for_and_come_again_from_their_seed() -> None:
    def blow(seed: int, count: int) -> Array:
        wind = Wind((5.0, 0.0, 0.0), 1.5, seed, 30, 0.5)
        return np.array([wind.air() for _ in range(count)])

    air = blow(1, 600)
    assert air.mean((0, 2)) == pytest.approx([5, 0, 0], abs=0.1)
    assert air.std() == pytest.approx(math.sqrt(1.5**2 + 25 * 2 / 9), rel=0.05)
    assert np.array_equal(air[:9], blow(1, 9))
    assert not np.array_equal(air[:9], blow(2, 9))


@examples(20)
@given(st.integers(0, 2**32 - 1), st.integers(2, 12), st.floats(0.01, 0.4))
def test_no_pair_is_ever_nearer_than_the_watch_says(seed: int, number: int, pace: float) -> None:
    chance = np.random.default_rng(seed)
    places = chance.uniform(-2, 2, (3, number))
    monitor = SeparationMonitor(number)
    failed = np.zeros(number, dtype=np.bool_)
    best = [math.inf, math.inf]
    first, second = np.triu_indices(number, 1)
    for step in range(40):
        if step == 20:
            failed[chance.integers(number)] = True
            monitor.exclude(failed)
        monitor.observe(places, step)
        apart = np.sqrt(np.square(places[:, first] - places[:, second]).sum(0))
        falls = failed[first] | failed[second]
        best = [min(best[0], apart[~falls].min(initial=math.inf)), min(best[1], apart[falls].min(initial=math.inf))]
        for found, expected in zip((monitor.nearest, monitor.nearest_fallen), best, strict=True):
            assert (found.distance_m if found else math.inf) == expected
        places += chance.uniform(-pace, pace, (3, number))


def test_the_watch_says_who_and_when() -> None:
    monitor = SeparationMonitor(3)
    for step, x in enumerate((4.0, 2.5, 1.5, 2.0)):
        monitor.observe(np.array([[0, 9, x], [0, 0, 0], [0, 0, 0]]), step * 1.0)
    assert monitor.nearest == ClosestApproach(1.5, 0, 2, 2.0)
    lone = SeparationMonitor(1)
    lone.observe(np.zeros((3, 1)), 0.0)
    assert lone.nearest is None


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: math.hypot(*q) > 0.1))
def test_attitudes_turn_as_the_axes_do(components: list[float]) -> None:
    x, y, z, w = (component / math.hypot(*components) for component in components)
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)],
            [2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)],
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    found = quaternions(axes)
    assert abs(float(found @ [x, y, z, w])) == pytest.approx(1, abs=1e-12)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 30), st.booleans())
def test_a_free_spot_is_free(seed: int, count: int, low: bool) -> None:  # noqa: FBT001 - drawn
    taken = np.random.default_rng(seed).uniform(-1, 1, (count, 3))
    wish = np.array([0.0, 0.0, 0.0 if low else 1.0])
    spot = free_point(wish, taken, np.full(count, 0.6), 0.0, low=low)
    assert nearest_distances(spot[None], taken)[0] >= 0.6
    assert spot[2] == 0 if low else spot[2] >= 0.6
    if not count:
        assert spot.tolist() == wish.tolist()


@pytest.mark.parametrize("low", [True, False])
def test_where_all_is_full_the_free_spot_is_beyond(low: bool) -> None:  # noqa: FBT001 - a parameter
    steps = np.arange(-1, 1.1, 0.5)
    taken = np.array([[x, y, z] for x in steps for y in steps for z in ([0.0] if low else np.arange(0, 4.1, 0.5))])
    spot = free_point(np.array([0.0, 0.0, 0.0 if low else 2.0]), taken, np.full(len(taken), 0.6), 0.0, low=low)
    assert nearest_distances(spot[None], taken)[0] >= 0.6
    assert np.abs(spot[:2]).max() > 1 or spot[2] > 4
    assert spot[2] == 0 or not low


def test_goals_give_way_to_what_lies_there_and_who_stays_gives_way_to_goals() -> None:
    names = ["a", "b", "c"]
    starts = np.array([[0, 0, 2.0], [3, 0, 0], [3, 0, 4]])
    goals = {0: Goal((3.0, 0.0, 3.9)), 1: Goal((0.0, 0.0, 0.0), lands=True)}
    leg_goals = LegGoals(names, goals, starts, np.zeros(3, dtype=np.bool_), 0.5)
    hazards = Hazards(np.array([[0.1, 0, 0]]), np.array([0.5]))
    told = leg_goals.give_way(hazards, leg_goals.places.copy(), 0.0)
    assert [number for number, _ in told] == [1, 2]
    assert told[0][1].startswith("lands ")
    assert leg_goals.places[1, 2] == 0
    assert not hazards.hits(leg_goals.places[1])
    assert np.linalg.norm(leg_goals.places[2] - leg_goals.places[0]) >= 0.5
    assert leg_goals.planned_distance(starts) == pytest.approx(0.6)
    assert (
        leg_goals.standing(hazards, starts, 0.6).shape == (0, 3)
        or nearest_distances(hazards.points, leg_goals.places)[0] >= 0.6
    )


def test_who_lands_begins_first_and_then_row_by_row() -> None:
    homes = np.array([[x, y, 0.0] for x in range(20) for y in range(2)])
    delays = start_delays({5: Goal((0.0, 0.0, 0.0), lands=True)}, homes)
    assert delays[5] == 0
    assert delays.max() == pytest.approx(2)
    assert (np.diff(np.delete(delays, 5)) >= 0).all()
    assert delays[0] == delays[1] > 0
    assert start_delays({}, homes[:2]).tolist() == [0, 0]


def test_the_clock_stops_smoothly_and_within_limits() -> None:
    setpoints = np.zeros((9, 1))
    way = plan_routes(np.array([[0.0, 0, 1]]), np.array([[8.0, 0, 1]]), distance=0.5)
    trajectory = Trajectory(way, np.array([0]), setpoints)
    rows = []
    for step in range(round(4 / DT)):
        if step * DT >= 2.5:
            trajectory.stop()
        rows.append(trajectory.update_setpoints()[:, 0].copy())
        trajectory.advance(DT)
    x, speed, push = (np.array(rows)[:, row] for row in (0, 3, 6))
    assert np.abs(np.gradient(x, DT) - speed)[2:-2].max() < 0.02
    assert np.abs(np.gradient(speed, DT) - push)[2:-2].max() < 0.1
    assert np.abs(push).max() < 1.5 / STOP_S * MotionLimits().speed + MotionLimits().acceleration
    assert trajectory.has_ended
    assert not speed[-1]
    stopping = x[-1] - x[round(2.5 / DT)]
    assert 0.5 < stopping <= MotionLimits().speed * STOP_S / 2 + 0.02
