"""The flight: whole missions, and what may happen on the way."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from robochoc.flight.coordination.move_order import NoRouteError
from robochoc.flight.coordination.spacing import TooCloseError
from robochoc.flight.flight import Flight, check_length, fly
from robochoc.flight.layout import Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Goal, Mission
from robochoc.flight.quadrotor.airframe import GRAVITY
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.flight.quadrotor.simulation import DT, QuadrotorSimulation
from robochoc.flight.reports import BlockedReport, OutOfOrderReport
from tests.support.cases import looped
from tests.support.flights import planar

IN_THE_WIND = (3.0, 4.0, 0.0)
PAIR = np.array([[0.0, 0, 0], [2, 0, 0]])
UP = {0: Goal((0.0, 0.0, 2.0)), 1: Goal((2.0, 0.0, 3.0))}


def least(flown: FlightLog) -> float:
    assert flown.nearest is not None
    return flown.nearest.distance_m


def same(one: FlightLog, other: FlightLog) -> bool:
    """Whether two flights are equal to the last bit."""
    arrays = [(mine, yours) for mine, yours in zip(vars(one).values(), vars(other).values(), strict=True)]
    return all(
        np.array_equal(mine, yours, equal_nan=True) if isinstance(mine, np.ndarray) else mine == yours
        for mine, yours in arrays
        if not isinstance(mine, float)
    )


def whats(flown: FlightLog) -> list[tuple[int, str]]:
    return [(event.drone, event.what) for event in flown.events]


@pytest.fixture(scope="module")
def four() -> Mission:
    return planar(4, "Robot1.1", "Robot2.2", "Robot2.3", "Robot4.4")


@pytest.fixture(scope="module")
def calm(four: Mission) -> FlightLog:
    return fly(four)


# Missions


def test_it_says_how_far_it_is() -> None:
    reported: list[str] = []
    flown = fly(planar(2), progress=reported.append)
    assert reported[0] == "planning routes of 4 drones"
    begin, end = (re.fullmatch(r"leg 1, (.+) s of (.+) s flown", one) for one in (reported[1], reported[-1]))
    assert begin
    assert end
    assert float(begin[1]) < 0.1 < float(end[1]) == float(end[2]) < flown.times[-1]


def test_all_reach_their_places_and_keep_their_distance(four: Mission, calm: FlightLog) -> None:
    assert len(four.legs[0].goals) == 16
    assert calm.errors_m.max() < 0.01
    assert least(calm) >= calm.distance == 0.5
    assert (calm.events, calm.nearest_fallen) == ((), None)
    assert calm.positions.shape == (len(calm.times), 16, 3)
    assert np.abs(np.linalg.norm(calm.attitudes, axis=2) - 1).max() < 1e-12
    assert np.array_equal(calm.positions[0], [drone.home for drone in four.drones])
    assert np.array_equal(calm.positions[:30], np.broadcast_to(calm.positions[0], (30, 16, 3)))
    assert [leg.title for leg in calm.legs] == ["the start"]
    assert calm.legs[0].begins_s == 1
    assert calm.legs[0].ends_s == pytest.approx(calm.times[-1] - 1)
    assert calm.positions[:, :, 2].min() >= four.ground
    for number, goal in four.legs[0].goals.items():
        if goal.lands:
            assert calm.positions[-1, number, 2] == four.ground


def test_samples_agree_with_the_nearest(calm: FlightLog) -> None:
    first, second = np.triu_indices(16, 1)
    apart = np.linalg.norm(calm.positions[:, first] - calm.positions[:, second], axis=2)
    assert least(calm) <= apart.min() <= least(calm) + 0.01


@pytest.mark.parametrize("n", [7, pytest.param(11, marks=pytest.mark.slow)])
def test_larger_fields_are_flown_as_exactly(n: int) -> None:
    flown = fly(planar(n, *(f"Robot{i}.{i}" for i in range(1, n, 3))))
    assert flown.errors_m.max() < 0.01
    assert least(flown) >= flown.distance == 0.5
    assert flown.wall_s > 0


def test_the_same_flight_is_the_same_to_the_last_bit(four: Mission) -> None:
    short = replace(four, drones=four.drones[:4], legs=(replace(four.legs[0], goals={3: four.legs[0].goals[3]}),))
    conditions = FlightConditions(wind=IN_THE_WIND, gusts=0.5, seed=3, failures=(MotorFailure("Robot1.4", 3.0),))
    first = fly(short, conditions)
    assert same(first, fly(short, conditions))
    assert not same(first, fly(short, replace(conditions, seed=4)))


def test_wind_and_gusts_are_withstood(four: Mission) -> None:
    steady = fly(four, FlightConditions(wind=IN_THE_WIND))
    assert steady.errors_m.max() < 0.01
    assert least(steady) >= steady.distance
    gusty = fly(four, FlightConditions(wind=IN_THE_WIND, gusts=1.0))
    assert 0.001 < gusty.errors_m.max() < 0.1
    assert least(gusty) >= gusty.distance


@pytest.mark.parametrize("wind", [60.0, 200.0])
def test_a_storm_ends_and_is_told(wind: float) -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions(wind=(wind, 0.0, 0.0), gusts=wind))
    assert flight.fly("storm", UP) == ()
    flown = flight.log()
    assert np.isfinite(flown.positions).all()
    assert np.isfinite(flown.attitudes).all()
    assert flown.events
    assert not (flown.errors_m < 0.1).any()
    assert flown.times[-1] < 15


def test_who_is_out_of_all_bounds_is_given_up() -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions())
    simulation = flight._simulation  # noqa: SLF001 - nothing that can be asked for gets it there
    flight.fly("up", UP)
    simulation._bodies.rates[:, 0] = math.nan  # noqa: SLF001
    (report,) = flight.fly("and on", {1: Goal((2.0, 0.0, 1.0))}, stop_on_report=True)
    assert isinstance(report, OutOfOrderReport)
    assert (report.drone, report.why) == ("a", "has left the bounds of the simulation")
    flight.fly("at last", {1: Goal((2.0, 0.0, 1.0))})
    flown = flight.log()
    assert np.isfinite(flown.positions).all()
    assert flown.errors_m[1] < 0.01
    assert math.isnan(flown.errors_m[0])


# What happens on the way


def test_a_drone_whose_motor_stops_falls_and_the_others_go_on(four: Mission) -> None:
    drone = next(number for number, goal in four.legs[0].goals.items() if goal.at[2] == 4)
    name = four.drones[drone].name
    flown = fly(four, FlightConditions(failures=(MotorFailure(name, 4.0, 2), MotorFailure(name, 1e6))))
    assert whats(flown) == [(drone, "motor 2 has stopped"), (drone, "hits the ground")]
    failed, hit = (event.at_s for event in flown.events)
    assert failed == pytest.approx(4, abs=DT)
    assert 0.5 < hit - failed < 3
    assert np.flatnonzero(np.isnan(flown.errors_m)).tolist() == [drone]
    assert np.nanmax(flown.errors_m) < 0.01
    assert least(flown) >= flown.distance
    assert flown.nearest_fallen is not None
    falling = flown.positions[(hit - 0.25 < flown.times) & (flown.times < hit), drone, 2]
    assert np.diff(falling, 2) * 900 == pytest.approx(-GRAVITY, abs=1.8)  # its other motors are off; drag is not
    lying = flown.positions[flown.times > hit + 0.1, drone]
    assert (lying == lying[0]).all()
    assert lying[0, 2] == four.ground
    x, y, _, _ = flown.attitudes[-1, drone]
    assert 1 - 2 * (x * x + y * y) < 0.9


def test_a_failure_is_reported_and_the_next_leg_keeps_away() -> None:
    homes = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    goals = {number: Goal((number, 0.0, 2.0)) for number in range(3)}
    flight = Flight(
        ["a", "b", "c"], homes, FlightConditions(failures=(MotorFailure("b", 2.0, 3), MotorFailure("c", 900.0)))
    )
    (report,) = flight.fly("up", goals, stop_on_report=True)
    assert isinstance(report, OutOfOrderReport)
    assert (report.drone, report.why) == ("b", "motor 3 has stopped")
    assert report.at_s == pytest.approx(2, abs=DT)
    stopped = flight.log()
    assert 0.1 < stopped.errors_m[0] < 1.9
    assert stopped.times[-1] < 6
    lies = stopped.positions[-1, 1]
    spot = (float(lies[0]), float(lies[1]) + 0.1, 0.0)
    assert flight.fly("down", {0: Goal(spot, lands=True), 1: Goal((1.0, 0.0, 3.0))}, stop_on_report=True) == ()
    flown = flight.log()
    assert math.isnan(flown.errors_m[1])
    assert 0.3 < flown.errors_m[0] < 2
    assert flown.positions[-1, 0, 2] == 0
    assert np.linalg.norm(flown.positions[-1, 0] - lies) >= 0.49
    assert dict(whats(flown))[0].startswith("lands ")


def test_nobody_slides_along_the_ground() -> None:
    simulation = QuadrotorSimulation(["a"], np.zeros((1, 3)), 0.0, FlightConditions())
    for _ in range(60):
        simulation.setpoints[3] = 0.5
        simulation.setpoints[0] += 0.5 * DT
        simulation.advance()
    assert simulation.places[0, 2] > 0.05
    simulation.setpoints[3] = 0
    for _ in range(240):
        simulation.advance()
    assert simulation.places[0] == pytest.approx([0.25, 0, 0], abs=0.05)
    assert simulation.settled(0.0, 0.0)


def test_a_motor_that_stops_on_the_ground_keeps_its_drone_there() -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions(failures=(MotorFailure("a", 0.5),)))
    flight.fly("up", UP)
    flown = flight.log()
    assert (flown.positions[:, 0] == PAIR[0]).all()
    assert whats(flown) == [(0, "motor 0 has stopped")]
    assert flown.errors_m[1] < 0.01


@looped(
    ("obstacle", "start"),
    [((0.0, 0.0, 3.0), (-6.0, 2.0)), ((0.3, 0.0, 3.1), (-2.0, 0.0)), ((0.0, -0.2, 2.7), (0.0, 0.0))],
)
def test_an_obstacle_is_seen_reported_and_kept_away_from(obstacle: Point, start: tuple[float, float]) -> None:
    homes = np.array([[*start, 0.0], [2, 0, 0]])
    goals = {0: Goal((0.0, 0.0, 3.0)), 1: Goal((2.0, 0.0, 3.0))}
    flight = Flight(["a", "b"], homes, FlightConditions(obstacles=(obstacle,)))
    (report,) = flight.fly("up", goals, stop_on_report=True)
    assert isinstance(report, BlockedReport)
    assert (report.drone, report.place) == ("a", obstacle)
    stopped = flight.log()
    assert stopped.errors_m[0] > 0.1
    assert flight.fly("again", goals, stop_on_report=True) == ()
    flown = flight.log()
    assert np.linalg.norm(flown.positions - obstacle, axis=2).min() >= 0.5
    assert flown.errors_m[1] < 0.01
    assert flown.errors_m[0] < 1.1
    assert [leg.title for leg in flown.legs] == ["up", "again"]


def test_without_heed_a_blocked_drone_hovers_where_it_stopped_and_the_others_go_on() -> None:
    obstacles = ((0.1, 0.0, 3.0), (1.0, 0.0, 1.5))
    flown_by: dict[bool, FlightLog] = {}
    for blocked in (True, False):
        flight = Flight(["a", "b"], PAIR, FlightConditions(obstacles=obstacles[not blocked :]))
        assert flight.fly("up", {0: Goal((0.0, 0.0, 3.0)), 1: Goal((0.0, 0.0, 1.5))}) == ()
        flown_by[blocked] = flight.log()
    flown = flown_by[True]
    assert [what.split()[0] for _, what in whats(flown)] == ["sees", "hovers"]
    assert flown.errors_m[0] > 0.5
    assert flown.errors_m[1] < 0.01
    assert flown_by[False].errors_m.max() < 0.01
    assert whats(flown_by[False]) == []
    for one in flown_by.values():
        for obstacle in one.obstacles:
            assert np.linalg.norm(one.positions - obstacle, axis=2).min() >= 0.5


# Legs and conditions


def test_legs_follow_each_other_and_who_has_no_goal_stays() -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions())
    flight.fly("one", {0: Goal((0.0, 0.0, 2.0))})
    middle = flight.log()
    assert middle.errors_m.tolist() == [pytest.approx(0, abs=0.01), 0]
    assert (middle.positions[:, 1] == PAIR[1]).all()
    again = flight.log()
    assert same(middle, again)
    flight.fly("two", {1: Goal((0.0, 0.0, 3.0)), 0: Goal((2.0, 0.0, 0.0), lands=True)})
    flight.fly("three", {0: Goal((2.0, 0.0, 1.0))})
    flown = flight.log()
    assert flown.errors_m.max() < 0.01
    assert least(flown) >= 0.5
    ends = [leg.ends_s for leg in flown.legs]
    assert [leg.begins_s for leg in flown.legs] == [1, ends[0] + 1, ends[1]]
    assert np.array_equal(flown.positions[: len(middle.times)], middle.positions)


def test_the_distance_is_less_where_places_are_nearer() -> None:
    homes = np.array([[0.0, 0, 0], [0.4, 0, 0]])
    flight = Flight(["a", "b"], homes, FlightConditions())
    flight.fly("up", {0: Goal((0.0, 0.0, 1.0)), 1: Goal((0.3, 0.0, 1.0))})
    flown = flight.log()
    assert flown.distance == pytest.approx(0.24)
    assert flown.errors_m.max() < 0.01
    assert least(flown) >= flown.distance


def test_goals_that_are_too_near_are_refused() -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions(distance=1.0))
    with pytest.raises(ValueError, match=r"the goals of a and b are 0\.50 m apart, and the minimum is 1 m"):
        flight.fly("up", {0: Goal((0.0, 0.0, 1.0)), 1: Goal((0.5, 0.0, 1.0))})
    with pytest.raises(ValueError, match=r"are 0 m apart.*: add a constraint that keeps the drones apart"):
        flight.fly("up", dict.fromkeys((0, 1), Goal((0.0, 0.0, 1.0))))
    with pytest.raises(ValueError, match=r"the homes of a and b are 2\.00 m apart"):
        Flight(["a", "b"], PAIR, FlightConditions(distance=2.5))
    with pytest.raises(ValueError, match="there is no drone with the number 2"):
        flight.fly("up", {2: Goal((0.0, 0.0, 1.0))})
    with pytest.raises(ValueError, match="no drones"):
        Flight([], np.zeros((0, 3)), FlightConditions())
    with pytest.raises(ValueError, match="no drone is called 'c'; the drones are a, b"):
        Flight(["a", "b"], PAIR, FlightConditions(failures=(MotorFailure("c", 1.0),)))


def test_who_has_no_goal_gives_way_to_goals_that_leave_no_room() -> None:
    flight = Flight(["a", "b"], np.array([[0.0, 0, 0], [2, 0, 0]]), FlightConditions())
    flight.fly("up", {0: Goal((0.0, 0.0, 2.0))})
    flight.fly("beside", {1: Goal((0.5, 0.0, 2.0))})
    flown = flight.log()
    assert [what.split()[0] for _, what in whats(flown)] == ["hovers"]
    assert least(flown) >= flown.distance == 0.5


def test_who_is_wanted_along_the_ground_keeps_away_from_who_is_above() -> None:
    simulation = QuadrotorSimulation(["a"], np.zeros((1, 3)), 0.0, FlightConditions())
    heights = []
    for spare in (0.1, 0.05, 0.0):
        simulation.set_spare_distance(spare)
        heights.append(simulation.hop_m)
    assert heights == pytest.approx([0.08, 0.04, 0.01])


def test_refusals_of_the_plan_name_drones() -> None:
    flight = Flight(["a", "b"], PAIR, FlightConditions())
    everybody = np.arange(2)
    assert flight._refusal(TooCloseError(1, 2, 0.1234, "goal"), everybody) == (  # noqa: SLF001 - places are checked before
        "b and an obstacle are to end only 0.123 m from each other"
    )
    assert flight._refusal(NoRouteError([0, 1]), everybody).startswith("there is no route for a, b: ")  # noqa: SLF001
    for drones, past in (([0], "a gets past the others"), ([0, 1], "a, b get past each other")):
        refusal = flight._refusal(NoRouteError(drones, indoors=True), everybody)  # noqa: SLF001
        assert refusal.startswith(f"no order of flying was found in which {past} between the walls: ")


def test_what_is_too_much_is_refused_before_it_takes_minutes() -> None:
    with pytest.raises(ValueError, match=r"1,001 drones, more than the maximum of 1,000"):
        Flight(["a"] * 1001, np.zeros((1001, 3)), FlightConditions())
    with pytest.raises(
        ValueError, match=r"the homes of a and b are 1e-11 m apart, and the minimum is .* a larger scale$"
    ):
        Flight(["a", "b"], PAIR * 5e-12, FlightConditions())
    with pytest.raises(ValueError, match=r"b: the position \(inf, 0, 0\) m is more than"):
        Flight(["a", "b"], np.array([[0.0, 0, 0], [math.inf, 0, 0]]), FlightConditions())
    with pytest.raises(ValueError, match="an obstacle: the position"):
        Flight(["a", "b"], PAIR, FlightConditions(obstacles=((0.0, 0.0, 1e200),)))
    flight = Flight(["a", "b"], PAIR, FlightConditions())
    with pytest.raises(ValueError, match=r"b would have to fly 5,000 m, more than the maximum of 2,000 m"):
        flight.fly("up", {1: Goal((2.0, 0.0, 5000.0))})
    with pytest.raises(ValueError, match=r"the limit for 1,000 drones is 100 s"):
        check_length(1000, 101.0)
    flight.fly("up", UP)
    assert flight.log().errors_m.max() < 0.01


def test_far_from_the_origin_drones_fly_as_near_it() -> None:
    away = np.array([4e5, 5.5e6, 100.0])
    near, far = (Flight(["a", "b"], PAIR + shift, FlightConditions()) for shift in (0 * away, away))
    near.fly("up", UP)
    places = [(number, goal.at) for number, goal in UP.items()]
    far.fly("up", {number: Goal((x + 4e5, y + 5.5e6, z + 100)) for number, (x, y, z) in places})
    assert far.log().positions - away == pytest.approx(near.log().positions, abs=1e-6)
    assert far.log().errors_m == pytest.approx(near.log().errors_m, abs=1e-6)


@looped(
    ("wrong", "why"),
    [
        ({"distance": 0.0}, "it must be finite, and at least"),
        ({"distance": math.nan}, "it must be finite, and at least"),
        ({"distance": 1e-9}, "at least 0.01 m"),
        ({"gusts": -1.0}, "gusts"),
        ({"gusts": math.inf}, "gusts"),
        ({"wind": (0.0, math.nan, 0.0)}, "finite"),
        ({"wind": (1e9, 0.0, 0.0)}, "faster"),
        ({"obstacles": ((0.0, 0.0, math.inf),)}, "finite"),
        ({"seed": -1}, "seed"),
        ({"failures": (MotorFailure("a", -1.0),)}, "the time of a motor failure is -1"),
        ({"failures": (MotorFailure("a", 1.0, 4),)}, "no motor 4"),
    ],
)
def test_conditions_that_make_no_sense_are_refused(wrong: dict[str, object], why: str) -> None:
    with pytest.raises(ValueError, match=why):
        replace(FlightConditions(), **wrong)  # type: ignore[arg-type]
