"""Autopilots by MAVLink: played vehicles are armed, fly, hold and land, and none of them without being told to."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("mavsdk")

from robochoc.robots.closed_loop import drones_of
from robochoc.robots.sink import SinkError, Waypoint
from robochoc.vehicles import guard_client
from robochoc.vehicles.fleet import read_fleet
from robochoc.vehicles.guard_client import GuardClient, GuardError
from robochoc.vehicles.mavlink import MavlinkSink
from robochoc.vehicles.messages import FlightPhase, VehicleTarget
from tests.support.cases import looped
from tests.support.limits import HANG_S
from tests.support.mavlink_field import ON_EARTH, STANDS, mavlink_field, solve
from tests.support.mavlink_teams import NAMES, fleet_file, four_drones, team_folder, udp_ports
from tests.support.mavlink_vehicles import Vehicle
from tests.support.program import robochoc_within


def reached(vehicle: Vehicle) -> list[str]:
    return [line.removeprefix("reached ") for line in vehicle.log if line.startswith("reached")]


@pytest.mark.more
def test_without_permission_vehicles_are_seen_and_none_is_commanded(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        done = solve(tmp_path, fleet)
        assert f"{fleet}: 4 waypoints, 0 landings; 4 vehicles seen, none armed (--arm lets them fly)" in done.stderr
        assert done.returncode == 0
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


def test_vehicles_take_off_reach_their_places_and_land(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        done = solve(tmp_path, fleet, "--arm")
        assert f"{fleet}: 4 waypoints, 0 landings; 4 flown, 4 landed" in done.stderr
        assert done.returncode == 0
        for n, vehicle in enumerate(vehicles):
            (place,) = reached(vehicle)
            assert place.startswith(f"{2 * n},0,")
            assert vehicle.takeoff_m == pytest.approx(1.4)
            assert [line for line in vehicle.log if "reached" not in line] == [
                *("armed", "takeoff", "took off", "hold", "offboard", "land", "landed", "hold"),
            ]
        assert len({reached(vehicle)[0][-1] for vehicle in vehicles}) > 1


@pytest.mark.more
def test_at_the_end_vehicles_may_hold(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, end="hold") as (vehicles, fleet):
        done = solve(tmp_path, fleet, "--arm")
        assert "4 flown, 4 hold" in done.stderr
        assert all(vehicle.mode == "hold" and vehicle.armed and vehicle.flies for vehicle in vehicles)


@pytest.mark.more
def test_places_on_the_earth(tmp_path: Path) -> None:
    with mavlink_field(tmp_path, origin=ON_EARTH) as (vehicles, fleet):
        assert solve(tmp_path, fleet, "--arm").returncode == 0
        for vehicle in vehicles:
            east, north, up = map(float, reached(vehicle)[-1].split(","))
            assert (east, north, up - round(up)) == pytest.approx((0, 0, 0), abs=0.02)
            assert up > 0.9


# What is refused before anything is armed


@pytest.mark.more
def test_a_link_that_is_silent_ends_with_one_message(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        vehicles[2].silent = True
        done = solve(tmp_path, fleet, "--arm")
        assert "RC cannot fly: no message received on udpin://127.0.0.1:" in done.stderr
        assert "within 5 s; nothing was armed" in done.stderr
        assert done.stderr.count("\n") == 1
        assert done.returncode == 1
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


@pytest.mark.more
def test_a_link_that_cannot_be_opened(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (_, fleet):
        fleet.write_text(fleet.read_text().replace("udpin://127.0.0.1", "udpin://no.such.host.invalid"))
        done = solve(tmp_path, fleet)
        assert "RA cannot fly: udpin://no.such.host.invalid" in done.stderr


@looped(
    ("words", "told"),
    [
        (["--arm"], "--arm requires --ros mavlink:FILE, crazyflie:FILE or crazyswarm2:FILE"),
        (
            ["--arm", "--ros", "mcap:run.mcap"],
            "--arm requires --ros mavlink:FILE, crazyflie:FILE or crazyswarm2:FILE; mcap:run.mcap cannot arm vehicles",
        ),
        (["--ros", "mavlink"], "mavlink: the fleet file is missing; name a fleet file, as in mavlink:fleet.yaml"),
        (["--ros", "mavlink:nowhere.yaml"], "nowhere.yaml: No such file or directory; name a fleet file"),
    ],
)
@pytest.mark.usefixtures("in_a_folder")
def test_options_that_do_not_fit(tmp_path: Path, words: list[str], told: str) -> None:
    done = robochoc_within("solve", team_folder(tmp_path), *words)
    assert told in done.stderr
    assert done.returncode in {1, 2}


# What goes wrong on the way


@pytest.mark.parametrize(
    ("refused", "why"),
    [
        pytest.param("arm", "it did not arm (command denied)", marks=pytest.mark.more),
        pytest.param("takeoff", "it did not take off (command denied)", marks=pytest.mark.slow),
    ],
)
def test_who_refuses_ends_the_flight_of_all(tmp_path: Path, refused: str, why: str) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        vehicles[1].refuses = {refused}
        done = solve(tmp_path, fleet, "--arm")
        assert f"RB is out of order: {why}; the others are brought down" in done.stderr
        assert done.returncode == 1
        vehicles.wait_until_landed()


@pytest.mark.slow
@pytest.mark.parametrize("has_camera", [False, True])
def test_who_loses_its_link_ends_the_flight_and_lands_by_itself(tmp_path: Path, *, has_camera: bool) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        vehicles[1].silent_from, vehicles[1].has_camera = "offboard", has_camera
        done = solve(tmp_path, fleet, "--arm")
        assert "RB is out of order: its link has been silent for 5 s; the others are brought down" in done.stderr
        vehicles.wait_until_landed()
        assert "offboard lost" in vehicles[1].log


@pytest.mark.slow
@pytest.mark.parametrize("origin", [{}, {"origin": ON_EARTH}])
def test_who_no_longer_knows_its_place_ends_the_flight_and_lands(tmp_path: Path, origin: dict[str, Any]) -> None:
    with mavlink_field(tmp_path, patience=3, **origin) as (vehicles, fleet):
        vehicles[1].lost_from = "offboard"
        done = solve(tmp_path, fleet, "--arm")
        assert "RB is out of order: no place reported for 3 s; the others are brought down" in done.stderr
        vehicles.wait_until_landed()
        assert "offboard lost" not in vehicles[1].log


# The guard process


def waypoints_of_four() -> list[Waypoint]:
    kind = "geometry_msgs/PoseStamped"
    return [
        Waypoint(n, f"/{name}/waypoint", kind, (x, y, 2.0), lands=False, frame="map", stamp=0)
        for n, (name, (x, y, _)) in enumerate(zip(NAMES, STANDS, strict=True))
    ]


def drones_targets() -> Mapping[str, VehicleTarget]:
    return {name: VehicleTarget((x, y, 2.0)) for name, (x, y, _) in zip(NAMES, STANDS, strict=True)}


@contextmanager
def guarded(fleet: Path) -> Iterator[GuardClient]:
    guard = GuardClient(read_fleet(fleet))
    try:
        yield guard
    finally:
        guard.close()


def all_in(guard: GuardClient, phase: FlightPhase) -> Callable[[], bool]:
    return lambda: [state.phase for state in guard.states.values()] == [phase] * len(NAMES)


def test_a_guard_may_say_nothing_for_longer_at_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mute = tmp_path / "python"
    mute.write_text("#!/bin/sh\ncat >/dev/null\nexit 0\n", encoding="utf-8")
    mute.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(mute))
    monkeypatch.setattr(guard_client, "SILENT_S", -1.0)
    with guarded(fleet_file(tmp_path, {"RA": udp_ports(1)[0]})) as guard:
        guard.check()
        monkeypatch.setattr(guard_client, "START_S", -1.0)
        with pytest.raises(GuardError, match="no message from the guard process for -1 s"):
            guard.check()


@pytest.mark.more
def test_a_guard_that_hears_nothing_more_lands_all(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        with guarded(fleet) as guard:
            guard.permit()
            assert guard.wait_for(all_in(guard, FlightPhase.READY), HANG_S)
            guard.fly(drones_targets())
            assert guard.wait_for(all_in(guard, FlightPhase.ARRIVED), HANG_S)
        vehicles.wait_until_landed()
        assert not any("offboard lost" in vehicle.log for vehicle in vehicles)


def test_an_order_to_an_ended_guard_reports_what_vehicles_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also before the reader of its messages has seen the end."""
    monkeypatch.setattr(GuardClient, "_read", lambda _: None)
    with mavlink_field(tmp_path) as (_, fleet), guarded(fleet) as guard:
        guard._process.kill()  # noqa: SLF001 - as the system might
        guard._process.wait()  # noqa: SLF001
        with pytest.raises(GuardError, match="has ended; vehicles follow their own failsafe"):
            guard.permit()


@pytest.mark.more
def test_a_sink_whose_guard_is_gone_says_so(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (_, fleet):
        sink = MavlinkSink(str(fleet))
        try:
            sink.assign(drones_of(four_drones()))
            sink.allow_arming()
            sink._guard._process.kill()  # noqa: SLF001 - as the system might
            with pytest.raises(SinkError, match="the guard process has ended; vehicles follow their own failsafe"):
                sink.decide(waypoints_of_four())
        finally:
            sink.discard()
