"""Whoever of us is killed or stopped, whenever: every vehicle holds or lands, and no process is left.

Vehicles fly slowly here, so that each phase can be met.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")

from tests.support.faults import Run, running
from tests.support.limits import wait_until
from tests.support.mavlink_teams import NAMES, fleet_file, team_folder, udp_ports
from tests.support.mavlink_vehicles import Vehicle, Vehicles
from tests.support.program import PROGRAM

SLOW_MS = 0.8
PHASES: dict[str, Callable[[Vehicle], bool]] = {
    "before": lambda vehicle: not vehicle.armed,
    "climbing": lambda vehicle: vehicle.mode == "takeoff",
    "flying": lambda vehicle: vehicle.mode == "offboard",
    "landing": lambda vehicle: vehicle.mode == "land",
}
VICTIMS = ("program", "guard")


@contextmanager
def flight(folder: Path, *words: str, **settings: object) -> Iterator[tuple[Vehicles, Run]]:
    """A run of four slow vehicles, whose guard is there."""
    ports = udp_ports(len(NAMES))
    vehicles = [Vehicle(port, at=(2.0 * n, 0.0, 0.0), speed=SLOW_MS) for n, port in enumerate(ports)]
    fleet = fleet_file(folder, dict(zip(NAMES, ports, strict=True)), **settings)
    command = [PROGRAM, "solve", str(team_folder(folder)), "--ros", f"mavlink:{fleet}", "--arm", *words]
    with Vehicles(vehicles) as field, running(command, folder / "run") as run:
        wait_until(lambda: run.program("guard") is not None or run.is_over, run.errors)
        yield field, run


def meet(vehicles: Vehicles, run: Run, phase: str) -> None:
    """Wait until a vehicle is in `phase`."""
    wait_until(lambda: any(map(PHASES[phase], vehicles)) or run.is_over, lambda: vehicles.state() + run.errors())
    assert not run.is_over, run.errors()


def victim(run: Run, name: str) -> int:
    found = run.pid if name == "program" else run.program(name)
    assert found is not None
    return found


def all_come_down(vehicles: Vehicles, run: Run) -> None:
    """Nothing is left of the run, and no vehicle in the air."""
    run.end()
    vehicles.wait_until_landed()
    assert run.left_behind() == []


def test_when_the_program_is_killed_the_guard_lands_all(tmp_path: Path) -> None:
    with flight(tmp_path) as (vehicles, run):
        meet(vehicles, run, "climbing")
        run.strike(signal.SIGKILL)
        all_come_down(vehicles, run)
        assert not any("offboard lost" in vehicle.log for vehicle in vehicles)


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
            assert "the guard process has ended" in run.errors()


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_when_both_are_killed_the_failsafe_brings_all_down(tmp_path: Path, phase: str) -> None:
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
        assert not any("offboard lost" in vehicle.log for vehicle in vehicles)


@pytest.mark.slow
def test_vehicles_that_are_to_hold_do_so_when_the_program_is_killed(tmp_path: Path) -> None:
    with flight(tmp_path, end="hold") as (vehicles, run):
        meet(vehicles, run, "flying")
        run.strike(signal.SIGKILL)
        run.end()
        vehicles.wait_until_safe()
        assert all(vehicle.mode == "hold" for vehicle in vehicles if vehicle.flies)


@pytest.mark.slow
def test_a_program_that_stands_still_keeps_the_guard_from_nothing(tmp_path: Path) -> None:
    with flight(tmp_path) as (vehicles, run):
        meet(vehicles, run, "climbing")
        run.strike(signal.SIGSTOP)
        wait_until(lambda: all(vehicle.mode == "offboard" for vehicle in vehicles), vehicles.state)
        run.strike(signal.SIGKILL)
        all_come_down(vehicles, run)
