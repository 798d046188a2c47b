"""Sinks and sources as a ROS 2 node in this process. rclpy is part of an installed ROS 2, for its Python version.

rclpy is untyped; only this module and `rclpy_service` use it. Each sink and each source has its own context and node,
so that other users of rclpy in this process are not affected. Environment variables such as `ROS_DOMAIN_ID` and
`RMW_IMPLEMENTATION` configure the domain, the middleware and its network.
"""

from __future__ import annotations

import importlib
import re
import secrets
import sys
import threading
import time
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.inbox import PER_TOPIC_MAX
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.ros2_names import domain_id
from robochoc.ros.live.transport import (
    LINGER_S,
    STUCK_S,
    ErrorClass,
    LiveSink,
    LiveSource,
    await_subscribers,
    message_class,
)
from robochoc.ros.names import is_for_waypoints

_NANO = 1_000_000_000
_TIMES = ("builtin_interfaces/Time", "builtin_interfaces/Duration")
_FLOATS = ("double", "float")
_ELEMENT = re.compile(r"(?:sequence<)?([\w/]+(?:<\d+>)?)")
"""Matches the element type in `sequence<double>`, `sequence<geometry_msgs/Pose, 3>`, `float[36]` or `string<10>`."""
WAIT_S = 2.0
"""The longest wait for the first subscriber of each waypoint's topic, in seconds."""
BLOCKED_S = 0.2
"""The maximum duration of a blocking call, in seconds, so that signals are handled."""
END_S = 5.0
"""The longest wait for the end of the spinning thread, in seconds."""
MESSAGE_BYTES_MAX = 256 * 1024
"""Longer messages are ignored: reports are short."""
INSTALLED = Path("/opt/ros")
"""The folder in which operating-system packages install ROS 2."""
OLDEST_PYTHON = (3, 11)
"""The oldest Python version on which robochoc runs."""
_WRONG_FIELDS = (ValueError, TypeError, AttributeError, AssertionError, OverflowError)
_PYTHON = re.compile(r"python(\d+\.\d+)")


class RclpyNode:
    """A node in a context of its own. The constructor and the methods raise `failed`."""

    def __init__(self, place: str, failed: ErrorClass) -> None:
        if place:
            raise failed(
                f"rclpy accepts no address, but {shortened(place)!r} was given: remove it, and set ROS_DOMAIN_ID"
            )
        self._failed = failed
        domain_id(failed)  # middlewares give no reason for an invalid domain
        try:
            importlib.import_module("rclpy")
            made = importlib.import_module("rclpy.context").Context()
            node = importlib.import_module("rclpy.node").Node
            self._qos: Any = importlib.import_module("rclpy.qos")
        except (ImportError, OSError) as missing:
            why = shortened(on_one_line(str(missing)))
            raise failed(f"rclpy cannot be imported ({why}); {_advice()}") from missing
        self.context: Any = made
        self._name = f"robochoc_{secrets.token_hex(4)}"
        self._others: list[Any] = []
        try:
            # Without rclpy's signal handlers and its log file.
            made.init([], initialize_logging=False)
            self.node: Any = self._create_node(node, self._name)
        except Exception as error:
            made.try_shutdown()
            raise failed(
                f"rclpy cannot create a node ({_error_text(error)}); check ROS_DOMAIN_ID and RMW_IMPLEMENTATION"
            ) from error

    def quality(self, *, waypoints: bool) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return the quality of service for waypoints (reliable, latched), or that of ROS 2 for sensors."""
        qos = self._qos
        reliable, latched = qos.ReliabilityPolicy, qos.DurabilityPolicy
        return qos.QoSProfile(
            history=qos.HistoryPolicy.KEEP_LAST,
            depth=1 if waypoints else PER_TOPIC_MAX,
            reliability=reliable.RELIABLE if waypoints else reliable.BEST_EFFORT,
            durability=latched.TRANSIENT_LOCAL if waypoints else latched.VOLATILE,
        )

    def service_quality(self) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return the quality of service for topics announced by services: reliable, not latched."""
        return self._qos.QoSProfile(
            history=self._qos.HistoryPolicy.KEEP_LAST,
            depth=PER_TOPIC_MAX,
            reliability=self._qos.ReliabilityPolicy.RELIABLE,
            durability=self._qos.DurabilityPolicy.VOLATILE,
        )

    def add_node(self, suffix: str) -> Any:  # noqa: ANN401 - rclpy is untyped
        """Return another node in the same context, with a name that ends in `suffix`. `close` closes both nodes."""
        self._others.append(self._create_node(importlib.import_module("rclpy.node").Node, f"{self._name}_{suffix}"))
        return self._others[-1]

    def _create_node(self, node: Any, name: str) -> Any:  # noqa: ANN401 - rclpy is untyped
        return node(
            name,
            context=self.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )

    def check(self) -> None:
        """Raise `failed` if other code in this process has shut down the context."""
        if not self.context.ok():
            raise self._failed("rclpy was shut down in this process; start again")

    def close(self) -> None:
        """Leave ROS. A second call does nothing."""
        for node in (*self._others, self.node):
            with suppress(Exception):  # it may be shut down already
                node.destroy_node()
        self.context.try_shutdown()


class RclpySink(LiveSink):
    """Publishes as a ROS 2 node. Topics are reliable and latched: later subscribers receive the last message.

    A topic stores only one message. The next message is published after all subscribers have acknowledged it, so that
    no message is lost.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place or "rclpy")
        self._ros = RclpyNode(place, SinkError)
        self._duration: Any = importlib.import_module("rclpy.duration").Duration
        self._publishers: dict[str, Any] = {}
        self._kinds: dict[str, Any] = {}

    def _announce(self, topics: Mapping[str, str]) -> None:
        """Announce `topics`, and wait for the subscribers of waypoints."""
        kinds = {topic: message_class(kind, SinkError, "rclpy") for topic, kind in topics.items()}
        for topic, kind in kinds.items():
            try:
                publisher = self._ros.node.create_publisher(kind, topic, self._ros.quality(waypoints=True))
            except Exception as error:
                raise SinkError(on_one_line(f"{topic} cannot be announced in ROS 2: {_error_text(error)}")) from error
            self._publishers[topic], self._kinds[topic] = publisher, kind
        self._await_subscribers([topic for topic, kind in topics.items() if is_for_waypoints(topic, kind)])

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002
        """Send a message once the previous message on its topic has been acknowledged."""
        try:
            message = filled(self._kinds[topic](), fields)
        except _WRONG_FIELDS as error:
            raise SinkError(on_one_line(f"{topic} cannot be published as {kind}: {_error_text(error)}")) from error
        self._await_acknowledged(topic)
        try:
            self._publishers[topic].publish(message)
        except Exception as error:
            raise SinkError(on_one_line(f"{topic} cannot be published in ROS 2: {_error_text(error)}")) from error

    def close(self) -> None:
        """Wait until all subscribers have acknowledged everything."""
        try:
            for topic in self._publishers:
                self._await_acknowledged(topic)
            if any(publisher.get_subscription_count() for publisher in self._publishers.values()):
                time.sleep(LINGER_S)
        finally:
            self.discard()

    def discard(self) -> None:
        """Leave ROS."""
        self._ros.close()

    def _await_subscribers(self, topics: Collection[str]) -> None:
        """Wait until each of `topics` has a subscriber and no more join, up to `WAIT_S`."""

        def counts() -> list[int]:
            self._ros.check()
            return [self._publishers[topic].get_subscription_count() for topic in topics]

        if topics:
            await_subscribers(counts, WAIT_S)

    def _await_acknowledged(self, topic: str) -> None:
        """Wait until all subscribers of `topic` acknowledge its messages. Raises `SinkError` after `STUCK_S`."""
        until = time.monotonic() + STUCK_S
        while not self._is_acknowledged(topic):
            if time.monotonic() > until:
                problem = f"a subscriber of {topic} has not acknowledged any message for {STUCK_S:g} s"
                raise SinkError(f"{problem}; see `ros2 topic info -v {topic}` to find it, and end it")

    def _is_acknowledged(self, topic: str) -> bool:
        self._ros.check()
        try:
            return bool(self._publishers[topic].wait_for_all_acked(self._duration(nanoseconds=int(BLOCKED_S * 1e9))))
        except Exception:  # noqa: BLE001 - not supported by this middleware or rclpy
            self._ros.check()
            return True


class RclpySource(LiveSource):
    """Receives messages as a ROS 2 node. A thread spins the node until the source is closed.

    Subscriptions have ROS 2's quality of service for sensors, which accepts reliable and best-effort publishers.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._ros = RclpyNode(place, SourceError)
        self._ended: threading.Event = threading.Event()
        self._problem = ""
        self._decode: Any = importlib.import_module("rclpy.serialization").deserialize_message
        executors = importlib.import_module("rclpy.executors")
        self._executor: Any = executors.SingleThreadedExecutor(context=self._ros.context)
        self._executor.add_node(self._ros.node)
        self._thread = threading.Thread(target=self._spin, daemon=True, name="rclpy spins")
        self._thread.start()

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics`."""
        kinds = {topic: (kind, message_class(kind, SourceError, "rclpy")) for topic, kind in topics.items()}
        quality = self._ros.quality(waypoints=False)
        for topic, (kind, type_) in kinds.items():
            receive = partial(self._receive, topic, kind, type_)
            try:
                self._ros.node.create_subscription(type_, topic, receive, quality, raw=True)
            except Exception as error:
                raise SourceError(
                    on_one_line(f"{topic} cannot be subscribed to in ROS 2: {_error_text(error)}")
                ) from error

    def _check(self) -> None:
        if self._ended.is_set():
            raise SourceError(f"rclpy has stopped receiving ({self._problem or 'closed'}); start again")

    def close(self) -> None:
        """End the thread, and leave ROS."""
        self._ended.set()
        with suppress(Exception):  # it may be shut down already
            self._executor.wake()
        self._thread.join(END_S)
        with suppress(Exception):
            self._executor.shutdown(timeout_sec=END_S)
        self._ros.close()

    def _spin(self) -> None:
        while not self._ended.is_set():
            try:
                self._executor.spin_once(timeout_sec=BLOCKED_S)
            except Exception as error:  # noqa: BLE001 - raised by `next`
                self._problem = _error_text(error)
                self._ended.set()
                self._inbox.wake()

    def _receive(self, topic: str, kind: str, type_: Any, content: bytes) -> None:  # noqa: ANN401 - rclpy is untyped
        if len(content) > MESSAGE_BYTES_MAX:
            return
        try:
            fields = fields_of(self._decode(content, type_))
        except Exception:  # noqa: BLE001 - malformed messages are ignored
            return
        self._put(topic, kind, fields)


def _advice() -> str:
    """Return a hint for users whose machine cannot import rclpy."""
    ours = f"{sys.version_info.major}.{sys.version_info.minor}"
    for entry in sys.path:
        found = _PYTHON.search(entry)
        if found and found[1] != ours and Path(entry, "rclpy").is_dir():
            problem = f"the ROS 2 that was sourced is for Python {found[1]}, and this is Python {ours}"
            if tuple(map(int, found[1].split("."))) < OLDEST_PYTHON:
                return f"{problem}; robochoc needs 3.11: use dds, which needs no ROS here"
            return f"{problem}: install robochoc for Python {found[1]}, or use dds, which needs no ROS here"
    there = sorted(INSTALLED.glob("*/setup.bash"))
    setup = there[-1] if there else INSTALLED / "DISTRO" / "setup.bash"
    return f"source {setup} first, or use dds, which needs no ROS here"


def filled(message: Any, fields: Fields) -> Any:  # noqa: ANN401 - messages are untyped
    """Set the fields of `message`, converted to the types that rclpy's setters require, and return it.

    rclpy is strict: a `float64` must be a `float`, and a `byte` is a `bytes` object. Raises `ValueError` for unknown
    fields.
    """
    kinds = message.get_fields_and_field_types()
    for name, value in fields.items():
        if name not in kinds:
            raise ValueError(f"{type(message).__name__} has no field {name!r}, only: {', '.join(kinds)}")
        kind = kinds[name]
        if isinstance(value, Mapping):
            filled(getattr(message, name), value)
        elif isinstance(value, list | tuple):
            setattr(message, name, [_converted(_element(kind), one) for one in value])
        else:
            setattr(message, name, _converted(kind, value))
    return message


def _converted(kind: str, value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if kind in _TIMES:
        made = message_class(kind, SinkError, "rclpy")()
        made.sec, made.nanosec = divmod(value, _NANO)
        return made
    if isinstance(value, Mapping):
        return filled(message_class(kind, SinkError, "rclpy")(), value)
    if kind in _FLOATS:
        return float(value)
    return bytes([value & 0xFF]) if kind == "octet" else value


def _element(kind: str) -> str:
    found = _ELEMENT.match(kind)
    return found[1] if found else kind


def fields_of(message: Any) -> dict[str, Any]:  # noqa: ANN401 - messages are untyped
    """Return the fields of an rclpy message."""
    kinds = message.get_fields_and_field_types()
    return {name: _plain(getattr(message, name), _element(kind)) for name, kind in kinds.items()}


def _plain(value: Any, kind: str) -> Any:  # noqa: ANN401 - a field is anything
    if kind == "octet" and isinstance(value, bytes):
        return int.from_bytes(value, "big", signed=True)
    if kind in _TIMES:
        return int(value.sec) * _NANO + int(value.nanosec)
    if hasattr(value, "get_fields_and_field_types"):
        return fields_of(value)
    if hasattr(value, "tolist"):  # numpy's and Python's arrays
        return value.tolist()
    return [_plain(one, kind) for one in value] if isinstance(value, list | tuple) else value


def _error_text(error: Exception) -> str:
    return shortened(on_one_line(f"{type(error).__name__}: {error}"))
