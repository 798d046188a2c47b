"""Sinks and sources of fleets, without links: the guard is a thread, and autopilots are played."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from robochoc.robots.closed_loop import drones_of
from robochoc.robots.sink import Fields
from robochoc.robots.source import SourceError
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.vehicles import guard
from robochoc.vehicles.autopilot import Telemetry
from robochoc.vehicles.fleet import read_fleet
from robochoc.vehicles.guard_client import GuardClient, GuardError, shared
from robochoc.vehicles.mavlink import MavlinkSource
from robochoc.vehicles.messages import VehicleTarget
from tests.support.cases import looped
from tests.support.guard_thread import Flyer, GuardThread
from tests.support.limits import HANG_S
from tests.support.mavlink_teams import NAMES, fleet_file, four_drones, team_folder
from tests.support.played_autopilot import GROUND
from tests.support.program import robochoc_within

PORTS = dict(zip(NAMES, range(14540, 14544), strict=True))


@dataclass
class Field:
    """Four vehicles on the ground below their places."""

    folder: Path
    flyers: dict[str, Flyer] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Put new vehicles there."""
        self.flyers.update({name: Flyer((2.0 * n, 0.0, 0.0)) for n, name in enumerate(NAMES)})

    def fleet(self, **settings: object) -> Path:
        return fleet_file(self.folder, PORTS, **settings)

    def solve(self, fleet: Path, *words: str) -> subprocess.CompletedProcess[str]:
        team = self.folder / "team"
        if not team.exists():
            team_folder(self.folder)
        return robochoc_within("solve", team, "--runtime", "simulator", "--ros", f"mavlink:{fleet}", *words)

    @property
    def done(self) -> list[list[str]]:
        return [one.done for one in self.flyers.values()]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Field]:
    """A field whose guard is a thread."""
    here = Field(tmp_path)
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: GuardThread(here.flyers))
    for name in ("STEP_S", "REPORT_S"):
        monkeypatch.setattr(guard, name, 0.002)
    yield here
    assert not shared._open  # noqa: SLF001 - no guard is left


def test_vehicles_take_off_fly_and_land(here: Field) -> None:
    done = here.solve(here.fleet(), "--arm")
    assert "4 waypoints, 0 landings; 4 flown, 4 landed" in done.stderr
    assert done.returncode == 0
    for flown in here.done:
        assert [word.split()[0] for word in flown] == ["arm", "rise", *["go"] * (len(flown) - 3), "land"]


def test_without_permission_no_vehicle_is_commanded(here: Field) -> None:
    done = here.solve(here.fleet())
    assert "4 waypoints, 0 landings; 4 vehicles seen, none armed (--arm lets them fly)" in done.stderr
    assert done.returncode == 0
    assert here.done == [[]] * 4


@looped("end", ["hold", "land"])
def test_at_the_end_vehicles_do_as_the_fleet_file_says(here: Field, end: str) -> None:
    here.reset()
    assert here.solve(here.fleet(end=end), "--arm").returncode == 0
    assert [flown[-1] for flown in here.done] == [end] * 4


def test_an_order_without_a_permit_is_refused(here: Field) -> None:
    process = GuardClient(read_fleet(here.fleet()))
    try:
        process.fly({"RA": VehicleTarget((0.0, 0.0, 2.0))})
        with pytest.raises(GuardError, match="arming is not permitted, but an order to fly was received"):
            process.wait_for(lambda: False, HANG_S)
    finally:
        process.close()
    assert here.done == [[]] * 4


@looped(
    ("told", "settings"),
    [
        (
            "is outside the fence; the fence is from -1, -1, 0 to 5, 5, 6; the decision is not flown",
            {"fence": "[[-1, -1, 0], [5, 5, 6]]"},
        ),
        (
            "the waypoints of RA and RB are 2.24 m apart; 'distance' is 2.5 m; the decision is not flown",
            {"distance": 2.5},
        ),
        ("RB is at 0, 700, 0, outside the fence", {}),
    ],
)
def test_what_is_refused_before_anything_is_armed(here: Field, told: str, settings: dict[str, object]) -> None:
    here.reset()
    if not settings:
        here.flyers["RB"].seen = replace(GROUND, place=(0.0, 700.0, 0.0))
    elif "fence" in settings:
        here.flyers["RD"].seen = replace(GROUND, place=(4.0, 1.0, 0.0))
    done = here.solve(here.fleet(**settings), "--arm")
    assert told in done.stderr
    assert "fence" not in settings or "the waypoint of RD, 6, 0, " in done.stderr
    assert done.returncode == 1
    assert here.done == [[]] * 4


def test_all_vehicles_that_are_not_heard_are_named_at_once(here: Field) -> None:
    for name in ("RB", "RC", "RD"):
        here.flyers[name].connects, here.flyers[name].seen = False, Telemetry()
    done = here.solve(here.fleet(patience=1), "--arm")
    assert "RB cannot fly: no message received on udpin://" in done.stderr
    assert "within 1 s; RC, RD cannot fly either; nothing was armed" in done.stderr
    assert done.stderr.count("\n") == 1
    assert here.done == [[]] * 4


@looped(
    ("names", "told"),
    [
        (["RA", "RB", "RC"], "there is no vehicle for RD; each drone with a topic needs one"),
        (["RA", "RB", "RC", "RX"], "there is no vehicle for RD; no drone is called RX"),
        ([*NAMES, "RX"], "no drone is called RX; the team's drones are RA, RB, RC, RD"),
    ],
)
def test_drones_and_vehicles_match(here: Field, names: list[str], told: str) -> None:
    here.flyers["RX"] = Flyer((0.0, 4.0, 0.0))
    assert told in here.solve(fleet_file(here.folder, {name: port for port, name in enumerate(names, 14540)})).stderr


@looped(("refused", "why"), [("arm", "it did not arm"), ("rise", "it did not rise 1.4")])
def test_who_refuses_ends_the_flight_of_all(here: Field, refused: str, why: str) -> None:
    here.reset()
    here.flyers["RB"].refuses = {refused}
    done = here.solve(here.fleet(), "--arm")
    assert f"RB is out of order: {why}; the others are brought down" in done.stderr
    assert done.returncode == 1
    assert not any(one.seen.armed for name, one in here.flyers.items() if name != "RB")


# The source


@contextmanager
def listening(fleet: Path) -> Iterator[MavlinkSource]:
    decoder = ReportDecoder(drones_of(four_drones()), "map")
    with MavlinkSource(str(fleet)) as source:
        source.assign(decoder.namespaces)
        source.listen(decoder.topics)
        yield source


def heard(source: MavlinkSource, topic: str) -> Fields:
    """The next message on `topic`."""
    while (received := source.next(HANG_S)) is not None:
        if received.topic == topic:
            return received.fields
    raise AssertionError(topic)


def test_places_and_batteries_are_reported(here: Field) -> None:
    with listening(here.fleet()) as source:
        assert heard(source, "/RC/pose")["pose"]["position"] == {"x": 4, "y": 0, "z": 0}
        assert heard(source, "/RC/battery")["percentage"] == 1
        here.flyers["RC"].seen = replace(here.flyers["RC"].seen, battery=0.5)
        assert heard(source, "/RC/battery")["percentage"] == 0.5
    assert here.done == [[]] * 4


@looped(
    ("trouble", "value", "told"),
    [
        ("battery_in_the_air", 0.05, "7 waypoints, 1 landing; 4 flown, 4 landed"),
        ("refuses", {"arm"}, "4 flown, 3 landed, RB is out of order: it did not arm"),
        ("refuses", {"rise"}, "4 flown, 3 landed, RB is out of order: it did not rise"),
        (
            "seen",
            replace(GROUND, place=(2.0, 0.0, 0.0), healthy=False),
            "RB is out of order: its autopilot is not ready",
        ),
    ],
)
def test_who_falls_out_leaves_and_the_others_decide_anew(here: Field, trouble: str, value: object, told: str) -> None:
    here.reset()
    setattr(here.flyers["RB"], trouble, value)
    fleet = here.fleet()
    words = ["--protocol", "dynabt", "--situation", f"mavlink:{fleet}", "--report-timeout", "0.3", "--arm"]
    done = here.solve(fleet, *words)
    assert "-RB" in done.stdout
    assert told in done.stderr
    assert done.returncode == 0
    assert trouble != "battery_in_the_air" or here.flyers["RB"].done.count("land") == 1


def test_names_of_vehicles_are_those_of_drones(here: Field) -> None:
    with MavlinkSource(str(here.fleet())) as source, pytest.raises(SourceError, match="no drone is called RB"):
        source.assign({"RA": "/RA"})
    with pytest.raises(SourceError, match="No such file or directory"):
        MavlinkSource(str(here.folder / "nowhere.yaml"))
