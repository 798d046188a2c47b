"""Rigid bodies: all drones are advanced in one step, component by component, so that numpy vectorizes over the drones.

The integrator is of second order. Motors are computed exactly, since their commands are constant within a step, body
rates by the midpoint rule, positions with the mean thrust of the step, and drag implicitly. Rotations are computed by
the Cayley map, which keeps them orthonormal up to rounding (Hairer, Lubich, Wanner, "Geometric Numerical Integration",
2006, Section IV.8).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robochoc.flight.quadrotor.airframe import GRAVITY, Airframe, Array

Mask = npt.NDArray[np.bool_]

IMPACT_MAX_M_S = 2.0
"""A drone that hits the ground at a higher speed, or with a tilt beyond `TILT_MAX_COSINE`, never flies again."""
TILT_MAX_COSINE = math.cos(math.radians(45))
_LEVELLING_S = 0.1
"""The time constant with which a standing drone becomes level."""


class RigidBodies:
    """Simulates the motion of N drones on the ground and in the air.

    Attributes:
        state: (6, N): positions and velocities in the world frame (z up).
        axes: (3, 3, N): `axes[k]` is the body axis k in the world frame.
        rates: (3, N): the angular velocities about the body axes, in rad/s.
        thrusts: (4, N): the thrusts of the rotors, in newtons.
        stands: (N,): whether each drone is on the ground.
        fallen: (N,): whether each drone has crashed; it then stays on the ground permanently.
        grounds: (N,): the height of the ground below each drone.
    """

    def __init__(self, homes: Array, ground: float, airframe: Airframe, dt: float) -> None:
        number = len(homes)
        self.state = np.zeros((6, number))
        self.state[:3] = homes.T
        # The first two axes are repeated after the third, so that a cross product is two products of slices.
        self._axes = np.zeros((5, 3, number))
        self._axes[[0, 1, 2, 3, 4], [0, 1, 2, 0, 1]] = 1
        self.axes = self._axes[:3]
        self.rates = np.zeros((3, number))
        self.thrusts = np.zeros((4, number))
        self.stands: Mask = np.ones(number, dtype=np.bool_)
        self.fallen: Mask = np.zeros(number, dtype=np.bool_)
        self.motors_running = np.ones((4, number))
        """(4, N): 0 for a motor that has stopped, else 1."""
        self.grounds = np.full(number, ground)
        self._airframe = airframe
        self._dt = dt
        self._mixing = airframe.mixing()
        inertia = np.array(airframe.inertia)[:, None]
        self._per_inertia = 1 / inertia
        self._gyroscopic = (np.roll(inertia, -1, 0) - np.roll(inertia, -2, 0)) / inertia
        self._decays = tuple(math.exp(-dt / lag) for lag in (airframe.lag_up, airframe.lag_down))
        self._means = tuple(
            (1 - decay) * lag / dt
            for decay, lag in zip(self._decays, (airframe.lag_up, airframe.lag_down), strict=True)
        )
        self._turning = np.zeros((5, number))
        self._rotation = np.zeros((2, 5, 3, number))

    @property
    def wrapped_axes(self) -> Array:
        """(5, 3, N): the axes, with the first two repeated after the third."""
        return self._axes

    def step(self, command: Array, air: Array) -> None:
        """Advance by one step with thrusts (4, N) commanded, in air with the velocity `air`, m/s: (3, N) or (3, 1)."""
        before = self.state[:2].copy() if self.stands.any() else None
        axes_before = None if before is None else self._axes.copy()
        wrench = self._mixing @ self._spin(command * self.motors_running)
        up = self._axes[2].copy()
        self._turn(wrench[1:])
        up += self._axes[2]
        self._move(wrench[0] * up, air)
        low = self.state[2] <= self.grounds
        if before is not None or low.any():
            self._touch(low, before, axes_before)

    def stop_motor(self, drone: int, motor: int) -> None:
        """Stop a motor for good. A drone on the ground then never flies."""
        self.motors_running[motor, drone] = 0
        self.fallen[drone] |= self.stands[drone]

    def lay(self, drone: int, place: Array) -> None:
        """Put `drone` permanently on the ground below `place`."""
        self.state[:, drone] = [place[0], place[1], self.grounds[drone], 0, 0, 0]
        self._axes[:, :, drone] = np.eye(3)[[0, 1, 2, 0, 1]]
        self.rates[:, drone] = 0
        self.thrusts[:, drone] = 0
        self.stands[drone] = self.fallen[drone] = True

    def energy(self) -> Array:
        """Return each drone's energy (N,), in J: translational, rotational, and potential above the ground."""
        mass, inertia = self._airframe.mass, np.array(self._airframe.inertia)[:, None]
        moving = mass / 2 * (self.state[3:] ** 2).sum(0) + (inertia / 2 * self.rates**2).sum(0)
        return np.asarray(moving + mass * GRAVITY * (self.state[2] - self.grounds))

    def _spin(self, command: Array) -> Array:
        """Return the mean thrusts of the step, and advance the thrusts to its end."""
        gap = command - self.thrusts
        grows = gap > 0
        mean = command - gap * np.where(grows, *self._means)
        np.subtract(command, gap * np.where(grows, *self._decays), out=self.thrusts)
        return np.asarray(mean)

    def _turn(self, torque: Array) -> None:
        """Advance the rates by Euler's equation with the midpoint rule; rotate by the rates at the step's midpoint."""
        dt, spin = self._dt, self._turning
        push = torque * self._per_inertia
        spin[:3] = self.rates
        spin[3:] = self.rates[:2]
        half = self.rates + (push + self._gyroscopic * spin[1:4] * spin[2:5]) * (dt / 2)
        spin[:3] = half
        spin[3:] = half[:2]
        self.rates += (push + self._gyroscopic * spin[1:4] * spin[2:5]) * dt
        # The Cayley map of h rotates by 2 arctan |h|; here h is tan(angle / 2), up to its fifth power.
        quarter = np.square(half).sum(0) * (dt * dt / 4)
        spin *= dt / 2 * (1 + quarter / 3)
        vector = spin[:, None]
        once, twice = self._rotation
        np.subtract(self._axes[1:4] * vector[2:], self._axes[2:] * vector[1:4], out=once[:3])
        once[3:] = once[:2]
        np.subtract(once[1:4] * vector[2:], once[2:] * vector[1:4], out=twice[:3])
        twice[:3] += once[:3]
        twice[:3] *= 2 / (1 + np.square(spin[:3]).sum(0))
        self.axes += twice[:3]
        self._axes[3:] = self._axes[:2]

    def _move(self, thrust: Array, air: Array) -> None:
        """Advance by Newton's law. `thrust` is twice the force: the sum for directions before and after the step."""
        dt, frame = self._dt, self._airframe
        drag = frame.drag / frame.mass
        velocity = self.state[3:]
        push = thrust * (0.5 / frame.mass) + (air - velocity) * drag
        push[2] -= GRAVITY
        push *= dt / (1 + drag * dt / 2)
        self.state[:3] += (velocity + push / 2) * dt
        velocity += push

    def _touch(self, low: Mask, before: Array | None, axes_before: Array | None) -> None:
        """Keep drones that are too low on the ground."""
        hit = low & ~self.stands & ~self.fallen
        if hit.any():
            self.fallen |= hit & (
                (self.state[5] < -IMPACT_MAX_M_S) | (self._axes[2, 2] < TILT_MAX_COSINE) | ~self.motors_running.all(0)
            )
        standing = low & self.stands
        if before is not None and axes_before is not None:
            np.copyto(self.state[:2], before, where=standing)
            np.copyto(self._axes, axes_before, where=standing)
        np.copyto(self.state[2], self.grounds, where=low)
        np.copyto(self.state[3:], 0.0, where=low)
        np.copyto(self.rates, 0.0, where=low)
        np.copyto(self.stands, low)
        tilted = low & ~self.fallen & (self._axes[2, 2] < 1)
        if tilted.any():
            self._level(tilted)

    def _level(self, which: Mask) -> None:
        axes = self._axes[:, :, which]
        up = axes[2]
        up[:2] *= 1 - self._dt / _LEVELLING_S
        up /= np.sqrt(np.square(up).sum(0))
        front = axes[0] - up * (up * axes[0]).sum(0)
        front /= np.sqrt(np.square(front).sum(0))
        axes[0] = front
        axes[1] = up[[1, 2, 0]] * front[[2, 0, 1]] - up[[2, 0, 1]] * front[[1, 2, 0]]
        axes[3:] = axes[:2]
        self._axes[:, :, which] = axes
