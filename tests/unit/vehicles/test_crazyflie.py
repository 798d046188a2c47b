"""Crazyflies: played ones are armed, fly, hold and land, and none of them without being told to."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("cflib")

from robochoc.vehicles.cflib_autopilot import PEAK
from robochoc.vehicles.fleet import read_fleet
from robochoc.vehicles.guard_client import GuardClient
from robochoc.vehicles.kinds import VehicleKind
from robochoc.vehicles.messages import FlightPhase, VehicleTarget
from tests.support.crazyflie_firmware import Crazyfly
from tests.support.crazyflie_teams import crazyflie_field, solve
from tests.support.limits import HANG_S, wait_until
from tests.support.mavlink_teams import NAMES


def reached(vehicle: Crazyfly) -> list[str]:
    return [line.removeprefix("goto ") for line in vehicle.log if line.startswith("goto")]


def all_ready(guard: GuardClient) -> bool:
    return [state.phase for state in guard.states.values()] == [FlightPhase.READY] * len(NAMES)


@pytest.mark.more
def test_without_permission_crazyflies_are_seen_and_none_is_commanded(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        done = solve(tmp_path, fleet)
        assert f"{fleet}: 4 waypoints, 0 landings; 4 vehicles seen, none armed (--arm lets them fly)" in done.stderr
        assert done.returncode == 0
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


@pytest.mark.parametrize("arms_itself", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_crazyflies_take_off_reach_their_places_and_land(tmp_path: Path, arms_itself: bool) -> None:  # noqa: FBT001
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        for vehicle in vehicles:
            vehicle.arms_itself = arms_itself
        done = solve(tmp_path, fleet, "--arm")
        assert f"{fleet}: 4 waypoints, 0 landings; 4 flown, 4 landed" in done.stderr
        assert done.returncode == 0
        for n, vehicle in enumerate(vehicles):
            (place,) = reached(vehicle)
            assert place.startswith(f"{2 * n},0,")
            steps = ["takeoff", f"goto {place}", "land", "landed"]
            assert vehicle.log == (steps if arms_itself else ["armed", *steps, "disarmed by itself"])
            rise, way, descent = vehicle.paths
            assert rise[0] == pytest.approx((2 * n, 0, 1.4))
            assert rise[1] == pytest.approx(PEAK * 1.4)
            assert not rise[2]
            assert not way[2]  # a smooth path, from a hover
            assert descent[0] == (2.0 * n, 0, 0)
        assert len({reached(vehicle)[0][-1] for vehicle in vehicles}) > 1


@pytest.mark.more
def test_speed_is_that_of_the_fleet_file(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path, haste=40, speed=2, takeoff=0.5) as (vehicles, fleet):
        assert solve(tmp_path, fleet, "--arm").returncode == 0
        for vehicle in vehicles:
            rise, way, _ = vehicle.paths
            assert rise[1] == pytest.approx(PEAK * 0.5 / 2)
            assert way[1] == pytest.approx(max(PEAK * (way[0][2] - 0.5) / 2, 0.5), rel=0.05)


@pytest.mark.slow
def test_at_the_end_crazyflies_may_hold(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path, end="hold") as (vehicles, fleet):
        done = solve(tmp_path, fleet, "--arm")
        assert "4 flown, 4 hold" in done.stderr
        assert all(vehicle.flies and vehicle.planner == "flying" for vehicle in vehicles)
        assert all(vehicle.log[-1] == "hold" for vehicle in vehicles)


@pytest.mark.slow
def test_where_a_crazyflie_was_switched_on(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        text = fleet.read_text()
        for n, vehicle in enumerate(vehicles):
            vehicle.at = (0.0, 0.0, 0.0)
            link = f"udp://127.0.0.1:{vehicle.port}"
            text = text.replace(link, f"{{link: '{link}', at: [{2 * n}, 0, 0]}}")
        fleet.write_text(text)
        assert solve(tmp_path, fleet, "--arm").returncode == 0
        assert all(reached(vehicle)[0].startswith("0,0,") for vehicle in vehicles)


# What is refused before anything is armed


@pytest.mark.more
def test_a_crazyflie_that_is_not_there_ends_with_one_message(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        vehicles[2].silent = True
        done = solve(tmp_path, fleet, "--arm")
        assert f"RC cannot fly: no message received on udp://127.0.0.1:{vehicles[2].port} within 5 s" in done.stderr
        assert done.stderr.count("\n") == 1
        assert done.returncode == 1
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        ({"version": 10}, "its firmware has version 10 of the protocol: update it to version 12"),
        ({"lacks": {"supervisor.info"}}, "its firmware lacks a required log variable (Variable supervisor.info not"),
    ],
)
def test_firmware_that_is_too_old(tmp_path: Path, trouble: dict[str, object], why: str) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        for name, value in trouble.items():
            setattr(vehicles[1], name, value)
        done = solve(tmp_path, fleet, "--arm")
        assert f"RB cannot fly: {why}" in done.stderr
        assert done.stderr.count("\n") == 1
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("link", "why"),
    [
        ("udp://no.such.host.invalid:19850", "cannot be opened ("),
        ("radio://9/80/2M/E7E7E7E7E7", "cannot be opened ("),
    ],
)
def test_a_link_that_cannot_be_opened(tmp_path: Path, link: str, why: str) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        fleet.write_text(fleet.read_text().replace(f"udp://127.0.0.1:{vehicles[0].port}", link))
        done = solve(tmp_path, fleet)
        assert f"RA cannot fly: {link} {why}" in done.stderr
        assert done.returncode == 1


@pytest.mark.slow
def test_a_port_at_which_nobody_is(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        fleet.write_text(fleet.read_text().replace(str(vehicles[0].port), "9"))
        done = solve(tmp_path, fleet)
        assert "RA cannot fly: no message received on udp://127.0.0.1:9 within 5 s" in done.stderr


# What goes wrong on the way


@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        pytest.param({"refuses": {"arm"}}, "it did not arm (command denied)", marks=pytest.mark.more),
        pytest.param({"refuses": {"takeoff"}}, "it did not take off (command denied)", marks=pytest.mark.slow),
        pytest.param({"tumbled": True}, "it does not stand upright", marks=pytest.mark.slow),
        pytest.param({"locked": True}, "it is locked: restart it", marks=pytest.mark.slow),
        pytest.param({"low_power": True}, "its battery is low", marks=pytest.mark.slow),
    ],
)
def test_who_cannot_fly_ends_the_flight_of_all(tmp_path: Path, trouble: dict[str, object], why: str) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        for name, value in trouble.items():
            setattr(vehicles[1], name, value)
        done = solve(tmp_path, fleet, "--arm")
        assert f"RB is out of order: {why}; the others are brought down" in done.stderr
        assert done.returncode == 1
        vehicles.wait_until_landed()
        assert not any("low-level set point" in vehicle.log for vehicle in vehicles)


@pytest.mark.slow
def test_answers_that_are_lost_are_asked_for_again(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        for vehicle in vehicles:
            vehicle.deaf = {"arm", "takeoff", "land", "goto"}
        done = solve(tmp_path, fleet, "--arm")
        assert "4 flown, 4 landed" in done.stderr


@pytest.mark.slow
def test_who_loses_its_link_hovers_and_the_others_land(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        vehicles[1].silent_above = 0.5
        done = solve(tmp_path, fleet, "--arm")
        assert "RB is out of order: its link has been silent for 5 s; the others are brought down" in done.stderr
        vehicles.wait_until_safe()
        assert vehicles[1].flies
        assert vehicles[0].is_down


@pytest.mark.slow
def test_whose_battery_is_low_on_the_way_lands(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        guard = GuardClient(read_fleet(fleet, VehicleKind.CRAZYFLIE))
        try:
            guard.permit()
            assert guard.wait_for(lambda: all_ready(guard), HANG_S)
            guard.fly({"RB": VehicleTarget((2, 0, 2))})
            wait_until(lambda: vehicles[1].at[2] > 1.9, vehicles.state)
            vehicles[1].low_power = True
            vehicles.wait_until_landed()
            assert guard.states["RB"].why == "its battery is low"
        finally:
            guard.close()


@pytest.mark.slow
@pytest.mark.parametrize("lost", ["silent", "gone"])
def test_who_is_heard_again_lands(tmp_path: Path, lost: str) -> None:
    with crazyflie_field(tmp_path) as (vehicles, fleet):
        guard = GuardClient(read_fleet(fleet, VehicleKind.CRAZYFLIE))
        try:
            guard.permit()
            assert guard.wait_for(lambda: all_ready(guard), HANG_S)
            guard.fly({"RB": VehicleTarget((2, 0, 2))})
            wait_until(lambda: vehicles[1].flies, vehicles.state)
            setattr(vehicles[1], lost, True)
            assert guard.wait_for(lambda: "RB" in guard.states and guard.states["RB"].phase is FlightPhase.OUT, HANG_S)
            assert vehicles[1].flies
            setattr(vehicles[1], lost, False)
            vehicles.wait_until_landed()
        finally:
            guard.close()


@pytest.mark.slow
def test_who_is_taken_over_by_hand_is_left_alone(tmp_path: Path) -> None:
    with crazyflie_field(tmp_path, haste=4) as (vehicles, fleet):
        vehicles[1].hand_after = "takeoff"
        done = solve(tmp_path, fleet, "--arm")
        assert "RB is out of order: it no longer follows set points: its mode is manual" in done.stderr
        assert "land" not in vehicles[1].log
