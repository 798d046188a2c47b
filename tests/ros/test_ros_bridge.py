"""rosbridge: what is published arrives, what is reported is received; whatever the server does, the run ends."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.robots.inbox import MessageInbox
from robochoc.robots.sink import SinkError
from robochoc.robots.source import ReceivedMessage, SourceError
from robochoc.ros.live import rosbridge_connection
from robochoc.ros.live.rosbridge import RosbridgeSink, RosbridgeSource
from robochoc.ros.live.rosbridge_connection import MalformedMessageError, RosbridgeAddress, incoming, outgoing
from tests.support.cases import looped
from tests.support.examples import examples
from tests.support.fake_servers import fake_server
from tests.support.limits import HANG_S
from tests.support.rosbridge_server import Manner, Server, begin_the_loop_of_roslibpy

POSE = "geometry_msgs/PoseStamped"
STAMP = 1_700_000_000_123_456_789
TIMES = {"secs": 1_700_000_000, "nsecs": 123_456_789}
BLOCKED = {"header": {"stamp": {"sec": 5, "nanosec": 7}, "frame_id": "map"}, "point": {"x": 1.0, "y": 2, "z": None}}
GARBAGE = (
    "no JSON",
    "[1, 2]",
    "{}",
    b"\x00\x01",
    '{"op": "publish"}',
    '{"op": "publish", "topic": "/a/blocked", "msg": 17}',
    '{"op": "publish", "topic": "/a/blocked", "msg": {"header": {"stamp": "now"}}}',
    '{"op": "publish", "topic": "/a/blocked", "msg": {"header": {"stamp": {"secs": 1e300, "nsecs": 0}}}}',
    json.dumps({"op": "publish", "topic": "/b", "msg": {}}),
    '{"op": "publish", "topic": "/a/blocked", "msg": ' + "[" * 60_000,
    '{"op": "publish", "topic": "/a/blocked", "msg": {"x": ' + "[" * 200 + "]" * 200 + "}}",
    '{"op": "publish", "topic": "/a/blocked", "msg": {"x": ' + "9" * 6000 + "}}",
    '{"op": "publish", "topic": "error", "msg": {}}',
    '{"op": "publish", "topic": "ready", "msg": {}}',
    '{"op": "service_response", "id": "nobody asked"}',
    '{"op": "call_service", "service": "close_me"}',
    '{"op": "status", "level": "error", "msg": "no such type"}',
    '{"op": "what?"}',
)


def pose(number: int) -> dict[str, object]:
    place = {"position": {"x": float(number), "y": 0.0, "z": 1.5}, "orientation": {"w": 1.0}}
    return {"header": {"stamp": STAMP, "frame_id": "map"}, "pose": place}


SHORT_S = 0.1


def publish_long(sink: RosbridgeSink, times: int) -> None:
    for _ in range(times):
        sink.publish("/a", "std_msgs/String", {"data": "x" * 50_000}, STAMP)


@pytest.fixture(autouse=True, scope="module")
def loop() -> None:
    begin_the_loop_of_roslibpy()


@pytest.fixture(autouse=True)
def impatient(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """What makes sinks and sources wait so long, as long as a test says, for what never comes. The rest has time."""
    for name in ("CONNECT_S", "DRAIN_S", "LOOP_S", "CONFIRM_S", "CLOSE_S"):
        monkeypatch.setattr(rosbridge_connection, name, HANG_S)

    def waits(*names: str) -> None:
        for name in names:
            monkeypatch.setattr(rosbridge_connection, name, SHORT_S)

    return waits


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as server:
        yield server
    assert server.wrong == []


def test_what_is_published_arrives_in_order(server: Server) -> None:
    topics = {f"/drone{number}/waypoint": POSE for number in range(5)}
    with RosbridgeSink(server.place) as sink:
        sink.advertise(topics)
        for number in range(300):
            sink.publish(f"/drone{number % 5}/waypoint", POSE, pose(number), STAMP)
    assert server.advertised == topics
    assert [topic for topic, _ in server.published] == [f"/drone{number % 5}/waypoint" for number in range(300)]
    for number, (_, message) in enumerate(server.published):
        assert message == {**pose(number), "header": {"stamp": TIMES, "frame_id": "map"}}
    assert server.wait_for(lambda: server.log[-1] == "closed")
    assert server.log.index("publish") == 5


def test_numbers_that_were_not_measured(server: Server) -> None:
    with RosbridgeSink(server.place) as sink:
        sink.publish("/a/battery", "sensor_msgs/msg/BatteryState", {"voltage": math.nan, "cell_voltage": [3.5]}, STAMP)
    assert server.advertised == {"/a/battery": "sensor_msgs/BatteryState"}
    ((_, message),) = server.published
    assert math.isnan(message["voltage"])
    assert message["cell_voltage"] == [3.5]


def test_sinks_after_each_other_and_at_a_time(server: Server) -> None:
    for number in range(2):
        with RosbridgeSink(server.place) as sink:
            sink.publish(f"/a{number}", POSE, pose(number), STAMP)
        assert server.wait_for(lambda: not server.handlers)
    assert [topic for topic, _ in server.published] == ["/a0", "/a1"]
    with RosbridgeSink(server.place) as one, RosbridgeSink(server.place) as other:
        one.publish("/one", POSE, pose(1), STAMP)
        other.publish("/other", POSE, pose(2), STAMP)
    assert sorted(topic for topic, _ in server.published[2:]) == ["/one", "/other"]


def test_a_server_that_answers_no_service_has_read_all_when_it_closes(impatient: Callable[..., None]) -> None:
    impatient("CONFIRM_S")
    with Server(Manner(answers_services=False)) as server:
        with RosbridgeSink(server.place) as sink:
            sink.publish("/a", POSE, pose(1), STAMP)
        assert len(server.published) == 1


def test_nobody_listens() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with pytest.raises(SinkError, match=rf"no rosbridge listens at ws://127.0.0.1:{port} \(.*refused\); start it"):
        RosbridgeSink(f"//127.0.0.1:{port}")
    with pytest.raises(SourceError, match="no rosbridge listens"):
        RosbridgeSource(f"//127.0.0.1:{port}")


@looped("answer", [b"", b"HTTP/1.1 404 Not Found\r\n\r\n", b"\xff" * 100_000])
def test_what_listens_is_no_rosbridge(answer: bytes, impatient: Callable[..., None]) -> None:
    impatient("CONNECT_S", "CLOSE_S")
    refusal = pytest.raises(SinkError, match="does not answer as a rosbridge; start it")
    with fake_server(answer, hangs_up=False) as port, refusal:
        RosbridgeSink(f"//127.0.0.1:{port}")


def test_the_server_dies() -> None:
    with Server(Manner(dies_after=3)) as server:
        sink = RosbridgeSink(server.place)
        for number in range(3):
            sink.publish("/a", POSE, pose(number), STAMP)
        with pytest.raises(SinkError, match="has closed the connection; see its log"):
            sink.close()
        sink.discard()
        with pytest.raises(SinkError, match="has closed the connection"):
            sink.publish("/a", POSE, pose(3), STAMP)


def test_the_server_reads_nothing(impatient: Callable[..., None]) -> None:
    impatient("DRAIN_S", "CONFIRM_S", "CLOSE_S")
    with Server(Manner(stalls=True)) as server:
        sink = RosbridgeSink(server.place)
        with pytest.raises(SinkError, match=r"has not read any data for 0\.1 s"):
            publish_long(sink, 2000)
        sink.discard()


def test_the_server_does_not_even_read_the_end(impatient: Callable[..., None]) -> None:
    impatient("CONFIRM_S", "CLOSE_S")
    with Server(Manner(stalls=True)) as server:
        sink = RosbridgeSink(server.place)
        sink.publish("/a", POSE, pose(1), STAMP)
        with pytest.raises(SinkError, match="has not confirmed that it has read all"):
            sink.close()


def test_the_server_complains() -> None:
    complaint = "Unable to import moon_msgs.msg\x1b[31m"
    with Server(Manner(complains=complaint)) as server:
        sink = RosbridgeSink(server.place)
        sink.publish("/a", "moon_msgs/Rover", {}, STAMP)
        with pytest.raises(SinkError, match=r"reports an error: Unable to import moon_msgs.msg\\x1b\[31m; see its log"):
            sink.close()


def test_reports_are_heard(server: Server) -> None:
    with RosbridgeSource(server.place) as source:
        source.listen({"/a/blocked": "geometry_msgs/PointStamped", "/a/battery": "sensor_msgs/BatteryState"})
        assert server.wait_for(lambda: server.log.count("subscribe") == 2)
        assert source.next(0) is None
        before = time.time_ns()
        server.say("/a/blocked", BLOCKED)
        server.say("/a/battery", {"header": {"stamp": TIMES}, "percentage": 0.25})
        server.say("/nobody/asked", {})
        first, second = source.next(HANG_S), source.next(HANG_S)
        assert first is not None
        assert second is not None
        assert first[:2] == ("/a/blocked", "geometry_msgs/PointStamped")
        assert first.fields["header"] == {"stamp": 5_000_000_007, "frame_id": "map"}
        assert math.isnan(first.fields["point"]["z"])
        assert before <= first.at_ns <= time.time_ns()
        assert second.fields == {"header": {"stamp": STAMP}, "percentage": 0.25}
        assert source.next(0.01) is None


@looped("garbage", GARBAGE)
def test_garbage_is_passed_over_or_ends_it(garbage: str | bytes, capfd: pytest.CaptureFixture[str]) -> None:
    """A frame that is no text ends the connection: rosbridge sends none without being asked."""
    with Server(Manner(garbage=(garbage,))) as server, RosbridgeSource(server.place) as source:
        source.listen({"/a/blocked": "geometry_msgs/PointStamped"})
        assert server.wait_for(lambda: "subscribe" in server.log)
        server.say("/a/blocked", BLOCKED)
        if isinstance(garbage, bytes):
            with pytest.raises(SourceError, match="has closed the connection"):
                source.next(HANG_S)
        else:
            received = source.next(HANG_S)
            assert received is not None
            assert received.fields["point"]["x"] == 1
    assert capfd.readouterr() == ("", "")


def test_a_message_that_is_too_long_ends_it() -> None:
    with Server() as server, RosbridgeSource(server.place) as source:
        source.listen({"/a/blocked": "geometry_msgs/PointStamped"})
        assert server.wait_for(lambda: "subscribe" in server.log)
        server.say("/a/blocked", {"x": "x" * (rosbridge_connection.MESSAGE_BYTES_MAX + 1)})
        with pytest.raises(SourceError, match="has closed the connection"):
            source.next(HANG_S)


def test_a_server_that_dies_wakes_who_waits(server: Server) -> None:
    with RosbridgeSource(server.place) as source:
        source.listen({"/a": "std_msgs/String"})
        assert server.wait_for(lambda: "subscribe" in server.log)
        dying = threading.Timer(0.05, server.die)
        dying.start()
        with pytest.raises(SourceError, match="has closed the connection"):
            source.next(HANG_S)
        dying.join()


PROGRAM = """
import sys
from robochoc.ros.live.rosbridge import RosbridgeSink, RosbridgeSource
from robochoc.robots.sink import SinkError
source = RosbridgeSource(sys.argv[1])
source.listen({"/a": "std_msgs/String"})
sink = RosbridgeSink(sys.argv[1])
try:
    for number in range(100_000):
        sink.publish("/a", "std_msgs/String", {"data": "x" * 1000}, 0)
except SinkError as failed:
    print(failed)
"""


@pytest.mark.more
def test_a_program_whose_server_dies_ends_in_silence(tmp_path: Path) -> None:
    """Neither the loop's thread nor a source that nobody closes keep it, and nothing is said but by us."""
    (tmp_path / "program.py").write_text(PROGRAM, encoding="utf-8")
    with Server(Manner(dies_after=50)) as server:
        command = [sys.executable, "program.py", server.place]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=HANG_S, check=False)
    assert done.returncode == 0
    assert "has closed the connection" in done.stdout
    assert done.stderr == ""


@looped(
    ("place", "url"),
    [
        ("//localhost:9090", "ws://localhost:9090"),
        ("//localhost", "ws://localhost:9090"),
        ("robot-7:80", "ws://robot-7:80"),
        ("//[::1]:9091", "ws://[::1]:9091"),
        ("wss://robots.example:443/bridge", "wss://robots.example:443/bridge"),
        ("ws://robots.example", "ws://robots.example:9090"),
    ],
)
def test_places(place: str, url: str) -> None:
    assert RosbridgeAddress.parse(place).url == url


@looped(
    "place",
    ["", "//", "//:9090", "//host:0", "//host:port", "//host:99999", "http://host:9090", "//me:pw@host", "//[x"],
)
def test_no_places(place: str) -> None:
    with pytest.raises(SinkError, match="expected rosbridge://HOST:PORT"):
        RosbridgeSink(place)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text() | st.just("stamp"), inner, max_size=4),
)


@examples(25)
@given(JSON)
def test_whatever_comes_is_fields_or_refused(message: object) -> None:
    try:
        fields, weight = incoming(message)
    except MalformedMessageError:
        return
    assert isinstance(message, dict)
    assert fields.keys() == message.keys()
    assert weight >= len(message)


STAMPED = st.recursive(
    st.floats(allow_nan=False) | st.text() | st.integers(),
    lambda inner: (
        st.dictionaries(st.text(max_size=5).filter(lambda name: name != "stamp"), inner, max_size=3)
        | st.lists(inner, max_size=3)
    ),
    max_leaves=6,
)


@examples(25)
@given(
    st.integers(0, 2**32 * 10**9 - 1),
    st.dictionaries(st.text(max_size=5).filter(lambda name: name != "stamp"), STAMPED, max_size=3),
)
def test_what_we_send_we_understand(stamp: int, fields: dict[str, object]) -> None:
    sent = {**fields, "header": {"stamp": stamp}}
    assert incoming(json.loads(json.dumps(outgoing(sent))))[0] == sent


def test_a_loud_topic_does_not_push_out_others() -> None:
    inbox = MessageInbox(per_topic=10, weight=1000)
    inbox.put(ReceivedMessage("/blocked", "a", {}, 0))
    for number in range(100):
        inbox.put(ReceivedMessage("/battery", "b", {}, number))
    inbox.put(ReceivedMessage("/long", "c", {}, 0), 900)
    inbox.put(ReceivedMessage("/long", "c", {}, 1), 980)
    received = []
    while (one := inbox.get(0)) is not None:
        received.append((one.topic, one.at_ns))
    assert received == [("/blocked", 0), *(("/battery", number) for number in range(90, 100)), ("/long", 1)]
