"""`--use-sim-time`: what is published has the time of the simulation that the source's `/clock` tells."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.robots.closed_loop import ClosedLoop, drones_of
from robochoc.robots.connections import open_source
from robochoc.robots.source import ReceivedMessage, SourceError
from robochoc.ros.recordings.mcap_file import McapSink
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.ros.source_feedback import CLOCK, CLOCK_KIND, SimClock, SourceFeedback
from robochoc.run import Options, Runtime, solve
from tests.support.cases import looped
from tests.support.example_teams import hangar
from tests.support.program import ROOT
from tests.support.ros_ends import SECOND, KeptSink, Tape, WaitedClock, publishers

FOLDER = ROOT / "docs" / "examples" / "hangar"
PORTS = {"point": {"x": 3.0, "y": 1.0, "z": 3.0}}
"""Where Port flies first."""


class Endless(Tape):
    """A live source on which one robot reports its place all the time, after what it was given."""

    def next(self, wait_s: float) -> ReceivedMessage | None:
        assert self.clock is not None
        self.clock.waited_s += min(wait_s, 0.1) or 0.01
        assert self.clock.waited_s < 1_000, "somebody waits for ever"
        return super().next(0) if self.messages else pose()


def tick(seconds: float) -> ReceivedMessage:
    return ReceivedMessage(CLOCK, CLOCK_KIND, {"clock": round(seconds * SECOND)}, 77)


def pose() -> ReceivedMessage:
    return ReceivedMessage("/port/pose", "geometry_msgs/PoseStamped", {"pose": {"position": {"z": 9.0}}}, 0)


def blocked() -> ReceivedMessage:
    return ReceivedMessage("/port/blocked", "geometry_msgs/PointStamped", PORTS, 0)


@pytest.fixture
def waited(monkeypatch: pytest.MonkeyPatch) -> WaitedClock:
    clock = WaitedClock()
    monkeypatch.setattr("robochoc.ros.source_feedback.time", clock)
    return clock


def run(source: Tape, patience_s: float = 60.0) -> KeptSink:
    """What is published in a run."""
    sink = KeptSink()
    feedback = SourceFeedback(source, ReportDecoder(drones_of(hangar()), "map"), patience_s, sim_time=True)
    options = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)
    solve(hangar(), options, environment=ClosedLoop(hangar(), publishers(hangar(), sink), feedback))
    return sink


def test_decisions_and_reports_have_the_time_of_the_simulation(waited: WaitedClock) -> None:
    source = Tape(2.0, tick(100), tick(100.5), blocked(), tick(101), tick(103), clock=waited)
    times = [(topic, at_ns / SECOND) for topic, _, _, at_ns in run(source).said]
    assert source.topics[CLOCK] == CLOCK_KIND
    waypoint = "/port/waypoint"
    assert [at_s for topic, at_s in times if topic == waypoint] == [103, 103]
    assert [at_s for topic, at_s in times if topic == "/port/blocked"] == [103]


def test_a_report_that_came_before_the_first_decision_counts(waited: WaitedClock) -> None:
    """It waits while the clock is read."""
    published = run(Tape(blocked(), tick(5), clock=waited)).topics()
    assert published.count("/port/waypoint") == 2


def test_without_a_clock_the_run_ends_also_where_robots_report_all_the_time(waited: WaitedClock) -> None:
    with pytest.raises(SourceError, match="no time received on /clock of tape within 3 s"):
        run(Endless(clock=waited), 3.0)


def test_reports_that_come_faster_than_they_are_read_keep_no_decision_from_its_time(waited: WaitedClock) -> None:
    feedback = SourceFeedback(
        Endless(tick(5), clock=waited), ReportDecoder(drones_of(hangar()), "map"), 3.0, sim_time=True
    )
    assert feedback.now_ns() == 5 * SECOND
    assert waited.waited_s <= 3.1
    assert feedback.poll() is None  # none of them says where it is
    assert waited.waited_s <= 3.4


def test_without_a_clock_the_run_ends(waited: WaitedClock) -> None:
    told = r"no time received on /clock of tape within 3 s; start the simulation, or omit --use-sim-time"
    with pytest.raises(SourceError, match=told):
        run(Tape(blocked(), clock=waited), patience_s=3)
    assert waited.waited_s == pytest.approx(3, abs=0.5)


@looped(
    "clock",
    [
        *(None, True, "1", 1.5, -1, (1 << 31) * SECOND, 1 << 70),
        *({}, {"sec": 1}, {"sec": -1, "nanosec": 0}, {"sec": 1 << 31, "nanosec": 0}, {"sec": 1, "nanosec": SECOND}),
    ],
)
def test_what_is_no_time_changes_none(clock: object) -> None:
    found = SimClock()
    nothing = ReceivedMessage(CLOCK, CLOCK_KIND, {"clock": clock}, 0)
    assert found.update(nothing)
    assert now_of(found) is None
    assert found.update(tick(2))
    assert found.update(nothing)
    assert now_of(found) == 2 * SECOND
    assert not found.update(blocked())


def now_of(clock: SimClock) -> int | None:
    return clock.now_ns


@pytest.mark.parametrize("names", [("sec", "nanosec"), ("secs", "nsecs")])
def test_a_time_of_a_rosbridge(names: tuple[str, str]) -> None:
    found = SimClock()
    found.update(ReceivedMessage(CLOCK, CLOCK_KIND, {"clock": dict(zip(names, (3, 4), strict=True))}, 0))
    assert found.now_ns == 3 * SECOND + 4


# The command


def recorded(path: Path, *messages: tuple[str, str, dict[str, Any]]) -> str:
    with McapSink(str(path)) as sink:
        for number, (topic, kind, fields) in enumerate(messages, 1):
            sink.publish(topic, kind, fields, number * 10**15)
    return f"mcap:{path}"


def solved(*words: str) -> tuple[int, str]:
    common = ["solve", str(FOLDER), "--protocol", "dynabt", "--runtime", "simulator"]
    done = CliRunner().invoke(cli, [*common, *words], catch_exceptions=False)
    return done.exit_code, done.stderr


def test_a_recording_without_a_clock(tmp_path: Path) -> None:
    place = recorded(tmp_path / "in.mcap", ("/port/blocked", "geometry_msgs/PointStamped", PORTS))
    code, told = solved("--situation", place, "--use-sim-time")
    assert code != 0
    assert told.count("\n") == 1
    assert "before its first report; start the simulation, or omit --use-sim-time" in told


@pytest.mark.parametrize("words", [(), ("--situation", "flight")])
def test_it_needs_a_source(words: tuple[str, ...]) -> None:
    code, told = solved(*words, "--use-sim-time")
    assert code != 0
    assert "--use-sim-time applies to reports of robots: add --situation" in told


@looped("word", [("--tf",), ("--diagnostics",), ("--ros-type", "nav_msgs/Path")])
def test_what_else_is_published_needs_a_sink(word: tuple[str, ...]) -> None:
    code, told = solved("--situation", "flight", *word)
    assert code != 0
    assert f"{word[0]} requires --ros SINK" in told


def test_a_type_without_a_mapping_is_refused(tmp_path: Path) -> None:
    code, told = solved("--ros", f"mcap:{tmp_path}/out.mcap", "--ros-type", "sensor_msgs/Image")
    assert code != 0
    assert "has the type 'sensor_msgs/Image', to which waypoints cannot be converted" in told


def test_a_flight_has_frames(tmp_path: Path) -> None:
    result, out = tmp_path / "result.json", tmp_path / "flight.mcap"
    words = ["solve", str(FOLDER), "--runtime", "simulator", "--json"]
    result.write_text(CliRunner().invoke(cli, words, catch_exceptions=False).stdout, encoding="utf-8")
    flown = ["fly", str(result), "--team", str(FOLDER), "--ros", f"mcap:{out}", "--tf"]
    assert CliRunner().invoke(cli, flown, catch_exceptions=False).exit_code == 0
    with open_source(f"mcap:{out}") as source:
        source.listen({"/tf": "tf2_msgs/TFMessage"})
        first = source.next(0)
    assert first is not None
    frames = [one["child_frame_id"] for one in first.fields["transforms"]]
    assert frames == [f"{name}/base_link" for name in ("fin", "nose", "port", "roof", "starboard", "tail")]
