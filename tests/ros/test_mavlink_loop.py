"""The loop closed by autopilots: a vehicle falls out, the team decides anew, and the others fly on."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import takewhile
from pathlib import Path

import pytest

pytest.importorskip("mavsdk")

from robochoc.ros.autopilots.mavlink import MavlinkSource
from robochoc.ros.closed_loop import drones_of
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.ros.source import ReceivedMessage, SourceError
from tests.support.faults import Run, running
from tests.support.limits import HANG_S, wait_until
from tests.support.mavlink_field import mavlink_field
from tests.support.mavlink_teams import four_drones, team_folder
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
@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        ({"refuses": {"arm"}}, "it did not arm (command denied)"),
        ({"refuses": {"takeoff"}}, "it did not take off (command denied)"),
        ({"silent_from": "offboard"}, "its link has been silent for 5 s"),
        ({"healthy": False}, "its autopilot is not ready to arm"),
    ],
)
def test_who_falls_out_leaves_and_the_others_decide_anew(tmp_path: Path, trouble: dict[str, object], why: str) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet):
        for name, value in trouble.items():
            setattr(vehicles[1], name, value)
        done = solve(tmp_path, fleet)
        assert openings(done) == WITHOUT_RB
        assert f"4 flown, 3 landed, RB is out of order: {why}" in done.stderr
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


# The source


@contextmanager
def listening(fleet: Path) -> Iterator[MavlinkSource]:
    decoder = ReportDecoder(drones_of(four_drones()), "map")
    with MavlinkSource(str(fleet)) as source:
        source.assign(decoder.namespaces)
        source.listen(decoder.topics)
        yield source


def heard(source: MavlinkSource, topic: str) -> ReceivedMessage:
    """The next message on `topic`."""
    while True:
        received = source.next(HANG_S)
        assert received is not None
        if received.topic == topic:
            return received


@pytest.mark.more
def test_places_and_batteries_are_reported(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet), listening(fleet) as source:
        place = heard(source, "/RC/pose").fields["pose"]["position"]
        assert place == pytest.approx({"x": 4, "y": 0, "z": 0}, abs=0.01)
        assert heard(source, "/RC/battery").fields["percentage"] == 1
        vehicles[2].battery = 0.5
        assert heard(source, "/RC/battery").fields["percentage"] == pytest.approx(0.5)
        assert [vehicle.log for vehicle in vehicles] == [[]] * 4


@pytest.mark.slow
def test_who_is_not_heard_is_out_of_order(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (vehicles, fleet), listening(fleet) as source:
        vehicles[3].silent = True
        assert "it is not heard on udpin" in heard(source, "/RD/out_of_order").fields["data"]


@pytest.mark.more
def test_a_source_whose_guard_is_gone_says_so(tmp_path: Path) -> None:
    with mavlink_field(tmp_path) as (_, fleet), listening(fleet) as source:
        os.kill(source._guard.pid, signal.SIGKILL)  # noqa: SLF001 - as the system might

        def read_on() -> None:
            while source.next(HANG_S):
                pass

        with pytest.raises(SourceError, match="the guard process has ended"):
            read_on()
