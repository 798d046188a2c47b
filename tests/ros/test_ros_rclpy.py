"""rclpy: a node of ROS 2 publishes every waypoint and receives reports, with a stand-in; a real one where there is one.

Where rclpy cannot be imported, what to do is told.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.robots.sink import SinkError
from robochoc.robots.source import ReceivedMessage, SourceError
from robochoc.ros.live import rclpy_node, transport
from robochoc.ros.live.rclpy_node import MESSAGE_BYTES_MAX, RclpyNode, RclpySink, RclpySource, fields_of, filled
from tests.support import rclpy_stand_in
from tests.support.cases import looped
from tests.support.dds import LOOPBACK_ALONE
from tests.support.limits import HANG_S
from tests.support.program import ROOT
from tests.support.ros2_python import ros2_python

POSE, STRING, BATTERY = "geometry_msgs/PoseStamped", "std_msgs/String", "sensor_msgs/BatteryState"
STAMP = 1_700_000_000_123_456_789
HANGAR = str(ROOT / "docs" / "examples" / "hangar")


def pose(number: int) -> dict[str, Any]:
    place = {
        "position": {"x": float(number), "y": 0.0, "z": 1.5},
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    }
    return {"header": {"stamp": STAMP, "frame_id": "map"}, "pose": place}


@pytest.fixture
def _rclpy(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delenv("ROS_DOMAIN_ID", raising=False)
    monkeypatch.setattr(rclpy_node, "LINGER_S", 0.0)
    monkeypatch.setattr(transport, "SETTLE_S", 0.0)
    monkeypatch.setattr(rclpy_node, "WAIT_S", HANG_S)
    rclpy_stand_in.install(monkeypatch)
    yield
    assert rclpy_stand_in.is_empty()


class Listener:
    """A node of somebody else that keeps what it is sent, as sensors' subscribers do or as reliable ones do."""

    def __init__(self, topics: dict[str, str], *, reliable: bool = True, latched: bool = False) -> None:
        policy = rclpy_stand_in._Policy  # noqa: SLF001 - the stand-in's
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.context = rclpy_stand_in.Context()
        self.context.init([], initialize_logging=False)
        off = {"use_global_arguments": False, "enable_rosout": False, "start_parameter_services": False}
        self.node = rclpy_stand_in.Node("listener", context=self.context, **off)
        quality = rclpy_stand_in.QoSProfile(
            history=policy.KEEP_LAST,
            depth=1000,
            reliability=policy.RELIABLE if reliable else policy.BEST_EFFORT,
            durability=policy.TRANSIENT_LOCAL if latched else policy.VOLATILE,
        )
        for topic, kind in topics.items():
            made = rclpy_stand_in.message_class(kind)
            self.node.create_subscription(made, topic, self._take(topic, made), quality, raw=True)

    def _take(self, topic: str, kind: type) -> Any:  # noqa: ANN401 - a callback
        return lambda content: self.heard.append((topic, fields_of(rclpy_stand_in.deserialize_message(content, kind))))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.context.try_shutdown()

    def read(self) -> list[tuple[str, dict[str, Any]]]:
        """All that has come, as nobody else spins this node."""
        executor = rclpy_stand_in.SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        while any(one.waiting for one in self.node.subscriptions):
            executor.spin_once(HANG_S)
        return self.heard


# Where there is none


def test_without_rclpy(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "rclpy", None)
    monkeypatch.setattr(rclpy_node, "INSTALLED", tmp_path)
    with pytest.raises(SinkError, match=rf"rclpy cannot be imported \(.*\); source {tmp_path}/DISTRO/setup.bash first"):
        RclpySink("")
    for distribution in ("humble", "jazzy"):
        (tmp_path / distribution).mkdir()
        (tmp_path / distribution / "setup.bash").touch()
    with pytest.raises(SourceError, match=rf"source {tmp_path}/jazzy/setup.bash first, or use dds, which needs no ROS"):
        RclpySource("")


@pytest.mark.parametrize(
    ("version", "advice"),
    [("3.6", "; robochoc needs 3.11: use dds, which"), ("3.99", ": install robochoc for Python 3.99, or use dds")],
)
def test_an_rclpy_for_another_python(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, version: str, advice: str
) -> None:
    packages = tmp_path / "lib" / f"python{version}" / "site-packages"
    (packages / "rclpy").mkdir(parents=True)
    (packages / "rclpy" / "__init__.py").write_text("import rclpy._rclpy_pybind11", encoding="utf-8")
    monkeypatch.syspath_prepend(packages)
    told = f"rclpy cannot be imported .* sourced is for Python {version}, and this is Python 3.{sys.version_info.minor}"
    with pytest.raises(SinkError, match=told + advice):
        RclpySink("")


@pytest.mark.usefixtures("_rclpy")
def test_it_takes_no_place() -> None:
    with pytest.raises(
        SinkError, match="rclpy accepts no address, but '5' was given: remove it, and set ROS_DOMAIN_ID"
    ):
        RclpySink("5")


@pytest.mark.usefixtures("_rclpy")
@looped("domain", ["one", "-1", "233"])
def test_a_domain_that_is_none(monkeypatch: pytest.MonkeyPatch, domain: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(SourceError, match=f"ROS_DOMAIN_ID is '{domain}': set it to a whole number from 0 to 232"):
        RclpySource("")


@pytest.mark.usefixtures("_rclpy")
def test_a_middleware_that_cannot_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError("no rmw\x1b")

    monkeypatch.setattr(rclpy_stand_in.Context, "init", refuse)
    with pytest.raises(
        SinkError, match=r"rclpy cannot create a node \(RuntimeError: no rmw\\x1b\); check ROS_DOMAIN_ID and RMW"
    ):
        RclpySink("")


# Waypoints


@pytest.mark.usefixtures("_rclpy")
def test_every_waypoint_arrives_and_the_last_stays() -> None:
    topics = {"/a/waypoint": POSE}
    with RclpySink("") as sink, Listener(topics) as listener:
        for number in range(50):
            sink.publish("/a/waypoint", POSE, pose(number), STAMP)
        assert listener.read() == [("/a/waypoint", pose(number)) for number in range(50)]
        with Listener(topics, latched=True) as late:
            assert late.read() == [("/a/waypoint", pose(49))]


@pytest.mark.usefixtures("_rclpy")
def test_the_domain_keeps_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    with Listener({"/a/waypoint": POSE}) as listener:
        monkeypatch.setenv("ROS_DOMAIN_ID", "7")
        monkeypatch.setattr(rclpy_node, "WAIT_S", 0.0)
        with RclpySink("") as sink:
            sink.publish("/a/waypoint", POSE, pose(1), STAMP)
            assert sink._ros.context.domain == 7  # noqa: SLF001 - nobody asks from outside
        assert listener.read() == []


@pytest.mark.usefixtures("_rclpy")
def test_a_subscriber_that_stands_still_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rclpy_node, "STUCK_S", 0.05)
    with Listener({"/a/waypoint": POSE}):
        sink = RclpySink("")
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)
        monkeypatch.setattr(rclpy_stand_in.subscribed("/a/waypoint")[0], "stands_still", True)
        with pytest.raises(
            SinkError, match=r"a subscriber of /a/waypoint has not acknowledged any message for 0\.05 s; see"
        ):
            sink.publish("/a/waypoint", POSE, pose(2), STAMP)
        with pytest.raises(SinkError, match="has not acknowledged any message"):
            sink.close()


@pytest.mark.usefixtures("_rclpy")
def test_a_middleware_that_does_not_say_what_was_received(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(rclpy_stand_in.Publisher, "wait_for_all_acked")
    with Listener({"/a/waypoint": POSE}) as listener, RclpySink("") as sink:
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)
        sink.publish("/a/waypoint", POSE, pose(2), STAMP)
        assert len(listener.read()) == 2


@pytest.mark.usefixtures("_rclpy")
def test_who_else_shuts_it_down() -> None:
    sink, source = RclpySink(""), RclpySource("")
    sink._ros.context.try_shutdown()  # noqa: SLF001 - as somebody else in this process might
    with pytest.raises(SinkError, match="rclpy was shut down in this process; start again"):
        sink.publish("/a/waypoint", POSE, pose(1), STAMP)
    source._ros.context.try_shutdown()  # noqa: SLF001 - as somebody else in this process might
    with pytest.raises(SourceError, match=r"rclpy has stopped receiving \(RuntimeError: the context is not valid\)"):
        source.next(HANG_S)
    sink.discard()
    source.close()


@pytest.mark.usefixtures("_rclpy")
def test_what_cannot_be_published(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rclpy_node, "WAIT_S", 0.0)
    with RclpySink("") as sink:
        with pytest.raises(SinkError, match="/a cannot be published as std_msgs/String: AssertionError: must be str"):
            sink.publish("/a", STRING, {"data": 1}, STAMP)
        with pytest.raises(
            SinkError, match="/a cannot be published as std_msgs/String: ValueError: String has no field"
        ):
            sink.publish("/a", STRING, {"text": "x"}, STAMP)
        for kind in ("std_msgs/Rover", "no_such_msgs/Rover", "Rover", "os/path", ""):
            with pytest.raises(SinkError, match="rclpy has no message type"):
                sink.publish("/b", kind, {}, STAMP)


@pytest.mark.usefixtures("_rclpy")
def test_a_run_publishes_its_waypoints() -> None:
    topics = {f"/{name}/waypoint": POSE for name in ("fin", "nose", "port", "roof", "starboard", "tail")}
    with Listener(topics) as listener:
        words = ["solve", HANGAR, "--runtime", "simulator", "--ros", "rclpy"]
        done = CliRunner().invoke(cli, words, catch_exceptions=False)
        heard = listener.read()
    assert (done.exit_code, done.stderr) == (0, "rclpy: 6 waypoints, 0 landings\n")
    assert {topic for topic, _ in heard} == topics.keys()
    assert len(heard) == 6


# Reports


def expected(source: RclpySource) -> ReceivedMessage:
    message = source.next(HANG_S)
    assert message is not None
    return message


@pytest.mark.usefixtures("_rclpy")
def test_reports_are_heard() -> None:
    with RclpySource("") as source:
        source.listen({"/a/battery": BATTERY, "/a/out_of_order": STRING})
        assert source.next(0) is None
        with RclpySink("") as sink:
            sink.publish("/a/battery", BATTERY, {"percentage": 1, "cell_voltage": [3.5, 3.75], "location": "bü"}, STAMP)
            battery = expected(source)
            sink.publish("/a/out_of_order", STRING, {"data": "motor 2"}, STAMP)
            broken = expected(source)
    assert battery[:2] == ("/a/battery", BATTERY)
    assert (battery.fields["percentage"], battery.fields["cell_voltage"]) == (1.0, [3.5, 3.75])
    assert (battery.fields["location"], broken.fields) == ("bü", {"data": "motor 2"})


@pytest.mark.usefixtures("_rclpy")
@looped("garbage", [b"", b"{", b'{"data": 1}', b"\xff" * 9, b'{"data": "%s"}' % (b"x" * MESSAGE_BYTES_MAX)])
def test_bytes_that_are_no_message_are_passed_over(garbage: bytes) -> None:
    with RclpySource("") as source:
        source.listen({"/a/out_of_order": STRING})
        (ours,) = rclpy_stand_in.subscribed("/a/out_of_order")
        ours.put(garbage)
        ours.put(b'{"data": "whole"}')
        assert expected(source).fields == {"data": "whole"}


@pytest.mark.usefixtures("_rclpy")
def test_fields_there_and_back() -> None:
    covariance = [float(number) for number in range(36)]
    kinds: dict[str, dict[str, Any]] = {
        "geometry_msgs/PoseWithCovarianceStamped": {
            "header": pose(1)["header"],
            "pose": {"pose": pose(1)["pose"], "covariance": covariance},
        },
        "geometry_msgs/PoseArray": {"header": pose(1)["header"], "poses": [pose(1)["pose"], pose(2)["pose"]]},
        "std_msgs/ByteMultiArray": {
            "layout": {"dim": [{"label": "x", "size": 2, "stride": 2}], "data_offset": 0},
            "data": [-1, 7],
        },
        "std_msgs/Byte": {"data": -128},
        "builtin_interfaces/Time": {"sec": 3, "nanosec": 4},
    }
    for kind, fields in kinds.items():
        assert fields_of(filled(rclpy_stand_in.message_class(kind)(), fields)) == fields


@pytest.mark.usefixtures("_rclpy")
def test_a_node_is_left_once_more_without_harm() -> None:
    node = RclpyNode("", SinkError)
    node.close()
    node.close()
    with pytest.raises(SinkError, match="was shut down"):
        node.check()


# A real one

LISTENER = """
import json, sys
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
rclpy.init()
node = rclpy.create_node("listener")
heard = {}
for topic in sys.argv[1:]:
    quality = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
    node.create_subscription(PoseStamped, topic, lambda m, t=topic: heard.update({t: m.pose.position.z}), quality)
print("ready", flush=True)
while len(heard) < len(sys.argv) - 1:
    rclpy.spin_once(node, timeout_sec=0.2)
print(json.dumps(heard, sort_keys=True))
node.destroy_node()
rclpy.shutdown()
"""


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("sink", ["rclpy", "dds"])
def test_a_node_of_ros_receives_every_waypoint(sink: str) -> None:
    """`dds` is spoken by this Python, without a ROS: the node cannot tell."""
    python, env = ros2_python()
    ours, place = (python, sink) if sink == "rclpy" else (sys.executable, f"dds:?wait={HANG_S:g}")
    topics = [f"/{name}/waypoint" for name in ("fin", "nose", "port", "roof", "starboard", "tail")]
    with (
        subprocess.Popen(
            [python, "-c", LISTENER, *topics], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as listener,
        ExitStack() as stack,
    ):
        stack.callback(listener.kill)
        assert listener.stdout is not None
        assert listener.stdout.readline() == "ready\n"
        words = ["-m", "robochoc", "solve", HANGAR, "--runtime", "simulator", "--protocol", "abt", "--ros", place]
        env["CYCLONEDDS_URI"] = LOOPBACK_ALONE
        done = subprocess.run([ours, *words], env=env, capture_output=True, text=True, timeout=HANG_S, check=False)
        assert done.returncode == 0, done.stderr
        assert "6 waypoints, 0 landings" in done.stderr
        heard, errors = listener.communicate(timeout=HANG_S)
    assert errors == ""
    assert json.loads(heard).keys() == {*topics}
