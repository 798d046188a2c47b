"""DDS: what is published arrives at programs that are not ours, what they report is received; whatever comes."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from robochoc.robots.sink import SinkError
from robochoc.robots.source import REPORTS, ReceivedMessage, SourceError
from robochoc.ros.live import dds as dds_module
from robochoc.ros.live.dds import DdsSink, DdsSource
from robochoc.ros.live.dds_participant import MESSAGE_BYTES_MAX
from robochoc.ros.live.dds_place import DdsPlace, Quality
from robochoc.ros.message_types import types_of
from tests.support.cases import looped
from tests.support.dds import LOOPBACK_ALONE, free_domain, reporter, subscriber
from tests.support.limits import HANG_S, wait_until
from tests.support.program import ROOT, robochoc, robochoc_within

POSE = "geometry_msgs/PoseStamped"
BATTERY = "sensor_msgs/BatteryState"
STRING = "std_msgs/String"
STAMP = 1_700_000_000_123_456_789
WAITS = f"wait={HANG_S:g}"
HANGAR = str(ROOT / "docs" / "examples" / "hangar")
QUALITY = Quality(reliable=True, latched=True, depth=1)


@pytest.fixture(autouse=True)
def _loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK_ALONE)
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)


@pytest.fixture
def domain() -> int:
    return free_domain()


def pose(number: int) -> dict[str, object]:
    place = {"position": {"x": float(number), "y": 0.0, "z": 1.5}, "orientation": {"w": 1.0}}
    return {"header": {"stamp": STAMP, "frame_id": "map"}, "pose": place}


# Places


@looped(
    ("place", "found"),
    [
        ("", DdsPlace(7, QUALITY)),
        ("?depth=3", DdsPlace(7, Quality(reliable=True, latched=True, depth=3))),
        ("0", DdsPlace(0, QUALITY)),
        ("232?", DdsPlace(232, QUALITY)),
        ("5?reliability=best_effort&durability=volatile", DdsPlace(5, Quality(False, False, 1))),
        ("5?wait=0.5&partition=a&partition=b%20c", DdsPlace(5, Quality(True, True, 1, 0.5, ("a", "b c")))),
    ],
)
def test_places(monkeypatch: pytest.MonkeyPatch, place: str, found: DdsPlace) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    options = ("partition", "reliability", "durability", "depth", "wait")
    assert DdsPlace.parse(place, QUALITY, options, SinkError) == found


@looped(
    ("place", "told"),
    [
        ("nonsense", r"'nonsense' is not a DDS domain; expected a number from 0 to 232, as in dds:0"),
        ("233", "'233' is not a DDS domain"),
        ("-1", "'-1' is not a DDS domain"),
        ("٣", "is not a DDS domain"),
        ("5/6", "'5/6' is not a DDS domain"),
        ("1" * 5000, r"is not a DDS domain|'1{50,}\.\.\."),
        ("5?a=b", "'a' is not an option of DDS; known options: partition, reliability, durability, depth, wait"),
        ("5?depth", "the options 'depth' cannot be read; expected OPTION=VALUE&OPTION=VALUE"),
        ("5?partition=a&", "cannot be read"),
        ("5?partition=%ff", "cannot be read"),
        ("?depth=0", "depth=0 is not valid; expected a number from 1 to 1,000"),
        ("?depth=9999", "depth=9999 is not valid"),
        ("?reliability=no", "reliability=no is not valid; expected reliable or best_effort"),
        ("?durability=persistent", "durability=persistent is not valid; expected transient_local or volatile"),
        ("?wait=nan", "wait=nan is not a valid time; expected seconds from 0 to 600"),
        ("?wait=1e9", "wait=1e9 is not a valid time"),
        ("?partition=", "partition= is not a valid name; expected 1 to 255 characters of ASCII"),
        ("?partition=%1b[31m", r"partition=\\x1b\[31m is not a valid name"),
        ("?" + "&".join(["partition=a"] * 17), "at most 16 partitions are allowed"),
    ],
)
def test_places_that_are_none(place: str, told: str) -> None:
    with pytest.raises(SinkError, match=told):
        DdsSink(place)


def test_a_source_waits_for_nobody() -> None:
    with pytest.raises(SourceError, match="'wait' is not an option of DDS"):
        DdsSource("5?wait=1")


def test_the_domain_of_ros_is_heeded(monkeypatch: pytest.MonkeyPatch, domain: int) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    with reporter(domain, {"/a/out_of_order": "String"}) as peer, DdsSource("") as source:
        source.listen({"/a/out_of_order": STRING})
        assert peer.heard() == "matched"
    monkeypatch.setenv("ROS_DOMAIN_ID", "one")
    with pytest.raises(SourceError, match="ROS_DOMAIN_ID is 'one': set it to a whole number from 0 to 232"):
        DdsSource("")


@looped("configuration", ["<Cyc", "file:///nonexistent", "ü"])
def test_a_configuration_that_is_none(monkeypatch: pytest.MonkeyPatch, domain: int, configuration: str) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", configuration)
    with pytest.raises(SinkError, match=rf"domain {domain} of DDS cannot be joined \(.*\); see CYCLONEDDS_URI"):
        DdsSink(str(domain))


def test_the_program_refuses_a_bad_place_in_one_line() -> None:
    done = robochoc_within("solve", HANGAR, "--ros", "dds:nonsense")
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "'nonsense' is not a DDS domain" in done.stderr


# Waypoints


def waypoints_of(folder: str) -> dict[str, str]:
    """The topics of waypoints of the example, as ROS has them."""
    sentences = "".join(file.read_text(encoding="utf-8") for file in Path(folder).glob("*.xml"))
    names = [part.partition('"')[0] for part in sentences.split('<topic name="')[1:]]
    return dict.fromkeys((name.replace(".", "_") for name in names), "PoseStamped")


def recorded(file: Path) -> dict[str, list[tuple[float, float, float, int, str]]]:
    """The waypoints of a recording by topic, as a reader sees them that is not ours."""
    found = defaultdict(list)
    with file.open("rb") as stream:
        for _, channel, _, message in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            if channel.topic.rpartition("/")[2] not in REPORTS:
                at, stamp = message.pose.position, message.header.stamp
                found[channel.topic].append((at.x, at.y, at.z, stamp.sec, message.header.frame_id))
    return dict(found)


def received(said: Any) -> dict[str, list[tuple[float, float, float, int, str]]]:  # noqa: ANN401 - lines of JSON
    found = defaultdict(list)
    for topic, message in said:
        at, header = message["pose"]["position"], message["header"]
        found[topic].append((at["x"], at["y"], at["z"], header["stamp"]["sec"], header["frame_id"]))
    return dict(found)


@pytest.mark.more
def test_every_waypoint_of_the_queens_arrives(domain: int, tmp_path: Path) -> None:
    queens = str(ROOT / "instances" / "queens3d-4")
    with subscriber(domain, waypoints_of(queens)) as peer:
        sinks = ("--ros", f"mcap:{tmp_path}/run.mcap", "--ros", f"dds:{domain}?{WAITS}")
        done = robochoc("solve", queens, "--withdraw", "fewest", "--runtime", "simulator", *sinks)
        assert done.returncode == 0, done.stderr
        assert f"domain {domain} of DDS: 10 waypoints, 6 landings" in done.stderr
        heard = received(peer.rest())
    assert len(heard) == 16
    assert heard == recorded(tmp_path / "run.mcap")


@pytest.mark.parametrize(("depth", "numbers"), [(1, [4]), (3, [2, 3, 4])])
def test_who_comes_late_receives_the_last(domain: int, depth: int, numbers: list[int]) -> None:
    with DdsSink(f"{domain}?wait=0&depth={depth}") as sink:
        for number in range(5):
            sink.publish("/a/waypoint", POSE, pose(number), STAMP)
        with subscriber(domain, {"/a/waypoint": "PoseStamped"}, latched=True) as peer:
            late = [peer.heard() for _ in numbers]
            sink.publish("/a/waypoint", POSE, pose(5), STAMP)
            assert [message["pose"]["position"]["x"] for _, message in [*late, peer.heard()]] == [*numbers, 5]


@pytest.mark.more
def test_a_subscriber_that_asks_for_less_receives_too(domain: int) -> None:
    """It is sent nothing again: what is published before it has found the publisher is lost to it."""
    with (
        subscriber(domain, {"/a/waypoint": "PoseStamped"}, reliable=False, tells_matched=True) as peer,
        DdsSink(f"{domain}?{WAITS}") as sink,
    ):
        sink.advertise({"/a/waypoint": POSE})
        assert peer.heard() == "matched"
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)
        topic, message = peer.heard()
    assert topic == "/a/waypoint"
    assert message["header"]["stamp"] == {"sec": 1_700_000_000, "nanosec": 123_456_789}


@pytest.mark.more
def test_partitions_keep_apart(domain: int) -> None:
    topics = {"/a/waypoint": "PoseStamped"}
    with (
        subscriber(domain, topics, partitions=["hall"], latched=True) as ours,
        subscriber(domain, topics, partitions=["yard"], latched=True) as theirs,
    ):
        with DdsSink(f"{domain}?partition=hall&{WAITS}") as sink:
            sink.publish("/a/waypoint", POSE, pose(1), STAMP)
        assert len([*ours.rest()]) == 1
        assert [*theirs.rest()] == []


def test_nobody_is_waited_for_longer_than_the_place_says(domain: int) -> None:
    with DdsSink(f"{domain}?wait=0.1") as sink:
        sink.advertise({"/a/waypoint": POSE, "/a/battery": BATTERY})
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)


def _stands(thread: Path) -> bool:
    """Whether a thread of another process is stopped, as /proc says."""
    return (thread / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[0] == "T"


@pytest.mark.more
@pytest.mark.skipif(sys.platform != "linux", reason="/proc says whether a process is stopped")
def test_a_subscriber_that_stands_still_ends_it(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dds_module, "STUCK_S", 0.3)
    with subscriber(domain, {"/a/waypoint": "PoseStamped"}) as peer:
        sink = DdsSink(f"{domain}?{WAITS}")
        sink.advertise({"/a/waypoint": POSE})
        os.kill(peer.process.pid, signal.SIGSTOP)
        threads = Path(f"/proc/{peer.process.pid}/task")
        wait_until(lambda: all(_stands(thread) for thread in threads.iterdir()), "it has not stopped")
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)
        with pytest.raises(SinkError, match=r"has not acknowledged any message for 0\.3 s; end it, or publish with"):
            sink.close()
        sink.discard()


def test_what_cannot_be_published(domain: int) -> None:
    with DdsSink(f"{domain}?wait=0") as sink:
        with pytest.raises(SinkError, match="/a cannot be published: std_msgs/String: data must be text"):
            sink.publish("/a", STRING, {"data": 1}, STAMP)
        with pytest.raises(SinkError, match=r"/b cannot be announced in DDS: ROS 2 has no type 'my_msgs/Rover'"):
            sink.publish("/b", "my_msgs/Rover", {}, STAMP)
        with pytest.raises(
            SinkError, match=r"a message on /a has 300,009 bytes: DDS messages may have at most 262,144"
        ):
            sink.publish("/a", STRING, {"data": "x" * 300_000}, STAMP)


# Reports

RELIABLE = "reliability=reliable"
"""What is published once is received, even if the reader learns of the writer later than the writer of the reader."""


def test_reports_are_heard(domain: int) -> None:
    kinds = {"/a/blocked": "PointStamped", "/a/battery": "BatteryState", "/a/out_of_order": "String"}
    wanted = {topic: REPORTS[topic.rpartition("/")[2]] for topic in kinds}
    with reporter(domain, kinds) as peer, DdsSource(f"{domain}?{RELIABLE}") as source:
        source.listen(wanted)
        assert source.next(0) is None
        assert peer.heard() == "matched"
        peer.say("/a/blocked", point=[1.0, 2.0, 3.0])
        before = time.time_ns()
        blocked = expected(source)
        peer.say("/a/battery", percentage=0.25, cell_voltage=[3.5, 3.75], location="bü")
        battery = expected(source)
        peer.say("/a/out_of_order", data="motor \x1b 2")
        broken = expected(source)
        assert source.next(0.01) is None
    assert blocked[:2] == ("/a/blocked", "geometry_msgs/PointStamped")
    assert blocked.fields["point"] == {"x": 1.0, "y": 2.0, "z": 3.0}
    assert before - 60 * 10**9 <= blocked.at_ns <= time.time_ns()
    assert (battery.fields["percentage"], battery.fields["cell_voltage"]) == (0.25, [3.5, 3.75])
    assert (battery.fields["location"], broken.fields) == ("bü", {"data": "motor \x1b 2"})


def expected(source: DdsSource) -> ReceivedMessage:
    message = source.next(HANG_S)
    assert message is not None
    return message


@pytest.mark.more
def test_reports_that_may_be_lost_are_heard(domain: int) -> None:
    """As sensors publish: whoever has not been found yet is sent nothing, and nothing is sent again."""
    with reporter(domain, {"/a/battery": "BatteryState"}, reliable=False) as peer, DdsSource(str(domain)) as source:
        source.listen({"/a/battery": BATTERY})
        assert peer.heard() == "matched"
        message = None
        while message is None:
            peer.say("/a/battery", percentage=0.25)
            message = source.next(0.1)
    assert message.fields["percentage"] == 0.25


@pytest.mark.more
def test_latched_reports_are_heard_where_the_place_asks_for_them(domain: int) -> None:
    topics = {"/a/out_of_order": "String", "/b/out_of_order": "String"}
    with reporter(domain, topics, latched=True) as peer, DdsSource(str(domain)) as first:
        first.listen(dict.fromkeys(topics, STRING))
        assert peer.heard() == "matched"
        peer.say("/a/out_of_order", data="before")
        with DdsSource(f"{domain}?reliability=reliable&durability=transient_local") as source:
            source.listen({"/a/out_of_order": STRING})
            assert expected(source).fields == {"data": "before"}


GARBAGE = (
    b"",
    b"\0\1\0\0",
    b"\0\1\0\0\xff\xff\xff\xffx\0\0\0",
    b"\0\1\0\0\x05\0\0\0no nul",
    b"\0\1\0\0\x03\0\0\0\xff\xfe\0\0",
    b"\0\x07\0\0\x02\0\0\0x\0\0\0",
    b"\x80\1\0\0\x02\0\0\0x\0\0\0",
)


@looped("garbage", GARBAGE)
def test_bytes_that_are_no_message_are_passed_over(domain: int, garbage: bytes) -> None:
    """Cyclone DDS does not let most of them pass; whoever it lets pass changes nothing."""
    with DdsSource(str(domain)) as source:
        source._receive("/a/out_of_order", STRING, garbage)  # noqa: SLF001 - called by a thread of its own
        source._receive("/a/out_of_order", STRING, types_of(2).encode(STRING, {"data": "whole"}))  # noqa: SLF001
        assert expected(source).fields == {"data": "whole"}


@pytest.mark.more
def test_a_message_that_is_too_long_does_not_come(domain: int, capfd: pytest.CaptureFixture[str]) -> None:
    with reporter(domain, {"/a/out_of_order": "String"}) as peer, DdsSource(f"{domain}?{RELIABLE}") as source:
        source.listen({"/a/out_of_order": STRING})
        assert peer.heard() == "matched"
        peer.say("/a/out_of_order", data="x" * MESSAGE_BYTES_MAX)
        peer.say("/a/out_of_order", data="short")
        assert expected(source).fields == {"data": "short"}
    assert capfd.readouterr() == ("", "")


@pytest.mark.more
def test_a_message_of_another_type_does_not_come(domain: int) -> None:
    topics = {"/a/battery": "String", "/b/out_of_order": "String"}
    with reporter(domain, topics) as peer, DdsSource(f"{domain}?{RELIABLE}") as source:
        source.listen({"/a/battery": BATTERY, "/b/out_of_order": STRING})
        with DdsSource(f"{domain}?{RELIABLE}") as other:
            other.listen({"/a/battery": STRING})
            assert peer.heard() == "matched"
            peer.say("/a/battery", data="not a battery")
            peer.say("/b/out_of_order", data="motor 2")
            assert expected(source).topic == "/b/out_of_order"


def test_numbers_that_were_not_measured(domain: int) -> None:
    with DdsSource(str(domain)) as source, DdsSink(f"{domain}?wait=0") as sink:
        source.listen({"/a/battery": BATTERY})
        sink.advertise({"/a/battery": BATTERY})
        wait_until(lambda: sum(sink._participant.subscribers(["/a/battery"])) == 1, "nobody has subscribed")  # noqa: SLF001
        sink.publish("/a/battery", BATTERY, {"voltage": math.nan, "percentage": 0.5}, STAMP)
        fields = expected(source).fields
    assert math.isnan(fields["voltage"])
    assert fields["percentage"] == 0.5


@pytest.mark.slow
def test_what_is_reported_changes_the_problem(domain: int) -> None:
    """Three drones, which are not ours, report before the team decides; the others decide anew."""
    kinds = {"/nose/out_of_order": "String", "/port/battery": "BatteryState", "/fin/blocked": "PointStamped"}
    words = ("solve", HANGAR, "--protocol", "dynabt", "--runtime", "simulator", "--json")
    with reporter(domain, kinds, latched=True) as peer:
        assert peer.process.stdin is not None
        reports = [
            ["/nose/out_of_order", {"data": "motor 2"}],
            ["/port/battery", {"percentage": 0.05}],
            ["/fin/blocked", {"point": [5.0, 2.0, 1.0]}],
        ]
        peer.process.stdin.write("".join(json.dumps(one) + "\n" for one in reports))
        peer.process.stdin.flush()
        place = f"dds:{domain}?reliability=reliable&durability=transient_local"
        done = robochoc(*words, "--situation", place, "--report-timeout", "4")
        assert done.returncode == 0, done.stderr
    first, *_, last = json.loads(done.stdout)["epochs"]
    assert {"nose", "port", "fin"} <= first["assignment"].keys()
    assert not {"nose", "port"} & last["assignment"].keys()
    assert last["assignment"]["fin"] != 1
