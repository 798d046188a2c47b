"""The quadrotors: their bodies, motors and the ground, and their control."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.layout import Point
from robochoc.flight.quadrotor.airframe import GRAVITY, HUMMINGBIRD, Airframe, Array
from robochoc.flight.quadrotor.control import Controller
from robochoc.flight.quadrotor.rigid_bodies import RigidBodies
from robochoc.flight.quadrotor.simulation import DT

CALM = np.zeros((3, 1))
OFF = np.zeros((4, 1))
HOVER = HUMMINGBIRD.mass * GRAVITY / 4
FREE = replace(HUMMINGBIRD, drag=0.0)
UNEVEN = replace(FREE, inertia=(0.006, 0.008, 0.013))


def airborne(place: Point = (0.0, 0.0, 10.0), airframe: Airframe = HUMMINGBIRD, dt: float = DT) -> RigidBodies:
    """One body in the air, its motors off."""
    bodies = RigidBodies(np.array([place]), 0.0, airframe, dt)
    bodies.stands[:] = False
    return bodies


def ride(
    bodies: RigidBodies,
    setpoints: Callable[[float], Array],
    seconds: float,
    *,
    air: Array = CALM,
    steps: int = 1,
    failing_s: float = math.inf,
) -> Array:
    """Places (T, 3) of a body under control, one for each command; `steps` of physics between them."""
    controller = Controller(1, HUMMINGBIRD, DT)
    places = []
    for step in range(round(seconds / DT)):
        if step == round(min(failing_s, 1e6) / DT):
            bodies.stop_motor(0, 1)
        command = controller.command(bodies, setpoints(step * DT), np.zeros(1, dtype=np.bool_))
        for _ in range(steps):
            bodies.step(command, air)
        places.append(bodies.state[:3, 0].copy())
    return np.array(places)


def still(place: Point) -> Callable[[float], Array]:
    """It is wanted there all the time."""
    return lambda _: np.array([*place, 0, 0, 0, 0, 0, 0.0])[:, None]


def moving(start: Point, goal: Point) -> tuple[Callable[[float], Array], float]:
    """A planned way, and how long it takes."""
    way = plan_routes(np.array([start]), np.array([goal]), distance=0.5)

    def setpoints(s: float) -> Array:
        motion = way.at(s)
        return np.concatenate((motion.position, motion.velocity, motion.acceleration), axis=1).T

    return setpoints, way.duration_s


# The bodies


def test_without_thrust_a_body_falls_freely() -> None:
    bodies = airborne(airframe=FREE)
    for _ in range(round(1 / DT)):
        bodies.step(OFF, CALM)
    assert bodies.state[:, 0] == pytest.approx([0, 0, 10 - GRAVITY / 2, 0, 0, -GRAVITY], abs=1e-9)
    assert np.array_equal(bodies.axes[:, :, 0], np.eye(3))


def test_thrust_that_carries_the_weight_keeps_a_body_where_it_is() -> None:
    bodies = airborne()
    bodies.thrusts[:] = HOVER
    for _ in range(600):
        bodies.step(np.full((4, 1), HOVER), CALM)
    assert bodies.state[:, 0] == pytest.approx([0, 0, 10, 0, 0, 0], abs=1e-9)


def test_drag_makes_a_body_go_with_the_wind() -> None:
    bodies = airborne()
    bodies.thrusts[:] = HOVER
    air = np.array([[4.0], [0], [0]])
    for _ in range(round(2 / DT)):
        bodies.step(np.full((4, 1), HOVER), air)
    speed = 4 * (1 - math.exp(-2 * HUMMINGBIRD.drag / HUMMINGBIRD.mass))
    assert bodies.state[3, 0] == pytest.approx(speed, rel=1e-5)


@pytest.mark.parametrize(("before", "after", "lag"), [(0, 4, HUMMINGBIRD.lag_up), (4, 1, HUMMINGBIRD.lag_down)])
def test_motors_lag(before: float, after: float, lag: float) -> None:
    bodies = airborne()
    bodies.thrusts[:] = before
    steps = 5
    for _ in range(steps):
        bodies.step(np.full((4, 1), after, dtype=float), CALM)
    assert bodies.thrusts == pytest.approx(after + (before - after) * math.exp(-steps * DT / lag))


def test_a_free_body_keeps_its_energy_and_its_spin() -> None:
    bodies = airborne((0.0, 0.0, 1000.0), UNEVEN)
    inertia = np.array(UNEVEN.inertia)[:, None]
    bodies.rates[:, 0] = (6, 1, 3)
    energy, spin = bodies.energy()[0], (inertia * bodies.rates**2).sum()
    momentum = (bodies.axes * (inertia * bodies.rates)[:, None]).sum(0)
    for _ in range(round(10 / DT)):
        bodies.step(OFF, CALM)
    assert bodies.energy()[0] == pytest.approx(energy, rel=1e-8)
    assert (inertia * bodies.rates**2).sum() == pytest.approx(spin, rel=5e-5)
    turned = (bodies.axes * (inertia * bodies.rates)[:, None]).sum(0)
    assert np.abs(turned - momentum).max() < 1e-3 * np.linalg.norm(momentum)
    axes = bodies.axes[:, :, 0]
    assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-13


def test_the_ground_holds_who_stands_and_takes_up_who_lands_softly() -> None:
    standing = RigidBodies(np.array([[1.0, 2.0, 0.0]]), 0.0, HUMMINGBIRD, DT)
    for _ in range(100):
        standing.step(np.full((4, 1), 0.9 * HOVER), np.array([[20.0], [0], [0]]))
    assert standing.state[:, 0].tolist() == [1, 2, 0, 0, 0, 0]
    landing = airborne((0.0, 0.0, 0.05))
    for _ in range(100):
        landing.step(OFF, CALM)
    assert landing.state[:, 0].tolist() == [0, 0, 0, 0, 0, 0]
    assert (landing.stands[0], landing.fallen[0]) == (True, False)


def test_who_lands_tilted_is_levelled_and_who_falls_lies_as_it_fell() -> None:
    for rate, tilts in ((2.0, False), (6.0, True)):
        bodies = airborne((0.0, 0.0, 0.15))
        bodies.rates[0] = rate
        for _ in range(300):
            bodies.step(OFF, CALM)
        assert bodies.fallen[0] == tilts
        assert (bodies.axes[2, 2, 0] < 0.72) == tilts
        assert bodies.axes[2, 2, 0] > 0.9999 or tilts
        axes = bodies.axes[:, :, 0]
        assert np.abs(axes @ axes.T - np.eye(3)).max() < 1e-12
        assert bodies.state[2:, 0].tolist() == [0, 0, 0, 0]


def test_who_comes_down_with_a_motor_stopped_does_not_fly_again() -> None:
    bodies = airborne((0.0, 0.0, 0.05))
    bodies.stop_motor(0, 3)
    for _ in range(100):
        bodies.step(OFF, CALM)
    assert bodies.fallen[0]


def test_who_hits_the_ground_hard_does_not_fly_again() -> None:
    bodies = airborne((0.0, 0.0, 1.0))
    for _ in range(100):
        bodies.step(OFF, CALM)
    assert bodies.fallen[0]


# The control


def test_hovering_is_an_equilibrium() -> None:
    bodies = airborne()
    bodies.thrusts[:] = HOVER
    places = ride(bodies, still((0.0, 0.0, 10.0)), 2)
    assert np.abs(places - [0, 0, 10]).max() < 1e-9
    assert bodies.thrusts[:, 0] == pytest.approx([HOVER] * 4)


def test_a_step_of_the_reference_is_followed_and_settles() -> None:
    bodies = airborne()
    bodies.thrusts[:] = HOVER
    places = ride(bodies, still((1.0, -0.5, 10.5)), 6)
    apart = np.abs(places - [1, -0.5, 10.5]).max(1)
    assert apart[-1] < 0.001
    assert apart[round(4 / DT) :].max() < 0.02
    assert (places.max(0) - [1, 0, 10.5]).max() < 0.35


def test_a_drone_recovers_from_being_upside_down() -> None:
    bodies = airborne((0.0, 0.0, 30.0))
    bodies.wrapped_axes[[1, 2, 4]] *= -1
    bodies.rates[0] = 0.1
    places = ride(bodies, still((0.0, 0.0, 30.0)), 8)
    assert places[:, 2].min() > 15
    assert np.abs(places[-1] - [0, 0, 30]).max() < 0.02


@pytest.mark.parametrize(("wind", "most"), [(0.0, 0.01), (5.0, 0.07)])
def test_tracking_stays_within_the_margin_of_plans(wind: float, most: float) -> None:
    setpoints, lasts = moving((0.0, 0.0, 0.0), (3.0, 2.0, 3.0))
    bodies = RigidBodies(np.zeros((1, 3)), 0.0, HUMMINGBIRD, DT)
    places = ride(bodies, setpoints, lasts, air=np.array([[wind], [0], [0]]))
    wanted = np.array([setpoints((step + 1) * DT)[:3, 0] for step in range(len(places))])
    assert np.sqrt(np.square(places - wanted).sum(1)).max() < most


def test_a_constant_wind_leaves_no_error() -> None:
    bodies = airborne()
    places = ride(bodies, still((0.0, 0.0, 10.0)), 10, air=np.array([[5.0], [-3], [1]]))
    assert np.abs(places[-1] - [0, 0, 10]).max() < 1e-4


def test_ten_times_as_many_steps_make_no_difference() -> None:
    setpoints, _ = moving((0.0, 0.0, 0.0), (3.0, 2.0, 3.0))
    air = np.array([[3.0], [0], [0]])
    one, ten = (
        ride(
            RigidBodies(np.zeros((1, 3)), 0.0, HUMMINGBIRD, DT / steps),
            setpoints,
            2.2,
            air=air,
            steps=steps,
            failing_s=1.8,
        )
        for steps in (1, 10)
    )
    assert np.abs(one - ten).max() < 0.002


def test_who_loses_a_motor_tips_over() -> None:
    bodies = airborne()
    bodies.thrusts[:] = HOVER
    ride(bodies, still((0.0, 0.0, 10.0)), 1, failing_s=0.3)
    assert bodies.axes[2, 2, 0] < 0.5


def test_the_control_makes_up_for_gyroscopic_torques() -> None:
    rates = np.array([0.5, 0.3, 0.4])
    torques = []
    for sign in (1, -1):
        bodies = airborne()
        bodies.rates[:, 0] = sign * rates
        controller = Controller(1, HUMMINGBIRD, DT)
        command = controller.command(bodies, still((0.0, 0.0, 10.0))(0), np.zeros(1, dtype=np.bool_))
        torques.append((HUMMINGBIRD.mixing() @ command)[1:, 0])
    assert torques[0] + torques[1] == pytest.approx(2 * np.cross(rates, HUMMINGBIRD.inertia * rates), abs=1e-12)
    assert np.abs(torques[0]).min() > 0.01
