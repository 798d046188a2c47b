"""Whoever of us is killed or stopped, whenever: every Crazyflie lands or hovers, none falls, and no process is left.

Crazyflies fly slowly here, so that each phase can be met.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("cflib")

from tests.support.crazyflie_teams import crazyflie_field
from tests.support.crazyflies import Crazyflies, Crazyfly
from tests.support.faults import Run, running
from tests.support.limits import wait_until
from tests.support.mavlink_teams import team_folder
from tests.support.program import PROGRAM

SLOW = 2.0
PHASES: dict[str, Callable[[Crazyfly], bool]] = {
    "before": lambda vehicle: not vehicle.armed,
    "climbing": lambda vehicle: bool(vehicle.log) and vehicle.log[-1] == "takeoff" and vehicle.flies,
    "flying": lambda vehicle: bool(vehicle.log) and vehicle.log[-1].startswith("goto"),
    "landing": lambda vehicle: vehicle.planner == "landing",
}
VICTIMS = ("program", "guard")


@contextmanager
def flight(folder: Path, *words: str, **settings: object) -> Iterator[tuple[Crazyflies, Run]]:
    """A run of four slow Crazyflies, whose guard is there."""
    with crazyflie_field(folder, SLOW, **settings) as (vehicles, fleet):
        command = [PROGRAM, "solve", str(team_folder(folder)), "--ros", f"crazyflie:{fleet}", "--arm", *words]
        with running(command, folder / "run") as run:
            wait_until(lambda: run.program("guard") is not None or run.is_over, run.errors)
            yield vehicles, run


def meet(vehicles: Crazyflies, run: Run, phase: str) -> None:
    """Wait until a Crazyflie is in `phase`."""
    wait_until(lambda: any(map(PHASES[phase], vehicles)) or run.is_over, lambda: vehicles.state() + run.errors())
    assert not run.is_over, run.errors()


def victim(run: Run, name: str) -> int:
    found = run.pid if name == "program" else run.program(name)
    assert found is not None
    return found


def all_come_down(vehicles: Crazyflies, run: Run) -> None:
    """Nothing is left of the run, and no Crazyflie in the air."""
    run.end()
    vehicles.wait_until_landed()
    assert run.left_behind() == []


def test_when_the_program_is_killed_the_guard_lands_all(tmp_path: Path) -> None:
    with flight(tmp_path, takeoff=0.5) as (vehicles, run):
        meet(vehicles, run, "climbing")
        run.strike(signal.SIGKILL)
        all_come_down(vehicles, run)


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("who", VICTIMS)
def test_whoever_is_killed_whenever_all_come_down(tmp_path: Path, who: str, phase: str) -> None:
    with flight(tmp_path) as (vehicles, run):
        meet(vehicles, run, phase)
        run.strike(signal.SIGKILL, victim(run, who))
        all_come_down(vehicles, run)
        if who == "guard":
            assert run.status() == 1
            assert "the guard process has ended; vehicles fly to where they were sent, and hover there" in run.errors()


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_when_both_are_killed_all_hover_or_land_by_themselves(tmp_path: Path, phase: str) -> None:
    with flight(tmp_path) as (vehicles, run):
        meet(vehicles, run, phase)
        run.strike(signal.SIGKILL, victim(run, "guard"), run.pid)
        run.end()
        vehicles.wait_until_safe()
        assert run.left_behind() == []


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["climbing", "flying"])
@pytest.mark.parametrize(
    ("signum", "who"), [(signal.SIGTERM, "program"), (signal.SIGINT, "program"), (signal.SIGTERM, "guard")]
)
def test_whoever_is_told_to_end_all_come_down(tmp_path: Path, signum: int, who: str, phase: str) -> None:
    with flight(tmp_path) as (vehicles, run):
        meet(vehicles, run, phase)
        run.strike(signum, victim(run, who))
        all_come_down(vehicles, run)


@pytest.mark.slow
def test_crazyflies_that_are_to_hold_do_so_when_the_program_is_killed(tmp_path: Path) -> None:
    with flight(tmp_path, end="hold") as (vehicles, run):
        meet(vehicles, run, "flying")
        run.strike(signal.SIGKILL)
        run.end()
        vehicles.wait_until_safe()
        assert all(vehicle.log[-1] == "hold" for vehicle in vehicles if vehicle.flies)
