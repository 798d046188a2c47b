"""Whoever of us is killed or stopped, whenever: every vehicle holds, hovers or lands, and no process is left."""

from __future__ import annotations

import signal
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.support.autopilot_kinds import AutopilotKind, Crazyflie, Px4
from tests.support.faults import Run
from tests.support.limits import wait_until
from tests.support.played_fleet import PlayedFleet

KINDS = [
    pytest.param(kind, id=kind.sink, marks=pytest.mark.skipif(not find_spec(kind.library), reason=f"no {kind.library}"))
    for kind in (Px4(), Crazyflie())
]
PHASES = ("before", "climbing", "flying", "landing")
VICTIMS = ("program", "guard")
pytestmark = pytest.mark.parametrize("kind", KINDS)


def meet(kind: AutopilotKind, vehicles: PlayedFleet[Any], run: Run, phase: str) -> None:
    """Wait until a vehicle is in `phase`."""
    wait_until(lambda: any(map(kind.phases[phase], vehicles)) or run.is_over, lambda: vehicles.state() + run.errors())
    assert not run.is_over, run.errors()


def victim(run: Run, name: str) -> int:
    found = run.pid if name == "program" else run.program(name)
    assert found is not None
    return found


def all_come_down(vehicles: PlayedFleet[Any], run: Run) -> None:
    """Nothing is left of the run, and no vehicle in the air."""
    run.end()
    vehicles.wait_until_landed()
    assert run.left_behind() == []


@pytest.mark.more
def test_when_the_program_is_killed_the_guard_lands_all(kind: AutopilotKind, tmp_path: Path) -> None:
    with kind.flight(tmp_path, **kind.quick) as (vehicles, run):
        meet(kind, vehicles, run, "climbing")
        run.strike(signal.SIGKILL)
        all_come_down(vehicles, run)
        assert all(map(kind.needed_nobody, vehicles))


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("who", VICTIMS)
def test_whoever_is_killed_whenever_all_come_down(kind: AutopilotKind, tmp_path: Path, who: str, phase: str) -> None:
    with kind.flight(tmp_path) as (vehicles, run):
        meet(kind, vehicles, run, phase)
        run.strike(signal.SIGKILL, victim(run, who))
        all_come_down(vehicles, run)
        if who == "guard":
            assert run.status() == 1
            assert kind.without_a_guard in run.errors()


@pytest.mark.slow
@pytest.mark.parametrize("phase", PHASES)
def test_when_both_are_killed_the_firmware_keeps_or_lands_all(kind: AutopilotKind, tmp_path: Path, phase: str) -> None:
    with kind.flight(tmp_path) as (vehicles, run):
        meet(kind, vehicles, run, phase)
        run.strike(signal.SIGKILL, victim(run, "guard"), run.pid)
        run.end()
        vehicles.wait_until_safe()
        assert run.left_behind() == []


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["climbing", "flying"])
@pytest.mark.parametrize(
    ("signum", "who"), [(signal.SIGTERM, "program"), (signal.SIGINT, "program"), (signal.SIGTERM, "guard")]
)
def test_whoever_is_told_to_end_all_come_down(
    kind: AutopilotKind, tmp_path: Path, signum: int, who: str, phase: str
) -> None:
    with kind.flight(tmp_path) as (vehicles, run):
        meet(kind, vehicles, run, phase)
        run.strike(signum, victim(run, who))
        all_come_down(vehicles, run)
        assert all(map(kind.needed_nobody, vehicles))


@pytest.mark.slow
def test_vehicles_that_are_to_hold_do_so_when_the_program_is_killed(kind: AutopilotKind, tmp_path: Path) -> None:
    with kind.flight(tmp_path, end="hold") as (vehicles, run):
        meet(kind, vehicles, run, "flying")
        run.strike(signal.SIGKILL)
        run.end()
        vehicles.wait_until_safe()
        assert all(kind.holds(vehicle) for vehicle in vehicles if vehicle.flies)


@pytest.mark.slow
def test_a_program_that_stands_still_keeps_the_guard_from_nothing(kind: AutopilotKind, tmp_path: Path) -> None:
    with kind.flight(tmp_path) as (vehicles, run):
        meet(kind, vehicles, run, "climbing")
        run.strike(signal.SIGSTOP)
        wait_until(lambda: all(map(kind.phases["flying"], vehicles)), vehicles.state)
        run.strike(signal.SIGKILL)
        all_come_down(vehicles, run)
