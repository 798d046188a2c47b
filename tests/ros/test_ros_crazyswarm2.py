"""`--ros crazyswarm2`: drones fly by calls of Crazyswarm2's services; a drone without an answer is out of order."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.flight.layout import Point
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import ReceivedMessage, Source
from robochoc.ros.commands import crazyswarm2
from robochoc.ros.commands.commander import RobotPhase, Target
from robochoc.ros.commands.crazyswarm2 import Crazyswarm2Commander, read_crazyflies
from robochoc.ros.commands.swarm_flights import TooCloseError, flights
from robochoc.ros.live.rosbridge_connection import outgoing
from robochoc.ros.live.service_calls import ServiceCalls
from tests.support.cases import looped
from tests.support.dds import LOOPBACK_ALONE, free_domain
from tests.support.nav2_robots import PlayedRobots
from tests.support.program import ROOT

HANGAR = str(ROOT / "docs" / "examples" / "hangar")
NAMES = ("fin", "nose", "port", "roof", "starboard", "tail")
FILE = "robots:\n" + "".join(
    f"  {name}:\n    enabled: true\n    uri: radio://0/80/2M/E7E7E7E70{number}\n"
    f"    initial_position: [{2 * number}, 0, 0]\n    type: cf21\n"
    for number, name in enumerate(NAMES)
)
MORE = """\
  spare:
    enabled: false
    type: cf21
robot_types:
  cf21:
    motion_capture: {enabled: true}
fileversion: 3
"""

pytestmark = pytest.mark.usefixtures("no_ros_here")


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "crazyflies.yaml").write_text(FILE + MORE)
    return tmp_path / "crazyflies.yaml"


# Files and flights


def test_the_drones_of_a_file(file: Path) -> None:
    found = read_crazyflies(file)
    assert [*found] == [*NAMES]
    assert found["port"] == (4.0, 0.0, 0.0)


@looped(
    ("text", "told"),
    lambda: [
        ("robots: []\n", "crazyflies.yaml:1: 'robots' is not a mapping"),
        ("robots:\n  cf1: {enabled: false}\n", "0 enabled robots; expected 1 to 1,000"),
        ("robots:\n  cf1: {enabled: true}\n", "crazyflies.yaml:2: robot cf1 has no initial_position"),
        ("robots:\n  cf1: {initial_position: [0, x, 0]}\n", "'initial_position' of cf1 is not a place"),
        ("all: 5\n", "crazyflies.yaml has no robots"),
    ],
)
def test_what_is_wrong_with_a_file(tmp_path_factory: pytest.TempPathFactory, text: str, told: str) -> None:
    path = tmp_path_factory.mktemp("swarm") / "crazyflies.yaml"
    path.write_text(text)
    with pytest.raises(SinkError) as wrong:
        read_crazyflies(path)
    assert told in str(wrong.value)


@looped(
    ("place", "told"),
    lambda: [
        ("dds:5", "the file of drones is missing, as in crazyswarm2:crazyflies.yaml@dds:5"),
        ("none.yaml", "none.yaml: No such file or directory"),
        ("none.yaml?sped=1@dds:5", "unknown option 'sped'; known: height, speed, distance, patience"),
        ("none.yaml?speed@dds:5", "the options 'speed' cannot be read"),
    ],
)
def test_places_that_are_none(place: str, told: str) -> None:
    with pytest.raises(SinkError) as wrong:
        Crazyswarm2Commander(place)
    assert told in str(wrong.value)


@pytest.mark.parametrize("speed", ["fast", "0", "nan"])
def test_a_speed_has_limits(file: Path, speed: str) -> None:
    with pytest.raises(SinkError, match=f"speed={speed} is not valid; expected 0.05 to 5"):
        Crazyswarm2Commander(f"{file}?speed={speed}@dds:{free_domain()}")


def test_drones_fly_together_or_one_after_the_other() -> None:
    a, b, c = (0.0, 0.0, 1.0), (2.0, 0.0, 1.0), (4.0, 0.0, 1.0)
    assert flights({"a": a, "b": b}, {"a": a}, 1.0) == []
    assert flights({"a": a, "b": b}, {"a": b, "b": c}, 1.0) == [{"a": b, "b": c}], "in step, they keep their distance"
    corner = (2.0, 2.0, 1.0)
    late = flights({"a": a, "b": b}, {"a": c, "b": corner}, 1.2)
    assert late == [{"b": corner}, {"a": c}]
    with pytest.raises(TooCloseError, match="no order of straight flights keeps 1 m between a and b"):
        flights({"a": a, "b": b}, {"a": b, "b": a}, 1.0)
    with pytest.raises(TooCloseError, match="the straight flight of a passes b, which stays in place"):
        flights({"a": a, "b": b}, {"a": c}, 1.0)
    with pytest.raises(TooCloseError, match="the places of a and b are less than 1 m apart"):
        flights({"a": a, "b": b}, {"a": (1.5, 0.0, 1.0)}, 1.0)


def test_a_bridge_gets_durations() -> None:
    assert outgoing({"duration": 2_500_000_000}) == {"duration": {"sec": 2, "nanosec": 500_000_000}}


# Steps


class Silence(Source):
    def listen(self, topics: Mapping[str, str]) -> None:
        pass

    def next(self, wait_s: float) -> ReceivedMessage | None:  # noqa: ARG002 - nothing arrives
        return None

    def close(self) -> None:
        pass


class ScriptedCalls(ServiceCalls):
    """Calls that are answered at once, unless a drone is mute or fails."""

    where = "a script"

    def __init__(self) -> None:
        super().__init__("")
        self.sent: list[tuple[str, Any]] = []
        self.mute = self.failing = ""
        self.is_there = True

    def has_server(self, service: str) -> bool:  # noqa: ARG002 - all or none
        return self.is_there

    def source(self) -> Source:
        return Silence("")

    def close(self) -> None:
        pass

    def _send(self, number: int, service: str, fields: Fields, wait_s: float) -> None:  # noqa: ARG002 - none passes
        goal = fields.get("goal")
        self.sent.append((service, tuple(goal.values()) if goal else fields["height"]))
        if self.failing and service.startswith(self.failing):
            self._put(number, None, "no")
        elif not self.mute or not service.startswith(self.mute):
            self._put(number, {})
            self._put(number, {"again": True})


class Swarm:
    """A commander of two drones, whose clock stands."""

    def __init__(self, commander: Crazyswarm2Commander, calls: ScriptedCalls, clock: list[float]) -> None:
        self.commander, self.calls, self.clock = commander, calls, clock
        self.reports: list[tuple[str, str, Fields]] = []
        commander.observers.append(lambda *report: self.reports.append(report))
        commander.assign({"Nose": "/nose", "Fin": "/fin"})
        commander.may_fly = True

    def fly(self, **targets: Point) -> None:
        self.commander.command({name: Target(at, at[2] < 0, "map", 7) for name, at in targets.items()})

    def finish(self) -> list[tuple[str, Any]]:
        """Let time pass until all steps have ended; return the calls."""
        before = len(self.calls.sent)
        for _ in range(100):
            self.commander.poll(0)
            self.clock[0] += 1.0
        return self.calls.sent[before:]

    def is_busy(self) -> bool:
        return self.commander.is_busy

    def phase(self, name: str) -> RobotPhase:
        return self.commander.robots[name].phase


@pytest.fixture
def swarm(file: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Swarm]:
    calls, clock = ScriptedCalls(), [100.0]
    monkeypatch.setattr(crazyswarm2, "open_calls", lambda _: calls)
    monkeypatch.setattr("robochoc.ros.commands.commander.time.monotonic", lambda: clock[0])
    yield Swarm(Crazyswarm2Commander(f"{file}?height=1@dds:1"), calls, clock)
    monkeypatch.undo()


def test_drones_take_off_fly_and_arrive(swarm: Swarm) -> None:
    swarm.fly(Nose=(2.0, 1.0, 1.0), Fin=(0.0, 0.0, 2.0))
    swarm.commander.poll(0)
    assert swarm.calls.sent == [("/nose/takeoff", 1.0), ("/fin/takeoff", 1.0)]
    assert swarm.is_busy()
    assert swarm.finish() == [("/nose/go_to", (2.0, 1.0, 1.0)), ("/fin/go_to", (0.0, 0.0, 2.0))]
    assert [swarm.phase(name) for name in ("Nose", "Fin")] == [RobotPhase.ARRIVED] * 2
    assert not swarm.is_busy()
    swarm.fly(Nose=(2.0, 1.0, 1.0), Fin=(0.0, 1.0, 2.0))
    assert swarm.finish() == [("/fin/go_to", (0.0, 1.0, 2.0))]
    swarm.fly(Nose=(9.0, 9.0, -1.0))
    assert swarm.finish() == [("/nose/land", crazyswarm2.LANDED_M)]
    assert swarm.phase("Nose") is RobotPhase.IDLE


def test_a_drone_without_an_answer_is_out_of_order(swarm: Swarm) -> None:
    swarm.fly(Nose=(2.0, 1.0, 1.0), Fin=(0.0, 0.0, 2.0))
    swarm.commander.poll(0)
    swarm.calls.mute = "/nose/go_to"
    calls = swarm.finish()
    assert swarm.phase("Nose") is RobotPhase.OUT
    assert swarm.reports == [
        ("Nose", "out_of_order", {"data": "its server has not answered go_to within 10 s"}),
    ]
    assert calls[-1] == ("/nose/land", crazyswarm2.LANDED_M), "it lands, if it can be reached"
    assert swarm.phase("Fin") is RobotPhase.ARRIVED


def test_a_call_that_fails(swarm: Swarm) -> None:
    swarm.calls.failing = "/nose/takeoff"
    swarm.fly(Nose=(2.0, 1.0, 1.0))
    swarm.finish()
    assert swarm.commander.robots["Nose"].why == "its call of takeoff failed: no"
    swarm.fly(Nose=(2.0, 1.0, 1.0))
    assert ("/nose/go_to", (2.0, 1.0, 1.0)) not in swarm.finish()


def test_a_server_that_is_gone(swarm: Swarm) -> None:
    swarm.calls.is_there = False
    swarm.finish()
    assert {robot.why for robot in swarm.commander.out_of_order} == {"its server is gone"}


def test_a_decision_that_brings_drones_too_close_is_not_flown(swarm: Swarm) -> None:
    with pytest.raises(SinkError, match=r"less than 0\.5 m apart; the decision is not flown"):
        swarm.fly(Nose=(2.0, 1.0, 1.0), Fin=(2.0, 1.1, 1.0))
    assert swarm.finish() == []


def test_a_decision_with_a_place_on_the_ground_is_not_flown(swarm: Swarm) -> None:
    with pytest.raises(SinkError, match=r"the waypoint of Fin has the height 0 m, less than 0\.1 m"):
        swarm.fly(Nose=(2.0, 1.0, 1.0), Fin=(0.0, 1.0, 0.0))
    assert swarm.finish() == []


def test_the_end_lands_all_drones(swarm: Swarm, monkeypatch: pytest.MonkeyPatch) -> None:
    swarm.fly(Nose=(2.0, 1.0, 1.0))
    swarm.finish()
    monkeypatch.setattr(crazyswarm2, "END_S", 0.0)
    swarm.commander.end()
    assert swarm.finish() == [("/nose/land", crazyswarm2.LANDED_M)]


# Whole runs


def solved(place: str, *words: str) -> Any:  # noqa: ANN401 - click's result
    given = ["solve", HANGAR, "--runtime", "simulator", "--ros", f"crazyswarm2:{place}", *words]
    return CliRunner().invoke(cli, given, catch_exceptions=False)


def test_without_permission_nothing_flies(file: Path) -> None:
    domain = free_domain()
    with PlayedRobots(f"dds:{domain}", {f"/{name}": "flies" for name in NAMES}, "played_crazyflies") as drones:
        done = solved(f"{file}@dds:{domain}")
        assert done.exit_code == 0, done.stderr
        assert done.stderr.splitlines()[-1].endswith("6 drones seen, none armed (--arm lets them fly)")
        assert drones.past() == []


@pytest.mark.more
def test_drones_fly_their_decision_and_land(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crazyswarm2, "LEAST_S", 0.05)
    domain = free_domain()
    with PlayedRobots(f"dds:{domain}", {f"/{name}": "flies" for name in NAMES}, "played_crazyflies") as drones:
        done = solved(f"{file}?speed=5@dds:{domain}", "--arm")
        assert done.exit_code == 0, done.stderr
        assert done.stderr.splitlines()[-1].endswith("6 sent, 6 arrived")
        calls = {name: [event[1:3] for event in drones.past() if event[0] == f"/{name}"] for name in NAMES}
    assert {name: (made[0][0], made[-1][0]) for name, made in calls.items()} == dict.fromkeys(
        NAMES, ("takeoff", "land")
    )
    assert calls["nose"][-2][0] == "go_to"
    assert calls["nose"][-2][1][:2] == [1.0, 2.0]


@pytest.mark.more
def test_a_mute_drone_leaves_the_team(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(crazyswarm2, "LEAST_S", 0.05)
    domain = free_domain()
    place = f"{file}?speed=5&patience=2@dds:{domain}"
    manners = {f"/{name}": "mute" if name == "nose" else "flies" for name in NAMES}
    with PlayedRobots(f"dds:{domain}", manners, "played_crazyflies"):
        done = solved(place, "--arm", "--situation", f"crazyswarm2:{place}", "--report-timeout", "1")
    assert done.exit_code == 0, done.stderr
    assert "Nose is out of order: its server has not answered takeoff within 2 s" in done.stderr
    assert "-Nose" in done.stdout
