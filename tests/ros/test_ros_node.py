"""rospy: where it is not there, or no master is, that is told, and soon. Real ones: test_ros_debian.py."""

from __future__ import annotations

import socket
import sys
import threading
from collections.abc import Iterator
from types import ModuleType
from typing import Any, ClassVar
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest

from robochoc.robots.sink import SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live import rospy_node
from robochoc.ros.live.rospy_node import RospySink, RospySource, fields_of, filled
from robochoc.ros.live.transport import message_class
from tests.support.cases import looped
from tests.support.fake_servers import fake_server
from tests.support.limits import HANG_S


@pytest.fixture
def _rospy(monkeypatch: pytest.MonkeyPatch) -> None:
    """One that can be imported, and would fail if anybody used it."""
    monkeypatch.setitem(sys.modules, "rospy", ModuleType("rospy"))
    monkeypatch.setattr(rospy_node, "MASTER_S", HANG_S)


@pytest.fixture
def listener(monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{listener.getsockname()[1]}")
        yield listener


def test_without_rospy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rospy", None)
    with pytest.raises(SinkError, match=r"rospy cannot be imported .*; source a ROS 1 workspace, or install Debian's"):
        RospySink("")
    with pytest.raises(SourceError, match="rospy cannot be imported"):
        RospySource("")


@pytest.mark.usefixtures("_rospy")
def test_rospy_takes_no_place() -> None:
    with pytest.raises(
        SinkError, match=r"rospy accepts no address, but 'localhost:11311' was given: remove it, and set ROS_MASTER_URI"
    ):
        RospySink("localhost:11311")


@pytest.mark.usefixtures("_rospy")
def test_nobody_listens(listener: socket.socket) -> None:
    listener.close()
    with pytest.raises(SinkError, match=r"no ROS master answers at http://127.* \(.*refused\); start `roscore`"):
        RospySink("")


@pytest.mark.usefixtures("_rospy", "listener")
def test_a_master_that_says_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy_node, "MASTER_S", 0.1)
    with pytest.raises(SourceError, match=r"no ROS master answers .* \(timed out\); start `roscore`"):
        RospySource("")


@pytest.mark.usefixtures("_rospy")
@looped("answer", [b"\xff" * 100, b"HTTP/1.0 200 OK\r\n\r\nhello", b"HTTP/1.0 404 Not Found\r\n\r\n"])
def test_what_listens_is_no_master(monkeypatch: pytest.MonkeyPatch, answer: bytes) -> None:
    with fake_server(answer, hangs_up=True) as port:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
        with pytest.raises(SinkError, match=r"no ROS master answers at .*; start `roscore`, or set ROS_MASTER_URI"):
            RospySink("")


@pytest.mark.usefixtures("_rospy")
@looped("uri", ["localhost:11311", "ftp://localhost", "http://", "http://[x", ""])
def test_a_master_whose_address_is_none(monkeypatch: pytest.MonkeyPatch, uri: str) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", uri)
    with pytest.raises(SinkError, match="set ROS_MASTER_URI"):
        RospySink("")


@pytest.mark.usefixtures("_rospy")
def test_a_master_that_refuses(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    listener.close()
    with SimpleXMLRPCServer(("127.0.0.1", 0), SimpleXMLRPCRequestHandler, logRequests=False) as server:
        monkeypatch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{server.server_address[1]}")
        server.register_function(lambda _: [-1, "go away", 0], "getPid")
        threading.Thread(target=server.handle_request, daemon=True).start()
        with pytest.raises(SinkError, match=r"the ROS master at .* refuses the request: .*go away.*; see its log"):
            RospySink("")


class Time:
    """As genpy's."""

    def __init__(self) -> None:
        self.secs, self.nsecs = 0, 0

    def to_nsec(self) -> int:
        return self.secs * 10**9 + self.nsecs


class Part:
    """As genpy makes classes of definitions."""

    __slots__ = ("seq", "stamp", "x")
    _slot_types: ClassVar = ["uint32", "time", "float64"]
    _type = "my_msgs/Part"

    def __init__(self) -> None:
        self.seq, self.stamp, self.x = 7, Time(), 0.0


class Whole:
    __slots__ = ("name", "part", "parts")
    _slot_types: ClassVar = ["my_msgs/Part", "my_msgs/Part[]", "string"]
    _type = "my_msgs/Whole"

    def __init__(self) -> None:
        self.part, self.name = Part(), ""
        self.parts: list[Part] = []


@pytest.fixture
def _messages(monkeypatch: pytest.MonkeyPatch) -> None:
    package: Any = ModuleType("my_msgs.msg")
    package.Part, package.Whole = Part, Whole
    monkeypatch.setitem(sys.modules, "my_msgs", ModuleType("my_msgs"))
    monkeypatch.setitem(sys.modules, "my_msgs.msg", package)
    monkeypatch.setattr(Whole, "__slots__", ("part", "parts", "name"))


@pytest.mark.usefixtures("_messages")
@pytest.mark.parametrize("kind", ["my_msgs/Whole", "my_msgs/msg/Whole"])
def test_fields_there_and_back(kind: str) -> None:
    part = {"stamp": 1_700_000_000_123_456_789, "x": 1.5}
    fields = {"part": part, "parts": [part, {"stamp": 0, "x": 2.0}], "name": "a"}
    assert fields_of(filled(message_class(kind, SinkError)(), fields)) == fields
    assert fields_of(Whole()) == {"part": {"stamp": 0, "x": 0.0}, "parts": [], "name": ""}


@pytest.mark.usefixtures("_messages")
def test_a_field_that_is_none() -> None:
    with pytest.raises(ValueError, match="my_msgs/Part has no field 'y', only: seq, stamp, x"):
        filled(Whole(), {"part": {"y": 1}})


@pytest.mark.usefixtures("_messages")
@looped("kind", ["my_msgs/Rover", "no_such_msgs/Rover", "Rover", "../os/system", "os/path", ""])
def test_a_type_that_is_none(kind: str) -> None:
    with pytest.raises(SinkError, match="rospy has no message type"):
        message_class(kind, SinkError)
