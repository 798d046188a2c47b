"""Parts `rotorpy` and `mujoco`: the simulated flight beside independent simulators, under the same controller."""

from __future__ import annotations

import json
import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from report import Row, Section

from robochoc.flight.coordination.timetable import plan_routes
from robochoc.flight.mission import mission_of
from robochoc.flight.quadrotor.airframe import GRAVITY, HUMMINGBIRD, ROTORS, Array
from robochoc.flight.quadrotor.control import Controller
from robochoc.flight.quadrotor.rigid_bodies import RigidBodies
from robochoc.flight.quadrotor.simulation import DT
from robochoc.formats.team_reader import read_team
from robochoc.model.outcome import Outcome, Verdict

HERE = Path(__file__).parent
HANGAR = HERE.parent / "docs" / "examples" / "hangar"
_HANGAR_LEVELS = {"fin": 2, "nose": 2, "port": 3, "roof": 1, "starboard": 3, "tail": 1}
"""A solution."""
_THRUST_PER_SPEED_SQUARED = 8.54858e-6
_HOVER = HUMMINGBIRD.mass * GRAVITY / ROTORS
_HOVER_SPEED = float(np.sqrt(_HOVER / _THRUST_PER_SPEED_SQUARED))
_MANY = 121

Setpoints = Callable[[float], Array]


class Simulator(NamedTuple):
    """Another simulator.

    Attributes:
        name: Its name.
        python: The environment variable that names a Python in which it is installed.
        program: The file that drives it.
        speed_steps: The number of steps that its speed is measured over.
        notes: What it has of its own.
    """

    name: str
    python: str
    program: str
    speed_steps: int
    notes: str


ROTORPY = Simulator(
    "RotorPy",
    "ROBOCHOC_BENCH_ROTORPY",
    "rotorpy_once.py",
    3,
    "RotorPy 3.0 has rotors that lag in speed with one time constant (here of 19 ms, the mean of ours up and down), "
    "drag that grows with the rotors' speed and acts at them, and adaptive Runge-Kutta steps (tolerance 1e-6).",
)
MUJOCO = Simulator(
    "MuJoCo",
    "ROBOCHOC_BENCH_MUJOCO",
    "mujoco_once.py",
    2000,
    "MuJoCo 4.0 has rigid bodies and actuators, and no rotorcraft: rotors are forces that lag in thrust with one time "
    "constant (here of 19 ms, the mean of ours up and down), and the linear drag is ours, computed outside. It makes "
    "ten semi-implicit Euler steps in one of ours; one, where its speed is measured.",
)


class Case(NamedTuple):
    """A flight for both simulators: starts (3, N) in metres, setpoints (9, N) for a second, its length in seconds."""

    name: str
    starts: Array
    setpoints: Setpoints
    seconds: float


class Difference(NamedTuple):
    """The distances in metres between both simulators' positions in a case, over all drones and steps."""

    case: str
    drones: int
    seconds: float
    rms_m: float
    max_m: float
    end_m: float


def rotorpy() -> Section:
    """The differences of all cases, and RotorPy's speed."""
    return _measured(ROTORPY)


def mujoco() -> Section:
    """The differences of all cases, and MuJoCo's speed."""
    return _measured(MUJOCO)


def _measured(other: Simulator) -> Section:
    notes = (
        "The same Hummingbird (mass, inertia, arms, thrust and drag per rotor speed, highest speed) there and here, "
        "each flown by a controller of ours that sees its own drones, from hovering in calm air. "
        f"{other.notes} `same thrusts`: it is given the thrusts that were commanded here, and nothing corrects it. "
        f"Positions are compared at each step of 1/{1 / DT:.0f} s."
    )
    _, _, routes = cases()
    rows = _rows([*(closed_loop(case, other) for case in cases()), open_loop(routes, 2.0, other)])
    titles = ("Differences", f"{other.name}'s speed")
    return Section(other.name.lower(), f"The flight beside {other.name}'s", notes, (rows, _speed(other)), titles)


def cases() -> list[Case]:
    """Hovering, a step of a metre in each direction, and routes of docs/examples/hangar, 1 m above the ground."""
    here = np.array([[0.0, 0.0, 5.0]])
    starts, goals = _hangar()
    plan = plan_routes(starts, goals, distance=0.6)

    def routes(s: float) -> Array:
        motion = plan.at(s)
        return np.concatenate((motion.position, motion.velocity, motion.acceleration), axis=1).T

    return [
        Case("hover", here, _still(here), 5.0),
        Case("step of 1 m in x, y and z", here, _still(here + 1), 5.0),
        Case("routes of docs/examples/hangar", starts, routes, plan.duration_s + 1),
    ]


def closed_loop(case: Case, other: Simulator) -> Difference:
    """Fly a case here and in another simulator, each under a controller that sees its own drones."""
    ours, _ = _flown_here(case)
    theirs = []
    number = len(case.starts)
    control = Controller(number, HUMMINGBIRD, DT)
    seen = RigidBodies(case.starts, -1.0, HUMMINGBIRD, DT)
    with _driven(other, case.starts) as step:
        for at in range(round(case.seconds / DT)):
            _show(step(control.command(seen, case.setpoints(at * DT), np.zeros(number, dtype=np.bool_))), seen)
            theirs.append(seen.state[:3].copy())
    return _difference(case, case.name, ours, np.array(theirs))


def open_loop(case: Case, seconds: float, other: Simulator) -> Difference:
    """Fly a case here, and its thrusts in another simulator."""
    case = case._replace(seconds=seconds)
    ours, thrusts = _flown_here(case)
    with _driven(other, case.starts) as step:
        theirs = np.array([[drone[0] for drone in step(command)] for command in thrusts]).transpose(0, 2, 1)
    return _difference(case, f"{case.name}, same thrusts", ours, theirs)


def _flown_here(case: Case) -> tuple[Array, list[Array]]:
    """Return positions (T, 3, N) and the thrusts of each step."""
    number = len(case.starts)
    bodies = RigidBodies(case.starts, -1.0, HUMMINGBIRD, DT)
    bodies.stands[:] = False
    bodies.thrusts[:] = _HOVER
    control = Controller(number, HUMMINGBIRD, DT)
    places, thrusts = [], []
    for at in range(round(case.seconds / DT)):
        command = control.command(bodies, case.setpoints(at * DT), np.zeros(number, dtype=np.bool_))
        bodies.step(command, np.zeros((3, 1)))
        places.append(bodies.state[:3].copy())
        thrusts.append(command)
    return np.array(places), thrusts


def _show(told: list[Any], bodies: RigidBodies) -> None:
    """Show the other simulator's drones to a controller, as it sees ours."""
    parts = np.array(told).transpose(1, 2, 0)
    bodies.state[:3], bodies.state[3:], bodies.rates[:] = parts[:3]
    bodies.wrapped_axes[:3] = parts[3:]
    bodies.wrapped_axes[3:] = parts[3:5]


def _difference(case: Case, name: str, ours: Array, theirs: Array) -> Difference:
    apart = np.sqrt(np.square(ours - theirs).sum(1))
    rms = float(np.sqrt(np.square(apart).mean()))
    return Difference(name, len(case.starts), case.seconds, rms, float(apart.max()), float(apart[-1].max()))


def _still(place: Array) -> Setpoints:
    return lambda _: np.concatenate((place.T, np.zeros((6, len(place)))))


def _hangar() -> tuple[Array, Array]:
    team = read_team(HANGAR)
    outcome = Outcome(
        Verdict.SOLUTION, team=team.name, protocol="abt", runtime="simulator", seed=0, assignment=_HANGAR_LEVELS
    )
    mission = mission_of(outcome, team)
    up = np.array([0.0, 0.0, 1.0])
    homes = np.array([drone.home for drone in mission.drones])
    goals = np.array([mission.legs[0].goals[number].at for number in range(len(homes))])
    return homes + up, goals + up


@contextmanager
def _driven(other: Simulator, places: Array, **more: object) -> Iterator[Callable[[Array], Any]]:
    """Yield what advances the other simulator's drones by a step of thrusts (4, N), and returns their states."""
    command = [os.environ[other.python], str(HERE / other.program)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        say, hear = process.stdin, process.stdout
        if say is None or hear is None:
            raise RuntimeError("no pipes")

        def asked(what: object) -> Any:  # noqa: ANN401 - JSON
            say.write(json.dumps(what) + "\n")
            say.flush()
            return json.loads(hear.readline())

        first = {"frame": _frame(), "hover": _HOVER, "speed_of_rotors": _HOVER_SPEED, "places": places.tolist()}
        try:
            say.write(json.dumps({**first, "dt": DT, **more}) + "\n")
            say.flush()
            yield lambda thrusts: json.loads(hear.readline()) if more else asked(thrusts.tolist())
        finally:
            process.kill()


def _frame() -> dict[str, object]:
    """Return the Hummingbird in RotorPy's words."""
    frame = HUMMINGBIRD
    along, across, up = frame.inertia
    drag = frame.drag / ROTORS / _HOVER_SPEED
    return {
        "mass": frame.mass,
        "Ixx": along,
        "Iyy": across,
        "Izz": up,
        "Ixy": 0.0,
        "Ixz": 0.0,
        "Iyz": 0.0,
        "num_rotors": ROTORS,
        "rotor_pos": [[frame.arm, 0, 0], [0, frame.arm, 0], [-frame.arm, 0, 0], [0, -frame.arm, 0]],
        "rotor_directions": [1, -1, 1, -1],
        "rotor_speed_min": 0,
        "rotor_speed_max": float(np.sqrt(frame.thrust_max / _THRUST_PER_SPEED_SQUARED)),
        "k_eta": _THRUST_PER_SPEED_SQUARED,
        "k_m": _THRUST_PER_SPEED_SQUARED * frame.moment,
        "k_d": drag,
        "k_z": drag,
        "tau_m": (frame.lag_up + frame.lag_down) / 2,
    }


def _rows(found: list[Difference]) -> list[Row]:
    rows: list[Row] = [("flown", "drones", "seconds", "RMS, mm", "most, mm", "in the end, mm")]
    for one in found:
        far = (f"{metres * 1e3:.2f}" for metres in (one.rms_m, one.max_m, one.end_m))
        rows.append((one.case, str(one.drones), f"{one.seconds:.1f}", *far))
    return rows


def _speed(other: Simulator) -> list[Row]:
    """Return the speed of both simulators' bodies, which hover."""
    places = np.array([[3.0 * number, 0.0, 5.0] for number in range(_MANY)])
    with _driven(other, places, speed=other.speed_steps) as answer:
        theirs = float(answer(places)) / other.speed_steps
    bodies = RigidBodies(places, -1.0, HUMMINGBIRD, DT)
    bodies.stands[:] = False
    bodies.thrusts[:] = _HOVER
    command, air = np.full((ROTORS, _MANY), _HOVER), np.zeros((3, 1))
    began = time.perf_counter()
    for _ in range(MUJOCO.speed_steps):
        bodies.step(command, air)
    ours = (time.perf_counter() - began) / MUJOCO.speed_steps
    rates = [f"{DT / seconds:.2g}" for seconds in (theirs, ours)]
    return [("drones", f"{other.name}: simulated s a wall s, bodies alone", "ours"), (str(_MANY), *rates)]
