"""The geometric tracking controller on SE(3), for all drones at once.

Lee, Leok, McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, with z up and the front of
all drones along x. The integral of position errors is from Goodarzi, Lee, Lee, "Geometric nonlinear PID control of a
quadrotor UAV on SE(3)", ECC 2013, so that a constant wind leaves no error. The drag at the planned velocity is fed
forward. The controller does not use the wind.

Differences from the papers: the gains, per mass and inertia, are new, since Lee's are for an airframe six times as
heavy; the torque that compensates a desired angular acceleration is left out; the desired angular velocity is the
difference quotient of the desired thrust direction; this velocity and the desired accelerations are bounded.
"""

from __future__ import annotations

import numpy as np

from robochoc.flight.quadrotor.airframe import GRAVITY, Airframe, Array
from robochoc.flight.quadrotor.rigid_bodies import RigidBodies

_POSITION, _VELOCITY, _INTEGRAL = 9.0, 5.5, 6.0
"""Gains per mass: 1/s^2, 1/s, 1/s^2."""
_ERRORS_PER_VELOCITY = 2.0
"""Goodarzi's c1, 1/s: the weight of the position error in the integral."""
_ATTITUDE = np.array([[280.0], [280.0], [40.0]])
_RATES = np.array([[28.0], [28.0], [12.0]])
"""Gains per inertia: 1/s^2, 1/s. Turning about z is slow, since the rotors' drag torques are small."""
_INTEGRAL_MAX = 1.2
"""The bound of the integral, in m/s. With the gain `_INTEGRAL` it compensates a wind of up to 35 m/s."""
_SIDEWAYS_MAX = 9.0
_UP_MIN, _UP_MAX = 0.4 * GRAVITY, 2.0 * GRAVITY
"""Bounds of the upward acceleration including gravity, in m/s^2: drones neither turn over nor fall freely."""
_THRUST_MIN = 0.2
"""The minimum thrust, in weights. Without thrust a drone cannot be rotated, for example if it is upside down."""
_TURN_MAX = 8.0
"""The bound of the desired angular velocity, in rad/s."""


class Controller:
    """Computes the rotors' thrusts with which N drones follow their setpoints."""

    def __init__(self, number: int, airframe: Airframe, dt: float) -> None:
        self._mass = airframe.mass
        self._inertia = np.array(airframe.inertia)[:, None]
        self._gyroscopic = np.roll(self._inertia, -2, 0) - np.roll(self._inertia, -1, 0)
        self._unmixing = np.linalg.inv(airframe.mixing())
        self._thrust_max = airframe.thrust_max
        self._least = _THRUST_MIN * airframe.mass * GRAVITY
        self._dt = dt
        # Rows: errors of position and velocity, the integral, desired acceleration and velocity.
        self._inputs = np.zeros((15, number))
        self._integral = self._inputs[6:9]
        one = np.eye(3)
        drag = airframe.drag / airframe.mass
        self._gains = np.hstack([_POSITION * one, _VELOCITY * one, _INTEGRAL * one, one, drag * one])
        self._summing = np.hstack([_ERRORS_PER_VELOCITY * one, one]) * dt
        self._desired = np.zeros((5, 3, number))
        self._wrench = np.zeros((4, number))
        # Vectors with their first two components repeated after the third: see `RigidBodies`.
        self._up = np.zeros((5, number))
        self._up[2] = 1
        self._turn = np.zeros((5, number))
        self._rates = np.zeros((5, number))

    def command(self, bodies: RigidBodies, setpoints: Array, idle: Array) -> Array:
        """Return the rotors' thrusts (4, N), in newtons; 0 for `idle` drones.

        `setpoints` (9, N) are positions, velocities and accelerations.
        """
        inputs = self._inputs
        np.subtract(setpoints[:6], bodies.state, out=inputs[:6])
        inputs[9:12] = setpoints[6:]
        inputs[12:] = setpoints[3:6]
        self._integral += self._summing @ inputs[:6]
        _bound(self._integral, -_INTEGRAL_MAX, _INTEGRAL_MAX)
        np.copyto(self._integral, 0.0, where=idle)
        push = self._gains @ inputs
        push[2] += GRAVITY
        _bound(push[2], _UP_MIN, _UP_MAX)
        sideways = np.sqrt(np.square(push[:2]).sum(0))
        push[:2] *= _SIDEWAYS_MAX / np.maximum(sideways, _SIDEWAYS_MAX)
        axes = bodies.wrapped_axes
        np.multiply((push * axes[2]).sum(0), self._mass, out=self._wrench[0])
        np.maximum(self._wrench[0], self._least, out=self._wrench[0])
        push /= np.sqrt(np.square(push).sum(0))
        np.multiply(self._torque_rate(push, bodies), self._inertia, out=self._wrench[1:])
        rates = self._rates
        rates[:3] = bodies.rates
        rates[3:] = bodies.rates[:2]
        self._wrench[1:] += self._gyroscopic * rates[1:4] * rates[2:]
        thrusts = self._unmixing @ self._wrench
        _bound(thrusts, 0.0, self._thrust_max)
        np.copyto(thrusts, 0.0, where=idle)
        return np.asarray(thrusts)

    def reset(self, drone: int) -> None:
        """Reset the controller of `drone`, whose state was invalid."""
        self._inputs[:, drone] = 0
        self._up[:, drone] = [0, 0, 1, 0, 0]

    def _torque_rate(self, up: Array, bodies: RigidBodies) -> Array:
        """Return the angular acceleration (3, N), in the body frame, towards thrust along `up` and front along x."""
        x, y, z = up
        desired, axes = self._desired, bodies.wrapped_axes
        flat = np.sqrt(y * y + z * z)
        desired[0, 0] = flat
        np.divide(z, flat, out=desired[1, 1])
        np.divide(-y, flat, out=desired[1, 2])
        np.multiply(x, desired[1, 2], out=desired[0, 1])
        np.multiply(-x, desired[1, 1], out=desired[0, 2])
        desired[2] = up
        desired[3:] = desired[:2]
        errors = desired[2:] * axes[1:4] - desired[1:4] * axes[2:]
        attitude = errors.sum(1) / 2
        turn = self._turn
        np.subtract(up, self._up[:3], out=turn[:3])
        turn[:3] /= self._dt
        _bound(turn[:3], -_TURN_MAX, _TURN_MAX)
        turn[3:] = turn[:2]
        # The change of the direction, rotated by a right angle, is the angular velocity in the world frame.
        self._up[:3] = up
        self._up[3:] = up[:2]
        desired_rates = self._up[1:4] * turn[2:] - self._up[2:] * turn[1:4]
        rates = bodies.rates - (bodies.axes * desired_rates).sum(1)
        return np.asarray(-_ATTITUDE * attitude - _RATES * rates)


def _bound(values: Array, least: float, most: float) -> None:
    """Clip in place; `np.clip` is slower on small arrays."""
    np.maximum(values, least, out=values)
    np.minimum(values, most, out=values)
