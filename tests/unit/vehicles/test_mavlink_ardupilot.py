"""ArduCopter, played: its modes, its arming and its take-off differ from PX4's. It flies all the same."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")

from tests.support.faults import running
from tests.support.limits import wait_until
from tests.support.mavlink_field import ON_EARTH, mavlink_field, solve
from tests.support.mavlink_teams import team_folder
from tests.support.program import PROGRAM

SLOW_MS = 0.8


@pytest.mark.more
def test_copters_take_off_reach_their_places_and_land(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, is_ardupilot=True) as (vehicles, fleet):
        done = solve(tmp_path, fleet, "--arm")
        assert f"{fleet}: 4 waypoints, 0 landings; 4 flown, 4 landed" in done.stderr, vehicles.state()
        for n, vehicle in enumerate(vehicles):
            assert vehicle.takeoff_m == pytest.approx(1.4)
            flown = [line for line in vehicle.log if "reached" not in line and line != "refused takeoff"]
            assert flown == [
                *("offboard", "armed", "takeoff", "took off", "offboard", "land", "landed", "hold"),
            ]
            assert vehicle.log[-4].startswith(f"reached {2 * n},0,")
    assert vehicles.nearest_m >= 1


@pytest.mark.slow
def test_copters_fly_to_places_on_the_earth(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, is_ardupilot=True, origin=ON_EARTH) as (vehicles, fleet):
        assert "4 flown, 4 landed" in solve(tmp_path, fleet, "--arm").stderr, vehicles.state()


@pytest.mark.slow
def test_copters_that_are_left_to_themselves_are_landed_by_another_guard(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, SLOW_MS, is_ardupilot=True) as (vehicles, fleet):
        command = [PROGRAM, "solve", str(team_folder(tmp_path)), "--ros", f"mavlink:{fleet}", "--arm"]
        with running(command, tmp_path / "run") as run:
            wait_until(lambda: any(one.flies and one.mode == "offboard" for one in vehicles) or run.is_over, run.errors)
            guard = run.program("guard")
            assert guard is not None, run.errors()
            run.strike(signal.SIGKILL, guard)
            run.end()
            vehicles.wait_until_landed()
            assert run.status() == 1


@pytest.mark.slow
@pytest.mark.parametrize(("mode", "told"), [("posctl", "posctl"), ("rtl", "return to launch")])
def test_a_copter_that_a_person_takes_over_is_left_alone(tmp_path: Path, mode: str, told: str) -> None:
    with mavlink_field(tmp_path, SLOW_MS, is_ardupilot=True) as (vehicles, fleet):
        command = [PROGRAM, "solve", str(team_folder(tmp_path)), "--ros", f"mavlink:{fleet}", "--arm"]
        with running(command, tmp_path / "run") as run:
            wait_until(lambda: (vehicles[1].flies and vehicles[1].mode == "offboard") or run.is_over, vehicles.state)
            vehicles[1].target, vehicles[1].mode = vehicles[1].at, mode
            run.end()
            assert f"RB is out of order: it no longer follows set points: its mode is {told} (" in run.errors()
            assert vehicles[1].mode == mode
            assert vehicles[1].flies
            wait_until(lambda: not any(one.flies for one in vehicles if one is not vehicles[1]), vehicles.state)
