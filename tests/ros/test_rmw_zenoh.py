"""rmw_zenoh: what we say in zenoh is what ROS 2 hears there, and what comes from there is heard, or does no harm."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
import zenoh.ext

from robochoc.communication.network.zenoh_config import config
from robochoc.robots.connections import open_sink, open_source
from robochoc.robots.sink import SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live import rmw_zenoh_session
from robochoc.ros.live.rmw_zenoh import MESSAGE_BYTES_MAX, RmwZenohSink, RmwZenohSource
from robochoc.ros.live.rmw_zenoh_keys import RosNode, ZenohTopic, attachment
from robochoc.ros.live.rmw_zenoh_session import RouterAddress
from robochoc.ros.message_types import types_of
from robochoc.ros.type_hashes import type_hash
from tests.support.cases import looped
from tests.support.fake_servers import fake_server
from tests.support.limits import HANG_S, wait_until
from tests.support.ports import free_port
from tests.support.zenoh_ros2 import FarEnd, Router

POSE, POINT, TEXT = "geometry_msgs/PoseStamped", "geometry_msgs/PointStamped", "std_msgs/String"
BATTERY = "sensor_msgs/BatteryState"
STAMP = 1_700_000_000_123_456_789
POSE_HASH = type_hash(POSE)
POSE_KEY = f"geometry_msgs::msg::dds_::PoseStamped_/{POSE_HASH}"
TEXT_HASH = type_hash(TEXT)
TEXT_KEY = f"std_msgs::msg::dds_::String_/{TEXT_HASH}"

pytestmark = pytest.mark.usefixtures("no_ros_here")


def pose(number: int) -> dict[str, object]:
    place = {"position": {"x": float(number), "y": 0.0, "z": 1.5}, "orientation": {"w": 1.0}}
    return {"header": {"stamp": STAMP, "frame_id": "map"}, "pose": place}


@pytest.fixture
def session(router: Router) -> Iterator[zenoh.Session]:
    """Another session with the same router."""
    with zenoh.open(config({"mode": "client", "connect/endpoints": [f"tcp/{router.place}"]})) as session:
        yield session


class Heard(list[zenoh.Sample]):
    """What comes on some key."""

    def __init__(self, session: zenoh.Session, key: str, *, late: bool = False) -> None:
        super().__init__()
        handler = zenoh.handlers.Callback(self.append, indirect=False)
        history = zenoh.ext.HistoryConfig(max_samples=1, detect_late_publishers=True)
        self._subscriber = (
            zenoh.ext.declare_advanced_subscriber(session, key, handler, history=history)
            if late
            else session.declare_subscriber(key, handler)
        )
        tokens(session)  # the router answers when it knows of us

    def wait_for(self, number: int) -> list[zenoh.Sample]:
        wait_until(lambda: len(self) >= number, "not all came")
        return [*self]


def tokens(session: zenoh.Session) -> list[str]:
    replies = session.liveliness().get("@ros2_lv/**", timeout=HANG_S)
    return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)


# Keys, tokens, attachments


def test_keys_and_tokens_have_the_form_of_rmw_zenoh() -> None:
    node = RosNode(7, "aac3178e146ba6f1fc6e6a4085e77f21")
    topic = ZenohTopic.for_topic("/drone1_1/waypoint1_1", POSE, "RIHS01_10f3")
    assert topic.key(7) == "7/drone1_1/waypoint1_1/geometry_msgs::msg::dds_::PoseStamped_/RIHS01_10f3"
    assert str(node.token) == "@ros2_lv/7/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/robochoc_aac3178e"
    assert node.entity_token(3, "MP", topic) == (
        "@ros2_lv/7/aac3178e146ba6f1fc6e6a4085e77f21/0/3/MP/%/%/robochoc_aac3178e/%drone1_1%waypoint1_1/"
        "geometry_msgs::msg::dds_::PoseStamped_/RIHS01_10f3/1:1:1,1:,:,:,,"
    )


def test_an_attachment_is_33_bytes_in_little_endian() -> None:
    content = attachment(2, STAMP, bytes(range(16)))
    assert content == b"\2" + bytes(7) + STAMP.to_bytes(8, "little") + b"\x10" + bytes(range(16))


@looped(
    ("place", "address"),
    [
        ("", ("localhost", 7447)),
        ("robots", ("robots", 7447)),
        ("//robots:7000", ("robots", 7000)),
        ("[::1]:7447", ("::1", 7447)),
    ],
)
def test_a_place(place: str, address: tuple[str, int]) -> None:
    assert RouterAddress.parse(place) == address


@looped("place", [":7447", "a:b", "a:0", "a:99999", "//a/b", "user@a", "[::1", "a?b", "\x1b[31m:b"])
def test_a_place_that_is_none(place: str) -> None:
    with pytest.raises(SinkError, match=r"^[ -~]*expected rmw_zenoh, or rmw_zenoh://HOST:PORT") as refused:
        RmwZenohSink(place)
    assert "\x1b" not in str(refused.value)


# What we publish


def test_what_is_published_is_cdr_with_the_attachment_of_rmw_zenoh(router: Router, session: zenoh.Session) -> None:
    heard = Heard(session, "0/one/**")
    before = time.time_ns()
    with open_sink(f"rmw_zenoh://{router.place}") as sink:
        sink.advertise({"/one/waypoint": POSE, "/one/other": POSE})
        for number in range(100):
            sink.publish("/one/waypoint", POSE, pose(number), before + number)
        sink.publish("/one/other", POSE, pose(7), before)
    samples = heard.wait_for(101)
    first = [one for one in samples if str(one.key_expr) == f"0/one/waypoint/{POSE_KEY}"]
    assert [one.payload.to_bytes() for one in first] == [types_of(2).encode(POSE, pose(n)) for n in range(100)]
    attached = [one.attachment.to_bytes() for one in first if one.attachment is not None]
    gid = attached[0][17:]
    assert attached == [attachment(n + 1, before + n, gid) for n in range(100)]
    (other,) = [one for one in samples if str(one.key_expr) == f"0/one/other/{POSE_KEY}"]
    assert other.attachment is not None
    assert other.attachment.to_bytes()[17:] != gid


def test_others_see_the_node_and_its_topics_until_it_ends(router: Router, session: zenoh.Session) -> None:
    before = {*tokens(session)}  # the far end's, if a test has used it

    def new() -> list[str]:
        return sorted({*tokens(session)} - before)

    with RmwZenohSink(router.place) as sink, RmwZenohSource(router.place) as source:
        sink.advertise({"/seen/waypoint": POSE})
        source.listen({"/seen/out_of_order": TEXT})
        wait_until(lambda: len(new()) == 4, lambda: str(new()))
        ends = [token.split("/", 4)[4] for token in new()]
        assert sorted(end.split("/")[1] for end in ends) == ["MP", "MS", "NN", "NN"]
        assert any(end.endswith(f"/%seen%waypoint/{POSE_KEY}/1:1:1,1:,:,:,,") for end in ends)
        assert any(end.endswith(f"/%seen%out_of_order/{TEXT_KEY}/1:1:1,1:,:,:,,") for end in ends)
    wait_until(lambda: not new(), lambda: str(new()))


def test_a_late_comer_receives_the_last_message_alone(router: Router, session: zenoh.Session) -> None:
    early = Heard(session, f"0/late/waypoint/{POSE_KEY}")
    with RmwZenohSink(router.place) as sink:
        for number in range(5):
            sink.publish("/late/waypoint", POSE, pose(number), STAMP)
        early.wait_for(5)  # nothing is under way any more
        late = Heard(session, f"0/late/waypoint/{POSE_KEY}", late=True)
        assert late.wait_for(1)[0].payload.to_bytes() == types_of(2).encode(POSE, pose(4))
        sink.publish("/late/waypoint", POSE, pose(5), STAMP)
        assert [one.payload.to_bytes() for one in late.wait_for(2)] == [
            types_of(2).encode(POSE, pose(n)) for n in (4, 5)
        ]


def test_the_domain_is_heeded(router: Router, session: zenoh.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    heard = Heard(session, "*/far/**")
    with RmwZenohSink(router.place) as sink:
        sink.publish("/far/waypoint", POSE, pose(1), STAMP)
    assert str(heard.wait_for(1)[0].key_expr) == f"42/far/waypoint/{POSE_KEY}"
    monkeypatch.setenv("ROS_DOMAIN_ID", "nonsense")
    with pytest.raises(SourceError, match="ROS_DOMAIN_ID is 'nonsense': set it to a whole number from 0 to 232"):
        RmwZenohSource(router.place)


def test_humble_has_no_hashes(router: Router, session: zenoh.Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DISTRO", "humble")
    heard = Heard(session, "0/old/**")
    with RmwZenohSink(router.place) as sink:
        sink.publish("/old/waypoint", POSE, pose(1), STAMP)
    key = "0/old/waypoint/geometry_msgs::msg::dds_::PoseStamped_/TypeHashNotSupported"
    assert str(heard.wait_for(1)[0].key_expr) == key


def test_a_type_or_a_field_that_is_none(router: Router) -> None:
    with RmwZenohSink(router.place) as sink:
        with pytest.raises(SinkError, match="/a: ROS 2 has no type 'moon_msgs/Rover'"):
            sink.advertise({"/a": "moon_msgs/Rover"})
        with pytest.raises(SinkError, match="/b: geometry_msgs/PoseStamped: colour is not a field"):
            sink.publish("/b", POSE, {"colour": 1}, STAMP)
    with RmwZenohSource(router.place) as source, pytest.raises(SourceError, match="/a: ROS 2 has no type 'moon_msgs"):
        source.listen({"/a": "moon_msgs/Rover"})


# What we receive


def test_what_does_not_belong_there_is_passed_over(router: Router, session: zenoh.Session) -> None:
    good = types_of(2).encode(TEXT, {"data": "good"})
    with open_source(f"rmw_zenoh:{router.place}") as source:
        source.listen({"/here/out_of_order": TEXT})
        wait_until(lambda: any("%here%out_of_order" in token for token in tokens(session)), "no subscription")
        base = "0/here/out_of_order/std_msgs::msg::dds_::String_"
        for key, content in (
            (f"{base}/RIHS01_{'0' * 64}", good),
            (f"{base}/{TEXT_HASH}", b""),
            (f"{base}/{TEXT_HASH}", b"\0\1\0\0\xff\xff\xff\xff"),
            (f"{base}/{TEXT_HASH}", os.urandom(1000)),
            (f"{base}/{TEXT_HASH}", good + bytes(MESSAGE_BYTES_MAX)),
            (f"0/here/blocked/std_msgs::msg::dds_::String_/{TEXT_HASH}", good),
            (f"1/here/out_of_order/std_msgs::msg::dds_::String_/{TEXT_HASH}", good),
            (f"{base}/TypeHashNotSupported", types_of(2).encode(TEXT, {"data": "from humble"})),
            (f"{base}/{TEXT_HASH}", good),
        ):
            session.put(key, content, congestion_control=zenoh.CongestionControl.BLOCK)
        before = time.time_ns()
        received = [source.next(HANG_S), source.next(HANG_S)]
        assert [one and (one.topic, one.kind, one.fields) for one in received] == [
            ("/here/out_of_order", TEXT, {"data": "from humble"}),
            ("/here/out_of_order", TEXT, {"data": "good"}),
        ]
        assert all(one and abs(one.at_ns - before) < HANG_S * 10**9 for one in received)
        assert source.next(0) is None


def test_a_source_that_comes_late_receives_the_last_message(router: Router) -> None:
    with RmwZenohSink(router.place) as sink:
        for text in ("first", "last"):
            sink.publish("/again/out_of_order", TEXT, {"data": text}, STAMP)
        with RmwZenohSource(router.place) as source:
            source.listen({"/again/out_of_order": TEXT})
            received = source.next(HANG_S)
            assert received is not None
            assert received.fields == {"data": "last"}


# The SDK, which is not ours


def test_hashes_are_those_that_the_sdk_computes(end: FarEnd) -> None:
    assert end.ask("hashes") == {
        kind: type_hash(kind)
        for kind in ("geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PointStamped", "std_msgs/msg/String")
    } | {"sensor_msgs/msg/BatteryState": type_hash(BATTERY)}


def test_the_sdk_receives_all_also_when_it_comes_late(router: Router, end: FarEnd) -> None:
    end.ask("subscribe", topics=["/sdk/waypoint"], kind="geometry_msgs/msg/PoseStamped", latched=False)
    with RmwZenohSink(router.place) as sink:
        sink.advertise({"/sdk/waypoint": POSE, "/sdk/late": POSE})
        for number in range(50):
            sink.publish("/sdk/waypoint", POSE, pose(number), STAMP)
            sink.publish("/sdk/late", POSE, pose(number), STAMP)
        heard = [fields for topic, fields in end.wait_for(50) if topic == "/sdk/waypoint"]
        assert [fields["pose"]["position"]["x"] for fields in heard] == [*range(50)]
        assert heard[0]["header"] == {"stamp": {"sec": 1_700_000_000, "nanosec": 123_456_789}, "frame_id": "map"}
        end.ask("subscribe", topics=["/sdk/late"], kind="geometry_msgs/msg/PoseStamped", latched=True)
        assert [topic for topic, _ in end.wait_for(51)].count("/sdk/late") == 1
        assert end.wait_for(51)[-1][1]["pose"]["position"]["x"] == 49
        assert ["/sdk/waypoint", ["geometry_msgs/msg/PoseStamped"]] in end.ask("topics")
        ((node, type_hash, _),) = end.ask("info", topic="/sdk/waypoint")
        assert (node[:9], type_hash) == ("robochoc_", POSE_HASH)


def test_reports_of_the_sdk_reach_us(router: Router, end: FarEnd) -> None:
    with RmwZenohSource(router.place) as source:
        source.listen({"/sdk/battery": BATTERY})
        wait_until(lambda: "/sdk/battery" in [topic for topic, _ in end.ask("topics")], "no subscription")
        end.ask("publish_battery", topic="/sdk/battery", level=0.125)
        received = source.next(HANG_S)
        assert received is not None
        assert received[:2] == ("/sdk/battery", BATTERY)
        assert received.fields["percentage"] == 0.125
        assert received.fields["header"] == {"stamp": 5_000_000_007, "frame_id": "map"}


# Routers that are none, or go


def test_nobody_listens() -> None:
    port = free_port()
    with pytest.raises(
        SinkError, match=rf"no zenoh router listens at 127.0.0.1:{port} \(.*refused\); start one: `ros2"
    ):
        RmwZenohSink(f"127.0.0.1:{port}")
    with pytest.raises(SourceError, match="no zenoh router listens at"):
        RmwZenohSource(f"//127.0.0.1:{port}")
    with pytest.raises(SinkError, match=r"no zenoh router listens at nowhere\.invalid:7447 \("):
        RmwZenohSink("nowhere.invalid")


@looped("answer", [b"", b"HTTP/1.1 404 Not Found\r\n\r\n", b"\xff" * 100_000])
def test_what_listens_is_no_router(answer: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rmw_zenoh_session, "OPEN_S", 0.2)
    with (
        fake_server(answer, hangs_up=False) as port,
        pytest.raises(SinkError, match="does not answer as a zenoh router; start one"),
    ):
        RmwZenohSink(f"127.0.0.1:{port}")


def test_a_configuration_of_the_users(router: Router, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "session.json5"
    file.write_text(json.dumps({"mode": "peer", "connect": {"endpoints": [f"tcp/{router.place}"]}}), encoding="utf-8")
    monkeypatch.setenv(rmw_zenoh_session.CONFIG_FILE, str(file))
    with RmwZenohSink("") as sink:
        sink.publish("/a", POSE, pose(1), STAMP)
    file.write_text("{nonsense", encoding="utf-8")
    with pytest.raises(SinkError, match="ZENOH_SESSION_CONFIG_URI does not name a valid zenoh configuration: "):
        RmwZenohSink("")
    monkeypatch.setenv(rmw_zenoh_session.CONFIG_FILE, str(tmp_path / "none.json5"))
    with pytest.raises(SourceError, match="ZENOH_SESSION_CONFIG_URI does not name a valid zenoh configuration: "):
        RmwZenohSource("")


@pytest.mark.more
def test_the_router_dies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rmw_zenoh_session, "GONE_S", 0.1)
    with Router() as router:
        sink, source = RmwZenohSink(router.place), RmwZenohSource(router.place)
        sink.publish("/a", POSE, pose(1), STAMP)
        router.kill()
        with pytest.raises(
            SinkError, match=rf"the connection to the zenoh router at {router.place} is lost; start one"
        ):
            publish_until_it_fails(sink)
        with pytest.raises(SourceError, match="is lost; start one"):
            source.next(HANG_S)
        with pytest.raises(SinkError, match="is lost; start one"):
            sink.close()
        source.close()


def publish_until_it_fails(sink: RmwZenohSink) -> None:
    until = time.monotonic() + HANG_S
    while time.monotonic() < until:
        sink.publish("/a", POSE, pose(1), STAMP)
        time.sleep(0.01)


def test_a_router_that_stands_still_does_not_keep_us(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rmw_zenoh_session, "CLOSE_S", 0.2)
    with Router() as router:
        sink, source = RmwZenohSink(router.place), RmwZenohSource(router.place)
        sink.publish("/a", POSE, pose(1), STAMP)
        router.stop()
        source.close()
        sink.discard()


def test_messages_that_the_router_has_not_read_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rmw_zenoh_session, "CLOSE_S", 0.5)
    with Router() as router:
        sink = RmwZenohSink(router.place)
        router.stop()
        sink.publish("/a", POSE, pose(1), STAMP)
        with pytest.raises(SinkError, match="does not accept our messages"):
            sink.close()


def test_a_session_that_comes_too_late_is_closed(router: Router, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[zenoh.Session] = []
    may_go = threading.Event()
    really = zenoh.open

    def slowly(made: zenoh.Config) -> zenoh.Session:
        may_go.wait(HANG_S)
        opened.append(really(made))
        return opened[0]

    monkeypatch.setattr(zenoh, "open", slowly)
    monkeypatch.setattr(rmw_zenoh_session, "LATE_S", -4.9)
    monkeypatch.setattr(rmw_zenoh_session.RosSession, "_check_listening", lambda *_: None)
    with pytest.raises(SinkError, match="does not answer as a zenoh router"):
        RmwZenohSink(router.place)
    may_go.set()
    wait_until(lambda: bool(opened) and opened[0].is_closed(), "it is open")
