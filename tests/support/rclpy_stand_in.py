"""A stand-in for rclpy, with the messages of ROS 2: nodes of this process hear each other, domain by domain.

It has what rclpy has and a node of ours uses, and is as strict: classes of messages check their fields, publishers and
subscriptions match by their quality of service, a context is made once, and its end ends what was made in it.
"""

from __future__ import annotations

import json
import os
import queue
import sys
import threading
from array import array
from collections import deque
from collections.abc import Callable
from enum import Enum
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from robochoc.ros.message_types import FieldType, types_of
from tests.support.limits import HANG_S

PACKAGES = (
    "builtin_interfaces",
    "diagnostic_msgs",
    "geometry_msgs",
    "nav_msgs",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
)
_SPELLING = {"float64": "double", "float32": "float", "bool": "boolean", "byte": "octet", "char": "uint8"}
_CHECKS: dict[str, type] = {"double": float, "float": float, "boolean": bool, "octet": bytes, "string": str}


class _Network:
    """Who publishes and subscribes in which domain."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.publishers: list[Publisher] = []
        self.subscriptions: list[Subscription] = []


_network = _Network()


class _Policy(Enum):
    KEEP_LAST = 1
    RELIABLE = 2
    BEST_EFFORT = 3
    TRANSIENT_LOCAL = 4
    VOLATILE = 5


class QoSProfile:
    def __init__(self, *, history: _Policy, depth: int, reliability: _Policy, durability: _Policy) -> None:
        assert history is _Policy.KEEP_LAST
        self.depth, self.reliable = depth, reliability is _Policy.RELIABLE
        self.latched = durability is _Policy.TRANSIENT_LOCAL


class Duration:
    def __init__(self, *, seconds: int = 0, nanoseconds: int = 0) -> None:
        self.nanoseconds = seconds * 10**9 + nanoseconds


class Context:
    def __init__(self) -> None:
        self.is_ok = False
        self.nodes: list[Node] = []

    def init(self, args: list[str], *, initialize_logging: bool = True) -> None:
        assert (args, initialize_logging, self.nodes) == ([], False, [])
        self.domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
        self.is_ok = True

    def ok(self) -> bool:
        return self.is_ok

    def try_shutdown(self) -> None:
        for node in self.nodes:
            node.destroy_node()
        self.is_ok = False


class Publisher:
    def __init__(self, node: Node, kind: type, topic: str, quality: QoSProfile) -> None:
        self.node, self.kind, self.topic, self.quality = node, kind, topic, quality
        self.kept: deque[bytes] = deque(maxlen=quality.depth)

    def matches(self, other: Subscription) -> bool:
        same = (self.node.context.domain, self.topic, self.kind) == (
            other.node.context.domain,
            other.topic,
            other.kind,
        )
        enough = self.quality.reliable >= other.quality.reliable and self.quality.latched >= other.quality.latched
        return same and enough

    def _subscriptions(self) -> list[Subscription]:
        with _network.lock:
            return [one for one in _network.subscriptions if self.matches(one)]

    def get_subscription_count(self) -> int:
        return len(self._subscriptions())

    def publish(self, message: Any) -> None:  # noqa: ANN401 - rclpy is untyped
        assert isinstance(message, self.kind)
        assert self.node.context.is_ok
        content = serialize_message(message)
        self.kept.append(content)
        for subscription in self._subscriptions():
            subscription.put(content)

    def wait_for_all_acked(self, timeout: Duration) -> bool:
        assert timeout.nanoseconds > 0
        return not any(one.stands_still for one in self._subscriptions())


class Subscription:
    stands_still = False
    """Whether it acknowledges nothing."""

    def __init__(
        self, node: Node, kind: type, topic: str, callback: Callable[[bytes], None], quality: QoSProfile
    ) -> None:
        self.node, self.kind, self.topic, self.quality = node, kind, topic, quality
        self.callback = callback
        self.waiting: deque[bytes] = deque(maxlen=quality.depth)

    def put(self, content: bytes) -> None:
        with self.node.came:
            self.waiting.append(content)
            self.node.came.notify()


class Node:
    def __init__(
        self,
        name: str,
        *,
        context: Context,
        use_global_arguments: bool,
        enable_rosout: bool,
        start_parameter_services: bool,
    ) -> None:
        assert name.isidentifier()
        assert not use_global_arguments
        assert not enable_rosout
        assert not start_parameter_services
        self.name, self.context = name, context
        self.came = threading.Condition()
        self.subscriptions: list[Subscription] = []
        self.services: dict[str, tuple[Any, Callable[[Any, Any], Any]]] = {}
        self.calls: deque[Callable[[], None]] = deque()
        context.nodes.append(self)

    def create_publisher(self, kind: type, topic: str, quality: QoSProfile) -> Publisher:
        made = Publisher(self, kind, topic, quality)
        with _network.lock:
            _network.publishers.append(made)
        return made

    def create_subscription(
        self, kind: type, topic: str, callback: Callable[[bytes], None], quality: QoSProfile, *, raw: bool
    ) -> Subscription:
        assert raw
        made = Subscription(self, kind, topic, callback, quality)
        with _network.lock:
            _network.subscriptions.append(made)
            late = [one for one in _network.publishers if one.matches(made)]
        self.subscriptions.append(made)
        if quality.latched:
            for publisher in late:
                for content in publisher.kept:
                    made.put(content)
        return made

    def create_service(self, kind: Any, name: str, callback: Callable[[Any, Any], Any]) -> None:  # noqa: ANN401 - rclpy is untyped
        self.services[name] = (kind, callback)

    def call(self, name: str, **fields: object) -> Any:  # noqa: ANN401 - rclpy is untyped
        """What a client of another node does: ask, and wait for the answer."""
        kind, callback = self.services[name]
        request = kind.Request()
        for field, value in fields.items():
            setattr(request, field, value)
        answer: queue.Queue[Any] = queue.Queue()
        with self.came:
            self.calls.append(lambda: answer.put(callback(request, kind.Response())))
            self.came.notify()
        return answer.get(timeout=HANG_S)

    def destroy_node(self) -> None:
        with _network.lock:
            _network.publishers[:] = [one for one in _network.publishers if one.node is not self]
            _network.subscriptions[:] = [one for one in _network.subscriptions if one.node is not self]


class SingleThreadedExecutor:
    def __init__(self, *, context: Context) -> None:
        self.context = context
        self.is_woken = False

    def add_node(self, node: Node) -> None:
        self.node = node

    def wake(self) -> None:
        with self.node.came:
            self.is_woken = True
            self.node.came.notify()

    def shutdown(self, timeout_sec: float) -> None:
        assert timeout_sec > 0

    def spin_once(self, timeout_sec: float) -> None:
        if not self.context.is_ok:
            raise RuntimeError("the context is not valid")
        with self.node.came:
            self.node.came.wait_for(
                lambda: self.is_woken or self.node.calls or any(one.waiting for one in self.node.subscriptions),
                timeout_sec,
            )
            ready = [(one, one.waiting.popleft()) for one in [*self.node.subscriptions] if one.waiting]
            calls = [self.node.calls.popleft() for _ in range(min(1, len(self.node.calls)))]
        for one, content in ready:
            one.callback(content)
        for call in calls:
            call()


def serialize_message(message: Any) -> bytes:  # noqa: ANN401 - messages are untyped
    return json.dumps(_plain(message)).encode()


def deserialize_message(content: bytes, kind: type) -> Any:  # noqa: ANN401 - messages are untyped
    return _rebuilt(json.loads(content), kind)


def _plain(value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, array | np.ndarray):
        return value.tolist()
    if isinstance(value, bytes):
        return value[0]
    return [_plain(one) for one in value] if isinstance(value, list) else value


def _rebuilt(fields: dict[str, Any], kind: type) -> Any:  # noqa: ANN401 - messages are untyped
    made: Any = kind()
    for name, part in made.parts.items():
        given = fields[name]
        setattr(made, name, [part.rebuilt(one) for one in given] if part.is_many else part.rebuilt(given))
    return made


class _Field:
    """A field of a message: checks what is set, as the classes that rosidl generates do."""

    def __init__(self, field: FieldType) -> None:
        self.size, self.is_many = field.size, field.shape != "one"
        self.is_fixed = field.shape == "array"
        self.one = _SPELLING.get(field.name, field.name)
        most = f", {self.size}" if self.size else ""
        self.spelling = {"one": self.one, "array": f"{self.one}[{self.size}]"}.get(
            field.shape, f"sequence<{self.one}{most}>"
        )

    @property
    def check(self) -> type:
        return message_class(self.one) if "/" in self.one else _CHECKS.get(self.one, int)

    def empty(self) -> Any:  # noqa: ANN401 - a field is anything
        one = b"\0" if self.one == "octet" else self.check()
        return self.kept([one] * self.size if self.is_fixed else []) if self.is_many else one

    def kept(self, value: Any) -> Any:  # noqa: ANN401 - a field is anything
        if not self.is_many:
            assert isinstance(value, self.check), f"must be {self.check.__name__}, is {value!r}"
            return value
        assert all(isinstance(one, self.check) for one in value), f"must be {self.spelling}, is {value!r}"
        assert not self.is_fixed or len(value) == self.size
        if self.one == "double":
            return np.array(value) if self.is_fixed else array("d", value)
        return array("f", value) if self.one == "float" else [*value]

    def rebuilt(self, given: Any) -> Any:  # noqa: ANN401 - a field is anything
        if self.one == "octet":
            return bytes([given])
        return _rebuilt(given, self.check) if "/" in self.one else given


_made: dict[str, type] = {}


def message_class(kind: str) -> type:
    """The class of that ROS type, as rosidl makes it for Python."""
    if kind not in _made:
        parts = {name: _Field(field) for name, field in types_of(2).layout(kind)}

        def init(self: Any) -> None:  # noqa: ANN401 - made here
            self.__dict__.update({name: part.empty() for name, part in parts.items()})

        def put(self: Any, name: str, value: object) -> None:  # noqa: ANN401 - made here
            self.__dict__[name] = parts[name].kept(value)

        def spellings() -> dict[str, str]:
            return {name: part.spelling for name, part in parts.items()}

        members = {
            "__init__": init,
            "__setattr__": put,
            "get_fields_and_field_types": staticmethod(spellings),
            "parts": parts,
        }
        _made[kind] = type(kind.partition("/")[2], (), members)
    return _made[kind]


class _Services(ModuleType):
    """The module `std_srvs.srv` or the like."""

    def __getattr__(self, name: str) -> type:
        try:
            halves = {
                half: message_class(f"{self.__name__.partition('.')[0]}/{name}_{half}")
                for half in ("Request", "Response")
            }
        except LookupError as missing:
            raise AttributeError(name) from missing
        return type(name, (), halves)


class _Messages(ModuleType):
    """The module `geometry_msgs.msg` or the like."""

    def __getattr__(self, name: str) -> type:
        try:
            return message_class(f"{self.__name__.partition('.')[0]}/{name}")
        except LookupError as missing:
            raise AttributeError(name) from missing


def install(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have it imported as rclpy until the test is over."""
    rooms: dict[str, dict[str, object]] = {
        "rclpy": {},
        "rclpy.context": {"Context": Context},
        "rclpy.duration": {"Duration": Duration},
        "rclpy.executors": {"SingleThreadedExecutor": SingleThreadedExecutor},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {
            "QoSProfile": QoSProfile,
            **dict.fromkeys(("HistoryPolicy", "ReliabilityPolicy", "DurabilityPolicy"), _Policy),
        },
        "rclpy.serialization": {"deserialize_message": deserialize_message, "serialize_message": serialize_message},
    }
    for name, content in rooms.items():
        made = ModuleType(name)
        vars(made).update(content)
        monkeypatch.setitem(sys.modules, name, made)
    for package in PACKAGES:
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", _Messages(f"{package}.msg"))


def install_services(monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
    """Have the services of these packages imported, too."""
    for package in packages:
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.srv", _Services(f"{package}.srv"))


def subscribed(topic: str) -> list[Subscription]:
    """The subscriptions to `topic`."""
    with _network.lock:
        return [one for one in _network.subscriptions if one.topic == topic]


def is_empty() -> bool:
    """Whether no node is left."""
    with _network.lock:
        return not (_network.publishers or _network.subscriptions)
