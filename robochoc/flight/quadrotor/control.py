"""The geometric tracking controller on SE(3), for all drones at once.

Lee, Leok, McClamroch, "Geometric tracking control of a quadrotor UAV on SE(3)", CDC 2010, with z up and all drones
looking along x. The integral of position errors is that of Goodarzi, Lee, Lee, "Geometric nonlinear PID control of a
quadrotor UAV on SE(3)", ECC 2013: a constant wind leaves no error. The drag of the planned velocity is fed forward; of
the wind the controller knows nothing.

Ours: the gains, by mass and inertia, as Lee's are of an airframe six times as heavy; the torque that makes up for a
desired angular acceleration is left out; the desired angular velocity is the change of the desired thrust direction by
a difference, and bounded; so are the accelerations that are asked for.
"""

from __future__ import annotations

import numpy as np

from robochoc.flight.quadrotor.airframe import GRAVITY, Airframe, Array
from robochoc.flight.quadrotor.rigid_bodies import RigidBodies

_POSITION, _VELOCITY, _INTEGRAL = 9.0, 5.5, 6.0
"""Gains by the mass: 1/s^2, 1/s, 1/s^2."""
_ERRORS_PER_VELOCITY = 2.0
"""Goodarzi's c1, 1/s: how much of the position error the integral takes up."""
_ATTITUDE = np.array([[280.0], [280.0], [40.0]])
_RATES = np.array([[28.0], [28.0], [12.0]])
"""Gains by the inertia: 1/s^2, 1/s. Turning about z is slow: the rotors' drag torques are small."""
_MOST_INTEGRAL = 1.2
"""m/s: what the integral makes up for at most, by `_INTEGRAL`: a wind of 35 m/s."""
_MOST_SIDEWAYS = 9.0
_LEAST_UP, _MOST_UP = 0.4 * GRAVITY, 2.0 * GRAVITY
"""m/s^2, gravity made up for: drones neither turn over nor let themselves fall."""
_LEAST_THRUST = 0.2
"""Of the weight: without thrust nothing could be turned, not even one that is upside down."""
_MOST_TURN = 8.0
"""rad/s"""


class Controller:
    """What the rotors are to do, so that N drones follow their references."""

    def __init__(self, number: int, airframe: Airframe, dt: float) -> None:
        self._mass = airframe.mass
        self._inertia = np.array(airframe.inertia)[:, None]
        self._gyroscopic = np.roll(self._inertia, -2, 0) - np.roll(self._inertia, -1, 0)
        self._unmixing = np.linalg.inv(airframe.mixing())
        self._strongest = airframe.strongest
        self._least = _LEAST_THRUST * airframe.mass * GRAVITY
        self._dt = dt
        # Rows: errors of position and velocity, the integral, acceleration and velocity that are wanted.
        self._inputs = np.zeros((15, number))
        self._integral = self._inputs[6:9]
        one = np.eye(3)
        drag = airframe.drag / airframe.mass
        self._gains = np.hstack([_POSITION * one, _VELOCITY * one, _INTEGRAL * one, one, drag * one])
        self._summing = np.hstack([_ERRORS_PER_VELOCITY * one, one]) * dt
        self._desired = np.zeros((5, 3, number))
        self._wrench = np.zeros((4, number))
        # Vectors with their first two components once more behind the third: see `RigidBodies`.
        self._up = np.zeros((5, number))
        self._up[2] = 1
        self._turn = np.zeros((5, number))
        self._rates = np.zeros((5, number))

    def command(self, bodies: RigidBodies, reference: Array, idle: Array) -> Array:
        """The rotors' thrusts (4, N), N, of all but the `idle`: `reference` (9, N) is place, velocity, acceleration."""
        inputs = self._inputs
        np.subtract(reference[:6], bodies.state, out=inputs[:6])
        inputs[9:12] = reference[6:]
        inputs[12:] = reference[3:6]
        self._integral += self._summing @ inputs[:6]
        _bound(self._integral, -_MOST_INTEGRAL, _MOST_INTEGRAL)
        np.copyto(self._integral, 0.0, where=idle)
        push = self._gains @ inputs
        push[2] += GRAVITY
        _bound(push[2], _LEAST_UP, _MOST_UP)
        sideways = np.sqrt(np.square(push[:2]).sum(0))
        push[:2] *= _MOST_SIDEWAYS / np.maximum(sideways, _MOST_SIDEWAYS)
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
        _bound(thrusts, 0.0, self._strongest)
        np.copyto(thrusts, 0.0, where=idle)
        return np.asarray(thrusts)

    def forget(self, drone: int) -> None:
        """What is known of a drone's past: its state made no sense."""
        self._inputs[:, drone] = 0
        self._up[:, drone] = [0, 0, 1, 0, 0]

    def _torque_rate(self, up: Array, bodies: RigidBodies) -> Array:
        """The angular acceleration (3, N) towards thrust along `up` and a front along x, in the body's frame."""
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
        _bound(turn[:3], -_MOST_TURN, _MOST_TURN)
        turn[3:] = turn[:2]
        # The direction's change, turned by a right angle: the angular velocity, in the world's frame.
        self._up[:3] = up
        self._up[3:] = up[:2]
        wanted = self._up[1:4] * turn[2:] - self._up[2:] * turn[1:4]
        rates = bodies.rates - (bodies.axes * wanted).sum(1)
        return np.asarray(-_ATTITUDE * attitude - _RATES * rates)


def _bound(values: Array, least: float, most: float) -> None:
    """Clip, in place: `np.clip` takes longer over small arrays."""
    np.maximum(values, least, out=values)
    np.minimum(values, most, out=values)
