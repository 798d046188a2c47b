"""Deconflicted flights: the distance is kept at all times, everybody arrives, and nobody does more than is needed."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.flight.coordination.motion import Motion, MotionLimits, RoutePlan
from robochoc.flight.coordination.move_order import NoRouteError
from robochoc.flight.coordination.paths import OutdoorSpace
from robochoc.flight.coordination.spacing import TooCloseError
from robochoc.flight.coordination.timetable import plan_routes
from robochoc.maps.routes.distances import Array, norms, segment_distances
from tests.support.cases import looped
from tests.support.examples import examples

HZ = 100
LIMITS = MotionLimits()
GRID = np.array([(x, y, 0.0) for x in range(7) for y in range(7)])
NOBODY = np.empty((0, 3))


def motions(planned: RoutePlan) -> Motion:
    """Everybody's motion at 100 Hz: arrays (T, N, 3)."""
    times = np.append(np.arange(0, planned.duration_s, 1 / HZ), planned.duration_s)
    found = [planned.at(s) for s in times.tolist()]
    return Motion(
        np.array([one.position for one in found]),
        np.array([one.velocity for one in found]),
        np.array([one.acceleration for one in found]),
    )


def nearest(positions: Array, standing: Array = NOBODY) -> float:
    """The least distance of two drones, or of a drone and a standing point, at any of the times."""
    first, second = np.triu_indices(positions.shape[1], 1)
    pairs = norms(positions[:, first] - positions[:, second])
    return float(min(pairs.min(initial=np.inf), norms(positions[:, :, None] - standing).min(initial=np.inf)))


def fly(
    starts: Array,
    goals: Array,
    distance: float,
    standing: Array = NOBODY,
    waits: Array | None = None,
    limits: MotionLimits = LIMITS,
) -> Motion:
    """Plan, and check all that holds of any plan."""
    planned = plan_routes(starts, goals, distance=distance, standing=standing, delays=waits, limits=limits)
    flown = motions(planned)
    assert nearest(flown.position, standing) >= distance - 1e-9
    assert (flown.position[0] == starts).all()
    assert (flown.position[-1] == goals).all()
    assert not flown.velocity[[0, -1]].any()
    assert not flown.acceleration[-1].any()
    assert norms(flown.velocity).max(initial=0) <= limits.speed + 1e-9
    assert norms(flown.acceleration).max(initial=0) <= limits.acceleration + 1e-9
    assert norms(np.diff(flown.position, axis=0)).max(initial=0) <= limits.speed / HZ + 1e-9
    assert norms(np.diff(flown.velocity, axis=0)).max(initial=0) <= limits.acceleration / HZ + 1e-9
    assert flown.position[..., 2].min(initial=0) >= -1e-12
    if waits is not None:
        for drone, wait in enumerate(waits):
            assert (planned.at(wait).position[drone] == starts[drone]).all()
    return flown


def apart(chance: np.random.Generator, count: int, taken: Array, distance: float) -> Array:
    """So many random points, a distance or more from each other and from those that are `taken`."""
    points = taken
    while len(points) < len(taken) + count:
        point = chance.uniform((0, 0, 0), (3, 3, 3))
        if (norms(points - point) >= distance).all():
            points = np.vstack((points, point))
    return points[len(taken) :]


@st.composite
def cells(draw: st.DrawFn) -> tuple[Array, Array, Array]:
    """Starts, goals and standing points in a grid: stacks, swaps and cycles come by themselves, being so few cells."""
    size = draw(st.integers(1, 3)), draw(st.integers(1, 3)), draw(st.integers(2, 3))
    places = st.permutations([*product(*map(range, size))])
    starts, goals = draw(places), draw(places)
    count = draw(st.integers(1, min(7, len(starts) - 1)))
    standing = [cell for cell in goals[count:] if cell not in starts[:count]][: draw(st.integers(0, 2))]
    return np.array(starts[:count], float), np.array(goals[:count], float), np.array(standing, float).reshape(-1, 3)


@examples(15, 250)
@given(cells(), st.sampled_from((0.3, 0.5, 0.8, 1.0)), st.lists(st.sampled_from((0.0, 0.33, 2.0)), min_size=7))
def test_in_a_grid_all_keep_their_distance(
    places: tuple[Array, Array, Array], distance: float, waits: list[float]
) -> None:
    starts, goals, standing = places
    fly(starts, goals, distance, standing, np.array(waits[: len(starts)]))


@examples(15, 250)
@given(st.integers(0, 10**6), st.integers(1, 9), st.integers(0, 3), st.sampled_from((0.4, 0.7)))
def test_anywhere_all_keep_their_distance(seed: int, count: int, standing: int, distance: float) -> None:
    chance = np.random.default_rng(seed)
    obstacles = apart(chance, standing, NOBODY, distance)
    starts = apart(chance, count, obstacles, distance)
    limits = MotionLimits(speed=float(chance.uniform(0.5, 4)), acceleration=float(chance.uniform(0.5, 8)))
    fly(starts, apart(chance, count, obstacles, distance), distance, obstacles, limits=limits)


def test_rows_that_rise_go_straight_up_and_only_wait_as_they_are_told() -> None:
    levels = np.array([(3 * x + 5 * y) % 7 + 1 for x, y, _ in GRID])
    waits = GRID[:, 0] * 0.4
    goals = GRID + np.column_stack((np.zeros((49, 2)), levels))
    flown = fly(GRID, goals, 0.5, waits=waits)
    assert (flown.position[..., :2] == GRID[:, :2]).all()
    ends = waits + LIMITS.durations(levels.astype(float))
    assert plan_routes(GRID, goals, distance=0.5, delays=waits).duration_s == pytest.approx(ends.max(), abs=0.05)


def test_a_team_changes_its_columns_and_levels() -> None:
    chance = np.random.default_rng(8)
    places = GRID + np.column_stack((np.zeros((49, 2)), chance.integers(1, 8, 49)))
    goals = places[chance.permutation(49)]
    flown = fly(places, goals, 0.5)
    longest = LIMITS.durations(norms(goals - places)).max()
    assert len(flown.position) / HZ < 2.5 * longest


@looped("distance", [0.5, 1.0])
@looped("count", [2, 3, 4])
def test_drones_of_one_column_change_places(count: int, distance: float) -> None:
    column = np.array([(0.0, 0.0, 1.0 + level) for level in range(count)])
    fly(column, column[::-1].copy(), distance)
    fly(column, np.roll(column, 1, axis=0), distance)


def test_sixteen_on_the_ground_change_places() -> None:
    square = np.array([(x, y, 0.0) for x in range(4) for y in range(4)])
    flown = fly(square, square[::-1].copy(), 0.5)
    level = (norms(flown.velocity[..., :2]) > 1e-9) & (np.abs(flown.velocity[..., 2]) < 1e-9)
    assert flown.position[level, 2].min() >= 0.125


def test_who_stays_does_not_move_and_who_passes_goes_over_it() -> None:
    starts = np.array([(0.0, 0.0, 1.0), (2.0, 0.0, 1.0)])
    flown = fly(starts, np.array([(4.0, 0.0, 1.0), (2.0, 0.0, 1.0)]), 0.5)
    assert (flown.position[:, 1] == starts[1]).all()
    assert np.abs(flown.position[:, 0, 2] - 1).max() == pytest.approx(0.5)


def test_it_lands_between_those_that_stand_by_the_lane_just_above_them() -> None:
    start, goal = (4.0, 6.0, 1.0), (4.0, -2.0, 0.0)
    standing = np.array([(x, y, 0.0) for x in range(9) for y in range(-2, 7) if (x, y) != goal[:2]])
    flown = fly(np.array([start]), np.array([goal]), 0.5, standing)
    across = norms(flown.velocity[:, 0, :2]) > 0
    assert across.any()
    assert flown.position[across, 0, 2] == pytest.approx(0.5)


def test_an_obstacle_above_the_start_or_the_goal_is_flown_round() -> None:
    obstacles = np.array([(0.0, 0.0, 1.0), (3.0, 0.0, 1.0)])
    flown = fly(np.array([(0.0, 0.0, 0.0)]), np.array([(3.0, 0.0, 0.0)]), 0.7, obstacles)
    assert flown.position[..., 2].max() < 2
    flown = fly(np.array([(0.0, 0.0, 0.0)]), np.array([(0.0, 0.0, 2.0)]), 0.7, obstacles)
    assert norms(flown.position[:, 0, :2]).max() == pytest.approx(0.7)


def test_where_nobody_fits_through_even_those_that_stay_make_way() -> None:
    cube = np.array([*product(range(3), repeat=3)], float)
    goals = cube.copy()
    goals[[13, 4]] = cube[[4, 13]]
    fly(cube, goals, 0.95)


def test_what_an_obstacle_covers_is_filled_before_it_is_closed_in() -> None:
    box = np.array([*product(range(3), range(4), range(2))], float)
    obstacle = (box == (1, 1, 1)).all(axis=1)
    places = box[~obstacle]
    fly(places, np.roll(places, 5, axis=0), 0.8, box[obstacle])


def test_what_would_make_no_distance_possible_is_refused() -> None:
    places = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0)])
    goals = places + np.array((0.0, 0.0, 2.0))
    goals[2] = (1.0, 0.0, 2.3)
    with pytest.raises(TooCloseError, match=r"goals of drones 1 and 2 are only 0\.3 m apart") as found:
        plan_routes(places, goals, distance=0.5)
    assert (found.value.first, found.value.second, found.value.where) == (1, 2, "goal")
    assert found.value.distance_m == pytest.approx(0.3)
    with pytest.raises(TooCloseError) as found:
        plan_routes(places, places, distance=0.5, standing=np.array([(0.0, 9.0, 0.0), (2.0, 0.4, 0.0)]))
    assert (found.value.first, found.value.second, found.value.where) == (2, 4, "start")
    assert plan_routes(places, places, distance=1.0).duration_s == 0


def test_who_is_walled_in_finds_no_way() -> None:
    walls = np.array([side for side in product((-1, 0, 1), repeat=3) if any(side)], float)
    walls = walls / norms(walls)[:, None] * 0.6 + np.array((0, 0, 5))
    starts = np.array([(0.0, 0.0, 5.0), (5.0, 5.0, 5.0)])
    with pytest.raises(NoRouteError, match="no way was found for drones 0") as found:
        plan_routes(starts, starts + 4, distance=0.5, standing=walls)
    assert found.value.drones == (0,)


def test_a_plan_is_the_same_each_time_and_at_any_time() -> None:
    chance = np.random.default_rng(3)
    starts = apart(chance, 9, NOBODY, 0.6)
    planned = plan_routes(starts, starts[::-1].copy(), distance=0.6)
    again = plan_routes(starts, starts[::-1].copy(), distance=0.6)
    times = chance.permutation(np.linspace(-1, planned.duration_s + 1, 300)).tolist()
    assert all((planned.at(s).position == again.at(s).position).all() for s in sorted(times))
    assert all((planned.at(s).velocity == again.at(s).velocity).all() for s in times)
    assert (planned.at(-1).position == starts).all()
    assert (planned.at(1e9).position == starts[::-1]).all()


def test_velocity_and_acceleration_are_those_of_the_positions() -> None:
    flown = fly(np.array([(0.0, 0.0, 0.0), (2.0, 0.0, 0.0)]), np.array([(4.0, 0.0, 0.0), (2.0, 0.0, 3.0)]), 0.5)
    velocity = (flown.position[2:] - flown.position[:-2]) * HZ / 2
    acceleration = (flown.velocity[2:] - flown.velocity[:-2]) * HZ / 2
    # The last sample is at the end of the plan, not a hundredth after the one before it.
    assert velocity[:-1] == pytest.approx(flown.velocity[1:-2], abs=2e-3)
    assert acceleration[:-1] == pytest.approx(flown.acceleration[1:-2], abs=0.15)


def test_a_team_of_nobody_flies_nowhere() -> None:
    planned = plan_routes(NOBODY, NOBODY, distance=1.0)
    assert planned.duration_s == 0
    assert planned.at(0).position.shape == (0, 3)


@looped("wrong", [{"distance": 0.0}, {"distance": np.nan}, {"delays": np.zeros(2)}, {"ground": np.inf}])
def test_arguments_without_sense_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"must be finite|must have equal lengths"):
        plan_routes(GRID[:1], GRID[:1], **{"distance": 1.0, **wrong})  # type: ignore[arg-type]


def test_points_and_limits_without_sense_are_refused() -> None:
    with pytest.raises(ValueError, match=r"goals has the shape .*; it must have rows of three finite numbers"):
        plan_routes(GRID[:1], GRID[:1] * np.nan, distance=1)
    with pytest.raises(ValueError, match="it must have rows of three finite numbers"):
        plan_routes(GRID[0], GRID[0], distance=1)
    with pytest.raises(ValueError, match="limits must be positive numbers"):
        MotionLimits(speed=0)


@given(st.integers(0, 10**6))
def test_the_gap_between_a_line_and_a_point_is_the_least_distance_on_it(seed: int) -> None:
    chance = np.random.default_rng(seed)
    origins, ends, points = chance.uniform(-2, 2, (3, 4, 3))
    ends[0] = origins[0]
    line = origins[None] + np.linspace(0, 1, 401)[:, None, None] * (ends - origins)
    sampled = norms(line[:, :, None] - points).min(axis=0)
    assert segment_distances(origins, ends, points) == pytest.approx(sampled, abs=0.01)
    assert (segment_distances(origins, ends, points) <= sampled + 1e-12).all()


@given(st.integers(0, 10**6))
def test_lanes_are_best_first_and_clear(seed: int) -> None:
    chance = np.random.default_rng(seed)
    points = apart(chance, 12, NOBODY, 0.5)
    start, goal = apart(chance, 2, points, 0.5)
    space = OutdoorSpace(0.5, 0.0, 4.0)
    paths = [*space.lanes(start, goal, points)]
    lengths = [float(norms(np.diff(path, axis=0)).sum()) for path in paths]
    assert np.diff(lengths).min(initial=0) >= -1e-8
    assert all(segment_distances(path[:-1], path[1:], points).min() >= 0.5 - 1e-9 for path in paths)
