"""The airframe of the simulated quadrotor: its parameters, and their sources.

The airframe is an AscTec Hummingbird as modelled in RotorS: Furrer, Burri, Achtelik, Siegwart, "RotorS - A Modular
Gazebo MAV Simulator Framework", 2016, and its `hummingbird.xacro`. Its arms lie along the body's x and y axes; z is up.
Its width is 0.54 m from rotor tip to rotor tip.

From RotorS: the masses of body and rotors, the arm length, the inertia of the body, thrust and moment per rotor speed,
the highest rotor speed, the time constants, the drag coefficient. Different from RotorS: the masses of rotors are
points at the ends of the arms; the thrust lags (in RotorS, the rotor speed); drag is linear, the same in all
directions, with the value for hover (in RotorS it grows with the rotor speed, and acts only across the rotor axes).
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from robochoc.system.lazy_dataclass import dataclass

Array = npt.NDArray[np.float64]

GRAVITY = 9.81
ROTORS = 4

_BODY_KG = 0.68
_ROTOR_KG = 0.009
_BODY_INERTIA = (0.007, 0.007, 0.012)
_ARM_M = 0.17
_THRUST_PER_SPEED_SQUARED = 8.54858e-6
_SPEED_MAX = 838.0
_MOMENT_PER_THRUST_M = 0.016
_DRAG_PER_ROTOR = 8.06428e-5


@dataclass(frozen=True)
class Airframe:
    """A quadrotor in SI units. Rotors: front (x), left (y), back, right; the front and back rotors turn clockwise."""

    mass: float
    """kg"""
    inertia: tuple[float, float, float]
    """kg m^2, about the body's axes"""
    arm: float
    """m, from the centre to a rotor's axis"""
    moment: float
    """m, the drag torque of a rotor per thrust"""
    thrust_max: float
    """N, the maximum thrust of a rotor"""
    lag_up: float
    """s, time constant of a rotor's increasing thrust"""
    lag_down: float
    """s, time constant of a rotor's decreasing thrust"""
    drag: float
    """N per m/s, linear drag relative to the air"""

    def mixing(self) -> Array:
        """Return the matrix (4, 4) from the rotors' thrusts to the total thrust and the torques about x, y and z."""
        arm, moment = self.arm, self.moment
        return np.array(
            [[1, 1, 1, 1], [0, arm, 0, -arm], [-arm, 0, arm, 0], [moment, -moment, moment, -moment]], dtype=np.float64
        )


def _hummingbird() -> Airframe:
    mass = _BODY_KG + ROTORS * _ROTOR_KG
    at_ends = _ROTOR_KG * _ARM_M**2
    across, along, up = _BODY_INERTIA
    hover = math.sqrt(mass * GRAVITY / ROTORS / _THRUST_PER_SPEED_SQUARED)
    return Airframe(
        mass=mass,
        inertia=(across + 2 * at_ends, along + 2 * at_ends, up + 4 * at_ends),
        arm=_ARM_M,
        moment=_MOMENT_PER_THRUST_M,
        thrust_max=_THRUST_PER_SPEED_SQUARED * _SPEED_MAX**2,
        lag_up=0.0125,
        lag_down=0.025,
        drag=ROTORS * _DRAG_PER_ROTOR * hover,
    )


HUMMINGBIRD = _hummingbird()
