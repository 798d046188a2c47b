"""RotorPy's rotorcraft, driven from outside: run by a Python in which RotorPy is installed, not by ours.

It reads lines of JSON. The first says the airframe, the step and where the drones are; each other one has the rotors'
thrusts of a step, and is answered by the drones' state after it. A first line with `speed` is answered by the seconds
that so many steps of drones that hover take, in RotorPy's own settings.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor  # type: ignore[import-not-found]
from scipy.spatial.transform import Rotation

FINE = {"method": "RK45", "rtol": 1e-6, "atol": 1e-9}


def main() -> None:
    """Answer all lines."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    asked = json.loads(sys.stdin.readline())
    parameters = {key: np.array(value) if isinstance(value, list) else value for key, value in asked["frame"].items()}
    parameters["rotor_pos"] = {f"r{number}": np.array(at) for number, at in enumerate(asked["frame"]["rotor_pos"])}
    hover = np.full(4, asked["hover"])
    states = [_state(place, asked["speed_of_rotors"]) for place in asked["places"]]
    if "speed" in asked:
        crafts = [Multirotor(parameters, state, "cmd_motor_thrusts") for state in states]
        began = time.perf_counter()
        for _ in range(asked["speed"]):
            states = _stepped(crafts, states, [hover] * len(crafts), asked["dt"])
        _say(time.perf_counter() - began)
        return
    crafts = [Multirotor(parameters, state, "cmd_motor_thrusts", integrator_kwargs=FINE) for state in states]
    for line in sys.stdin:
        thrusts = np.array(json.loads(line))
        states = _stepped(crafts, states, list(thrusts.T), asked["dt"])
        _say([_told(state) for state in states])


def _state(place: list[float], rotors: float) -> dict[str, Any]:
    still = {name: np.zeros(3) for name in ("v", "w", "wind")}
    return {**still, "x": np.array(place), "q": np.array([0.0, 0.0, 0.0, 1.0]), "rotor_speeds": np.full(4, rotors)}


def _stepped(crafts: list[Any], states: list[Any], thrusts: list[Any], dt: float) -> list[Any]:
    return [
        craft.step(state, {"cmd_motor_thrusts": thrust}, dt)
        for craft, state, thrust in zip(crafts, states, thrusts, strict=True)
    ]


def _told(state: dict[str, Any]) -> list[list[float]]:
    """Return position, velocity, rates, and the body's three axes in the world."""
    axes = Rotation.from_quat(state["q"]).as_matrix().T
    return [*(state[name].tolist() for name in ("x", "v", "w")), *axes.tolist()]


def _say(what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main()
