"""Sinks and sources as a ROS 1 node in this process, if rospy can be imported. No package index has rospy.

rospy is untyped; only this module uses it. A process has a single node until it ends, since rospy cannot create
another. Without a master, rospy waits forever, so sinks and sources first check that the master answers.
"""

from __future__ import annotations

import contextlib
import http.client
import importlib
import logging
import os
import queue
import threading
import time
import warnings
import xmlrpc.client
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any
from xml.parsers.expat import ExpatError

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.transport import (
    LINGER_S,
    STUCK_S,
    ErrorClass,
    LiveSink,
    LiveSource,
    message_class,
    succeeds_in_time,
)

_NANO = 1_000_000_000
MASTER_S = 3.0
"""The longest wait for an answer from the master, in seconds."""
_DEFAULT_MASTER = "http://localhost:11311"
_CALLER = "/robochoc"
NODE_S = 15.0
"""The longest wait for the registration of our node or its topics, in seconds."""
GATHER_S = 5.0
"""The longest wait for subscribers listed by the master, in seconds. Some of these may no longer exist."""
_WAITING = 10_000
"""The size of the queue of messages; `publish` waits while it is full."""
_lock = threading.Lock()


def _node(place: str, failed: ErrorClass) -> Any:  # noqa: ANN401 - rospy is untyped
    """Return rospy, after registering this process's node. Raises `failed`."""
    if place:
        raise failed(f"rospy accepts no address, but {shortened(place)!r} was given: remove it, and set ROS_MASTER_URI")
    try:
        rospy = importlib.import_module("rospy")
    except ImportError as missing:
        raise failed(
            f"rospy cannot be imported ({missing}), and no package index has it; source a ROS 1 workspace, or install "
            "Debian's python3-rospy and set PYTHONPATH=/usr/lib/python3/dist-packages"
        ) from missing
    RosMaster(failed).check()
    with _lock:
        if rospy.core.is_shutdown():
            raise failed("the ROS node of this process was shut down, and rospy cannot create another; start again")
        if not rospy.core.is_initialized():
            _register(rospy, failed)
    return rospy


def _register(rospy: Any, failed: ErrorClass) -> None:  # noqa: ANN401 - rospy is untyped
    """Create the node without rospy's signal handlers, and without its log, which would reconfigure all logging."""
    for name in ("rospy", "rosout", "rosgraph", "xmlrpc"):
        logging.getLogger(name).addHandler(logging.NullHandler())
        logging.getLogger(name).propagate = False
    configure, rospy.core.configure_logging = rospy.core.configure_logging, lambda *_, **__: None
    options = {"anonymous": True, "disable_signals": True, "disable_rosout": True, "disable_rostime": True}
    is_created = succeeds_in_time(partial(rospy.init_node, "robochoc", argv=[], **options), NODE_S)
    rospy.core.configure_logging = configure
    if not is_created or not rospy.core.is_initialized():
        rospy.signal_shutdown("no node")
        raise failed(f"rospy could not create a node within {NODE_S:g} s; see ROS_MASTER_URI, ROS_IP and ROS_HOSTNAME")


class RospySink(LiveSink):
    """Publishes as a ROS 1 node. Topics are latched: later subscribers receive the last message of each topic.

    The first message is sent when all subscribers are connected, so that they receive all messages.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._rospy = _node(place, SinkError)
        self._master = RosMaster(SinkError)
        self._publishers: dict[str, Any] = {}
        self._kinds: dict[str, Any] = {}
        self._absent: dict[str, int] = {}
        # The threads of rospy's queues would keep the program running while a subscriber reads nothing.
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(_WAITING)
        self._problem = ""
        threading.Thread(target=self._send_queue, daemon=True, name="rospy sender").start()

    def _announce(self, topics: Mapping[str, str]) -> None:
        """Register the topics, and wait for their subscribers."""
        new = {topic: message_class(kind, SinkError) for topic, kind in topics.items()}
        self._master.check()
        if not succeeds_in_time(partial(self._register, new), NODE_S):
            raise SinkError(f"the ROS master at {self._master.uri} has not registered our topics; see its log")
        self._await_subscribers(new)

    def _register(self, topics: Mapping[str, Any]) -> None:
        for topic, kind in topics.items():
            with warnings.catch_warnings():  # rospy recommends a queue
                warnings.simplefilter("ignore")
                self._publishers[topic] = self._rospy.Publisher(topic, kind, latch=True, queue_size=None)
            self._kinds[topic] = kind

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002
        """Put a message into the queue of the sending thread."""
        try:
            message = filled(self._kinds[topic](), fields)
        except (ValueError, TypeError, AttributeError) as error:
            raise SinkError(f"{topic} cannot be published as {kind}: {error}") from error
        self._enqueue(partial(self._publishers[topic].publish, message))

    def close(self) -> None:
        """Wait until all messages have been sent to all subscribers."""
        try:
            self._await_subscribers(self._publishers)
            self._drain()
        except SinkError:
            self.discard()
            raise
        if any(publisher.get_num_connections() for publisher in self._publishers.values()):
            time.sleep(LINGER_S)
        self._enqueue(None)
        self._end()

    def discard(self) -> None:
        """Unregister the topics."""
        self._problem = self._problem or "closed"
        with contextlib.suppress(queue.Full):  # the sending thread then sees `_problem`
            self._waiting.put_nowait(None)
        self._end()

    def _send_queue(self) -> None:
        while (publish := self._waiting.get()) is not None and not self._problem:
            try:
                publish()
            except Exception as error:  # noqa: BLE001 - raised by `publish` or `close`
                self._problem = shortened(on_one_line(f"{type(error).__name__}: {error}"))
            self._waiting.task_done()

    def _enqueue(self, publish: Callable[[], None] | None) -> None:
        try:
            self._check()
            self._waiting.put(publish, timeout=STUCK_S)
        except queue.Full:
            raise SinkError(self._stuck()) from None

    def _drain(self) -> None:
        """Wait until the queue is empty."""
        left, since = self._waiting.unfinished_tasks, time.monotonic()
        while left:
            self._check()
            if time.monotonic() - since > STUCK_S:
                raise SinkError(self._stuck())
            time.sleep(0.005)
            now = self._waiting.unfinished_tasks
            left, since = now, (time.monotonic() if now < left else since)
        self._check()

    def _check(self) -> None:
        if self._problem:
            raise SinkError(f"rospy has stopped publishing ({self._problem}); start again")

    def _stuck(self) -> str:
        return f"a subscriber has not read any message for {STUCK_S:g} s; find it by `rostopic info`, and end it"

    def _await_subscribers(self, topics: Collection[str]) -> None:
        """Wait until the subscribers listed by the master are connected; only once for those that never connect."""
        until = time.monotonic() + GATHER_S
        pause = 0.01
        while True:
            subscribed = self._master.subscribers()
            missing = {
                topic: len(subscribed.get(topic, ())) - self._publishers[topic].get_num_connections()
                for topic in topics
            }
            if all(number <= self._absent.get(topic, 0) for topic, number in missing.items()):
                return
            if time.monotonic() > until:
                self._absent |= missing
                return
            time.sleep(pause)
            pause = min(2 * pause, 0.3)

    def _end(self) -> None:
        succeeds_in_time(lambda: [publisher.unregister() for publisher in self._publishers.values()], NODE_S)


class RospySource(LiveSource):
    """Receives messages as a ROS 1 node."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._rospy = _node(place, SourceError)
        self._master = RosMaster(SourceError)
        self._asked = time.monotonic()
        self._subscribers: list[Any] = []

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe to `topics`."""
        kinds = {topic: (kind, message_class(kind, SourceError)) for topic, kind in topics.items()}
        self._master.check()
        if not succeeds_in_time(partial(self._subscribe, kinds), NODE_S):
            raise SourceError(
                f"the ROS master at {self._master.uri} has not registered us as a subscriber; see its log"
            )

    def _subscribe(self, topics: Mapping[str, tuple[str, Any]]) -> None:
        for topic, (kind, type_) in topics.items():
            received = partial(self._receive, topic, kind)
            self._subscribers.append(self._rospy.Subscriber(topic, type_, received, queue_size=100))

    def _check(self) -> None:
        """Check that the master answers, at most once a second."""
        if time.monotonic() - self._asked > 1:
            self._master.check()
            self._asked = time.monotonic()

    def close(self) -> None:
        """Unsubscribe."""
        succeeds_in_time(lambda: [subscriber.unregister() for subscriber in self._subscribers], NODE_S)

    def _receive(self, topic: str, kind: str, message: Any) -> None:  # noqa: ANN401 - messages are untyped
        self._put(topic, kind, fields_of(message))


class RosMaster:
    """Queries the ROS master at `ROS_MASTER_URI`. Methods raise `failed` if it does not answer."""

    def __init__(self, failed: ErrorClass) -> None:
        self._failed = failed
        self.uri = os.environ.get("ROS_MASTER_URI", _DEFAULT_MASTER)

    def check(self) -> None:
        """Raise `failed` if no master answers."""
        self._ask("getPid")

    def subscribers(self) -> dict[str, set[str]]:
        """Return the names of the subscribed nodes, by topic."""
        match self._ask("getSystemState"):
            case [_, list(subscribed), _]:
                return {topic: set(nodes) for topic, nodes in subscribed}
            case answer:
                raise self._failed(
                    f"the server at {self.uri} is not a ROS master: it answers {shortened(on_one_line(str(answer)))}"
                )

    def _ask(self, method: str) -> object:
        try:
            with xmlrpc.client.ServerProxy(self.uri, transport=_TransportWithTimeout()) as server:
                match getattr(server, method)(_CALLER):
                    case [1, _, answer]:
                        return answer
                    case answer:
                        shown = shortened(on_one_line(str(answer)))
                        raise self._failed(f"the ROS master at {self.uri} refuses the request: {shown}; see its log")
        except (OSError, ValueError, http.client.HTTPException, xmlrpc.client.Error, ExpatError) as error:
            why = getattr(error, "strerror", None) or str(error) or type(error).__name__
            message = f"no ROS master answers at {self.uri} ({shortened(on_one_line(why))})"
            raise self._failed(f"{message}; start `roscore`, or set ROS_MASTER_URI") from error


class _TransportWithTimeout(xmlrpc.client.Transport):
    """A transport with a timeout."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:  # noqa: ANN401 - typeshed's is private
        connection = super().make_connection(host)
        connection.timeout = MASTER_S
        return connection


def filled(message: Any, fields: Fields) -> Any:  # noqa: ANN401 - messages are untyped
    """Set the fields of `message`, and return it. Raises `ValueError` for unknown fields."""
    for name, value in fields.items():
        if name not in message.__slots__:
            raise ValueError(f"{message._type} has no field {name!r}, only: {', '.join(message.__slots__)}")  # noqa: SLF001
        now = getattr(message, name)
        match value:
            case Mapping():
                filled(now, value)
            case int() if hasattr(now, "nsecs"):
                now.secs, now.nsecs = divmod(value, _NANO)
            case list() | tuple() if value and isinstance(value[0], Mapping):
                setattr(message, name, [filled(_element(message, name), one) for one in value])
            case _:
                setattr(message, name, value)
    return message


def _element(message: Any, name: str) -> Any:  # noqa: ANN401 - messages are untyped
    """Return a new element of an array field."""
    kind = message._slot_types[message.__slots__.index(name)]  # noqa: SLF001 - genpy has no public name for it
    return message_class(kind.partition("[")[0], SinkError)()


def fields_of(message: Any) -> dict[str, Any]:  # noqa: ANN401 - messages are untyped
    """Return the fields of a rospy message, without `seq`, which ROS 1 sets and ROS 2 does not have."""
    return {name: _plain(getattr(message, name)) for name in message.__slots__ if name != "seq"}


def _plain(value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if hasattr(value, "nsecs"):
        return value.to_nsec()
    if hasattr(value, "_slot_types"):
        return fields_of(value)
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
