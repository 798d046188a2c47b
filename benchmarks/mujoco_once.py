"""MuJoCo's rigid bodies as rotorcraft, driven from outside: run by a Python in which MuJoCo is installed, not by ours.

It reads and writes the lines of `rotorpy_once.py`. MuJoCo has no rotorcraft: each drone is a free body whose rotors are
actuators at the ends of its arms, filtered with the rotors' time constant; drag is a force against the velocity.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from typing import Any

import mujoco  # type: ignore[import-not-found]
import numpy as np
import numpy.typing as npt

FINE_STEPS = 10
"""Steps of MuJoCo in one of ours, where positions are compared."""

Array = npt.NDArray[np.float64]


def main() -> None:
    """Answer all lines."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    asked = json.loads(sys.stdin.readline())
    frame, places, speed = asked["frame"], asked["places"], "speed" in asked
    steps = 1 if speed else FINE_STEPS
    model = mujoco.MjModel.from_xml_string(_world(frame, places, asked["dt"] / steps))
    data = mujoco.MjData(model)
    data.act[:] = asked["hover"]
    drag = len(frame["rotor_pos"]) * frame["k_d"] * asked["speed_of_rotors"]
    if speed:
        began = time.perf_counter()
        for _ in range(asked["speed"]):
            _step(model, data, np.full(model.nu, asked["hover"]), drag)
        _say(time.perf_counter() - began)
        return
    for line in sys.stdin:
        thrusts = np.array(json.loads(line)).T.ravel()
        for _ in range(steps):
            _step(model, data, thrusts, drag)
        _say([_told(data, number) for number in range(len(places))])


def _world(frame: dict[str, Any], places: list[list[float]], step: float) -> str:
    """Return the model in MJCF: nothing touches anything."""
    most = frame["k_eta"] * frame["rotor_speed_max"] ** 2
    moment = frame["k_m"] / frame["k_eta"]
    inertia = f"{frame['Ixx']} {frame['Iyy']} {frame['Izz']}"
    bodies, rotors = [], []
    for number, place in enumerate(places):
        sites = "".join(
            f'<site name="r{number}.{rotor}" pos="{at[0]} {at[1]} {at[2]}"/>'
            for rotor, at in enumerate(frame["rotor_pos"])
        )
        inertial = f'<inertial pos="0 0 0" mass="{frame["mass"]}" diaginertia="{inertia}"/>'
        at = " ".join(map(str, place))
        bodies.append(f'<body pos="{at}"><freejoint/>{inertial}{sites}</body>')
        rotors += [
            f'<general site="r{number}.{rotor}" gear="0 0 1 0 0 {turns * moment}" ctrllimited="true"'
            f' ctrlrange="0 {most}" dyntype="filterexact" dynprm="{frame["tau_m"]}"/>'
            for rotor, turns in enumerate(frame["rotor_directions"])
        ]
    return (
        f'<mujoco><option timestep="{step}" gravity="0 0 -9.81"><flag contact="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody><actuator>{''.join(rotors)}</actuator></mujoco>"
    )


def _step(model: Any, data: Any, thrusts: Array, drag: float) -> None:  # noqa: ANN401 - MuJoCo has no types here
    data.ctrl[:] = thrusts
    data.qfrc_applied.reshape(-1, 6)[:, :3] = -drag * data.qvel.reshape(-1, 6)[:, :3]
    mujoco.mj_step(model, data)


def _told(data: Any, number: int) -> list[list[float]]:  # noqa: ANN401
    """Return position, velocity, rates, and the body's three axes in the world."""
    place, speed = data.qpos.reshape(-1, 7)[number], data.qvel.reshape(-1, 6)[number]
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, place[3:])
    return [part.tolist() for part in (place[:3], speed[:3], speed[3:], *axes.reshape(3, 3).T)]


def _say(what: object) -> None:
    print(json.dumps(what), flush=True)


if __name__ == "__main__":
    main()
