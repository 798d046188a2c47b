"""The simulation loop: setpoints, rotor commands, motion of the bodies, wind, log.

The time step, `DT`, was chosen by measurement. A flight of 4.7 m in a wind of 3 m/s differs by at most 0.5 mm from a
flight with ten times as many steps between the same commands. The rotational energy of a body that tumbles freely at
one turn per second for 10 s is constant within 3e-5 (`tests/unit/flight/test_rigid_bodies.py`). Halving the step would
double the computation time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from robochoc.flight.layout import Point
from robochoc.flight.log import SAMPLE_RATE_HZ, FlightEvent
from robochoc.flight.quadrotor.airframe import HUMMINGBIRD, Array
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.flight.quadrotor.control import Controller
from robochoc.flight.quadrotor.rigid_bodies import Mask, RigidBodies
from robochoc.flight.quadrotor.separation import SeparationMonitor
from robochoc.flight.quadrotor.trajectory import Trajectory

_CORRELATION_S = 1.5
STEPS_PER_SAMPLE = 4
DT = 1 / (SAMPLE_RATE_HZ * STEPS_PER_SAMPLE)
_CUT_OFF = math.cos(math.radians(60))
"""The cosine of the tilt at which a drone with a stopped motor switches its other motors off."""
_PRESS_M = 0.05
"""The depth of a landing drone's setpoint below the ground, which makes the drone touch the ground."""
_ABOVE_M = 0.003
_HOP_M = (0.01, 0.08)
"""The minimum and maximum height of a drone whose setpoints move along the ground."""
_HOP = 0.8
"""This height as a fraction of the routes' spare distance, since another drone may be directly above."""
_TOUCH_M = 1e-6
_BOUNDS = 1e6
"""The bound of valid states, in m and m/s."""


class QuadrotorSimulation:
    """Simulates N drones, step by step. `setpoints` (9, N) are positions, velocities and accelerations.

    Args:
        names: The drones' names.
        homes: The drones' initial places.
        ground: The height of the ground.
        conditions: Wind and failures.
        floor: Returns the height of the floor below a place, onto which failed drones fall; None if it is unknown.
    """

    def __init__(
        self,
        names: Sequence[str],
        homes: Array,
        ground: float,
        conditions: FlightConditions,
        floor: Callable[[Array], float | None] | None = None,
    ) -> None:
        number = len(names)
        self.setpoints = np.zeros((9, number))
        self.setpoints[:3] = homes.T
        self.events: list[FlightEvent] = []
        self.hop_m = _HOP_M[1]
        self.failures: list[tuple[int, str, float]] = []
        """Drones that can no longer fly: number, reason, time in seconds."""
        self.separation = SeparationMonitor(number, conditions.downwash)
        self.failed: Mask = np.zeros(number, dtype=np.bool_)
        """(N,): whether each drone is falling or has fallen."""
        self._names = names
        self._ground = ground
        self._floor = floor or (lambda _: None)
        self._bodies = RigidBodies(homes, ground, HUMMINGBIRD, DT)
        self._controller = Controller(number, HUMMINGBIRD, DT)
        self._wind = Wind(conditions.wind, conditions.gusts, conditions.seed, number, DT)
        self._due: list[MotorFailure] = sorted(conditions.failures, key=lambda failure: failure.at_s, reverse=True)
        self._off: Mask = np.zeros(number, dtype=np.bool_)
        self._down: Mask = np.zeros(number, dtype=np.bool_)
        self._steps = 0
        self._places: list[Array] = []
        self._axes: list[Array] = []
        self._sample()
        self.separation.observe(self._bodies.state[:3], 0.0)

    @property
    def now_s(self) -> float:
        """The simulated time, in seconds."""
        return self._steps * DT

    @property
    def places(self) -> Array:
        """The drones' positions (N, 3)."""
        return np.asarray(self._bodies.state[:3].T)

    @property
    def is_sampled(self) -> bool:
        """True if the present state has just been logged."""
        return self._steps % STEPS_PER_SAMPLE == 0

    @property
    def falling(self) -> Mask:
        """(N,): whether each drone is falling."""
        return self.failed & ~self._bodies.fallen

    def settled(self, near: float, slow: float) -> bool:
        """Return whether no drone is falling, and the others are below `slow` and within `near` of their setpoints."""
        gaps = np.square(self.setpoints[:3] - self._bodies.state[:3]).sum(0)
        speeds = np.square(self._bodies.state[3:]).sum(0)
        low = self.setpoints[2] <= self._ground + _TOUCH_M
        calm = np.where(low, self._bodies.stands, (gaps < near**2) & (speeds < slow**2)) | self.failed
        return bool(calm.all()) and not self.falling.any()

    def tracking_errors(self) -> Array:
        """Return the drones' distances (N,) from their setpoints; 0 for failed drones."""
        gaps = np.sqrt(np.square(self.setpoints[:3] - self._bodies.state[:3]).sum(0))
        return np.where(self.failed, 0.0, gaps)

    def advance(self, trajectory: Trajectory | None = None, *, late: bool = False) -> None:
        """Advance by one step along `trajectory`. If `late`, landing drones land in place."""
        while self._due and self._due[-1].at_s <= self.now_s:
            self._fail(self._due.pop())
        if trajectory is not None:
            trajectory.update_setpoints()
            trajectory.advance(DT)
        bodies = self._bodies
        low = self.setpoints[2] <= self._ground + _TOUCH_M
        moving = np.logical_or.reduce(self.setpoints[3:6] != 0)
        idle = low & bodies.stands & ~moving
        low &= ~idle
        idle |= self._off
        setpoints = self._adjusted_setpoints(low, moving, late=late) if low.any() else self.setpoints
        bodies.step(self._controller.command(bodies, setpoints, idle), self._wind.air())
        self._steps += 1
        if not bool(np.abs(bodies.state).max() < _BOUNDS):  # also true for nan
            self._ground_invalid()
        if self.failures or bodies.fallen.any():
            self._update_failed()
        self.separation.observe(bodies.state[:3], self.now_s)
        if self.is_sampled:
            self._sample()

    def set_spare_distance(self, spare: float) -> None:
        """Set the margin of routes beyond the distance, in metres."""
        self.hop_m = min(max(_HOP * spare, _HOP_M[0]), _HOP_M[1])

    def log_event(self, drone: int, what: str) -> None:
        """Log an event of `drone` now."""
        self.events.append(FlightEvent(self.now_s, drone, what))

    def record(self) -> tuple[Array, Array, Array]:
        """Return times (T,), positions (T, N, 3) and attitudes (T, N, 4) of all samples."""
        times = np.arange(len(self._places)) / SAMPLE_RATE_HZ
        positions = np.ascontiguousarray(np.stack(self._places).transpose(0, 2, 1))
        return times, positions, quaternions(np.stack(self._axes).transpose(0, 3, 1, 2))

    def _sample(self) -> None:
        self._places.append(self._bodies.state[:3].copy())
        self._axes.append(self._bodies.axes.copy())

    def _adjusted_setpoints(self, low: Mask, moving: Mask, *, late: bool) -> Array:
        """Return the setpoints, with those of the `low` drones moved above the ground, or below it for landing."""
        off = np.square(self.setpoints[:2] - self._bodies.state[:2]).sum(0)
        lands = low & ~moving & (late | (off < _ABOVE_M**2))
        setpoints = self.setpoints.copy()
        setpoints[2] += self.hop_m * (low & moving) - _PRESS_M * lands
        return setpoints

    def _fail(self, failure: MotorFailure) -> None:
        drone = self._names.index(failure.drone)
        self._bodies.stop_motor(drone, failure.motor)
        if not self.failed[drone]:
            self._mark_failed(drone, f"motor {failure.motor} has stopped")
            self._down[drone] = self._bodies.fallen[drone]

    def _mark_failed(self, drone: int, why: str) -> None:
        self.failed[drone] = True
        self._off |= self._bodies.fallen
        self.separation.exclude(self.failed)
        self.failures.append((drone, why, self.now_s))
        self.log_event(drone, why)

    def _update_failed(self) -> None:
        bodies = self._bodies
        self._off |= self.failed & (bodies.axes[2, 2] < _CUT_OFF)
        for drone in np.flatnonzero(self.failed & ~self._down).tolist():
            floor = self._floor(bodies.state[:3, drone])
            bodies.grounds[drone] = bodies.grounds[drone] if floor is None else floor
        for drone in np.flatnonzero(bodies.fallen & ~self._down).tolist():
            self._down[drone] = self._off[drone] = True
            if self.failed[drone]:
                self.log_event(drone, "hits the ground")
            else:
                self._mark_failed(drone, "has hit the ground")

    def _ground_invalid(self) -> None:
        """Put drones with invalid states on the ground, below their last logged positions."""
        bodies = self._bodies
        for drone in np.flatnonzero(~(np.abs(bodies.state) < _BOUNDS).all(0)).tolist():
            bodies.lay(drone, self._places[-1][:, drone])
            self._controller.reset(drone)
            self._down[drone] = self._off[drone] = True
            if not self.failed[drone]:
                self._mark_failed(drone, "has left the bounds of the simulation")


class Wind:
    """Simulates the air velocity around each of `number` drones: `mean`, plus gusts of standard deviation `gusts`, m/s.

    Gusts are first-order Gauss-Markov processes, like the longitudinal gusts in the Dryden model (MIL-F-8785C, Section
    3.7.1.2). Unlike in that model, gusts in all three directions are of this kind, with the same correlation time, and
    are independent for each drone. Real gusts are correlated over a metre or two; independent gusts are the harder case
    for the distances between drones.
    """

    def __init__(self, mean: Point, gusts: float, seed: int, number: int, dt: float) -> None:
        self._mean = np.array(mean, dtype=np.float64)[:, None]
        self._keeps = math.exp(-dt / _CORRELATION_S)
        self._gusts = gusts
        self._chance = np.random.default_rng(seed)
        self._now = gusts * self._chance.standard_normal((3, number)) if gusts else np.zeros((3, 1))

    def air(self) -> Array:
        """Return the air velocity in the next step: (3, N), or (3, 1) without gusts."""
        if not self._gusts:
            return self._mean
        drawn = self._chance.standard_normal(self._now.shape)
        self._now = self._keeps * self._now + self._gusts * math.sqrt(1 - self._keeps**2) * drawn
        return np.asarray(self._mean + self._now)


def quaternions(axes: Array) -> Array:
    """Return unit quaternions x, y, z, w (..., 4) of rotations (..., 3, 3); `[..., k, :]` is the rotated axis k.

    Of the four formulas by Shepperd ("Quaternion from rotation matrix", 1978), the one without cancellation is used.
    """
    xx, yy, zz = axes[..., 0, 0], axes[..., 1, 1], axes[..., 2, 2]
    squares = np.stack([1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz, 1 + xx + yy + zz], axis=-1)
    # The products of each component with all four components, times four.
    xy, yz, zx = (axes[..., i, j] + axes[..., j, i] for i, j in ((0, 1), (1, 2), (2, 0)))
    xw, yw, zw = (axes[..., i, j] - axes[..., j, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    rows = np.stack(
        [
            np.stack([squares[..., 0], xy, zx, xw], axis=-1),
            np.stack([xy, squares[..., 1], yz, yw], axis=-1),
            np.stack([zx, yz, squares[..., 2], zw], axis=-1),
            np.stack([xw, yw, zw, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    largest = squares.argmax(-1)[..., None, None]
    found = np.take_along_axis(rows, largest, -2)[..., 0, :]
    return np.asarray(found / np.sqrt(np.square(found).sum(-1, keepdims=True)))
