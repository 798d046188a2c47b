"""The loop closed by autopilots: a vehicle falls out, the team decides anew, and the others fly on."""

from __future__ import annotations

import os
import signal
import subprocess
from itertools import takewhile
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")

from robochoc.robots.source import SourceError
from robochoc.vehicles.mavlink import MavlinkSource
from tests.support.faults import Run, running
from tests.support.limits import HANG_S, wait_until
from tests.support.mavlink_field import mavlink_field
from tests.support.mavlink_teams import NAMES, team_folder
from tests.support.program import PROGRAM, robochoc_within

WAIT_S = "1"
"""The run is over when nothing has changed for so long after all are there."""
WITHOUT_RB = ["the start", "-RB"]


def words(folder: Path, fleet: Path, *more: str) -> list[str]:
    place = f"mavlink:{fleet}"
    common = ["--protocol", "dynabt", "--ros", place, "--situation", place, "--report-timeout", WAIT_S]
    return ["solve", str(team_folder(folder)), *common, "--arm", *more]


def solve(folder: Path, fleet: Path) -> subprocess.CompletedProcess[str]:
    return robochoc_within(*words(folder, fleet, "--runtime", "simulator"))


def openings(done: subprocess.CompletedProcess[str]) -> list[str]:
    """What opened the epochs, in the table of a report."""
    assert "opened by" in done.stdout, done.stderr
    lines = done.stdout.splitlines()
    table = lines[next(n for n, line in enumerate(lines) if "opened by" in line) + 1 :]
    return [" ".join(line.split()[1:-4]) for line in takewhile(lambda line: line.split()[0].isdigit(), table)]


@pytest.mark.more
def test_whose_battery_empties_lands_and_the_others_decide_anew(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        vehicles[1].drain = 3.0
        done = solve(tmp_path, fleet)
        assert openings(done) == WITHOUT_RB
        assert f"{fleet}: 7 waypoints, 1 landing; 4 flown, 4 landed" in done.stderr
        assert done.returncode == 0
        assert not any(vehicle.armed for vehicle in vehicles)
        assert vehicles[1].log.count("land") == 1


@pytest.mark.slow
def test_who_loses_its_link_leaves_and_the_others_decide_anew(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        vehicles[1].silent_from = "offboard"
        done = solve(tmp_path, fleet)
        assert openings(done) == WITHOUT_RB
        assert "4 flown, 3 landed, RB is out of order: its link has been silent for 5 s" in done.stderr
        vehicles.wait_until_landed()


@pytest.mark.slow
def test_a_slow_flight_is_waited_for(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, speed=0.7) as (vehicles, fleet):
        vehicles[1].drain = 0.3
        done = solve(tmp_path, fleet)
        assert openings(done) == WITHOUT_RB
        assert "4 flown, 4 landed" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("who", ["program", "guard", "robot"])
def test_whoever_is_killed_in_a_closed_loop_all_land_or_hold(tmp_path: Path, who: str) -> None:
    with mavlink_field(tmp_path, speed=1.0) as (vehicles, fleet):
        command = [PROGRAM, *words(tmp_path, fleet, "--runtime", "processes")]
        with running(command, tmp_path / "run") as run:
            wait_until(lambda: any(one.mode == "offboard" for one in vehicles) or run.is_over, vehicles.state)
            run.strike(signal.SIGKILL, _victim(run, who))
            run.end()
            vehicles.wait_until_safe()
            assert run.left_behind() == []
            assert who == "robot" or run.status() != 0


def _victim(run: Run, who: str) -> int:
    found = run.pid if who == "program" else run.program("guard") if who == "guard" else run.robot("RC")
    assert found is not None, run.errors()
    return found


@pytest.mark.more
def test_a_source_whose_guard_is_gone_says_so(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (_, fleet), MavlinkSource(str(fleet)) as source:
        source.assign({name: f"/{name}" for name in NAMES})
        os.kill(source._guard.pid, signal.SIGKILL)  # noqa: SLF001 - as the system might

        def read_on() -> None:
            while source.next(HANG_S):
                pass

        with pytest.raises(SourceError, match="the guard process has ended"):
            read_on()
