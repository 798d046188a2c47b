"""rospy: a node of ROS 1 in this process, where rospy can be imported. It is on no package index.

rospy is untyped; this module and `rospy_messages` alone know it. A process has one node and keeps it: rospy can make no
other. rospy waits forever where there is no master, so a sink or a source asks for the master first.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import queue
import threading
import time
import warnings
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Any

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import Fields, SinkError
from robochoc.robots.source import SourceError
from robochoc.ros.live.in_time import succeeds_in_time
from robochoc.ros.live.ros_master import Failed, RosMaster
from robochoc.ros.live.rospy_messages import fields_of, filled, message_class
from robochoc.ros.live.transport import LINGER_S, STUCK_S, LiveSink, LiveSource

NODE_S = 15.0
"""The longest wait for the registration of our node or its topics, in seconds."""
GATHER_S = 5.0
"""The longest wait for subscribers that the master lists, in seconds. It may list some that no longer exist."""
_WAITING = 10_000
"""Messages that wait to be sent before `publish` waits, too."""

_lock = threading.Lock()


def _node(place: str, failed: Failed) -> Any:  # noqa: ANN401 - rospy is untyped
    """Return rospy, with this process's node registered. Raises `failed`."""
    if place:
        raise failed(f"rospy takes no place, and got {shortened(place)!r}; say where the master is in ROS_MASTER_URI")
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
            raise failed("the ROS node of this process was shut down, and rospy can make no other; start again")
        if not rospy.core.is_initialized():
            _register(rospy, failed)
    return rospy


def _register(rospy: Any, failed: Failed) -> None:  # noqa: ANN401 - rospy is untyped
    """Make the node. Signals stay ours. rospy's log is off: it would go to a file, and reconfigure all logging."""
    for name in ("rospy", "rosout", "rosgraph", "xmlrpc"):
        logging.getLogger(name).addHandler(logging.NullHandler())
        logging.getLogger(name).propagate = False
    configure, rospy.core.configure_logging = rospy.core.configure_logging, lambda *_, **__: None
    options = {"anonymous": True, "disable_signals": True, "disable_rosout": True, "disable_rostime": True}
    is_there = succeeds_in_time(partial(rospy.init_node, "robochoc", argv=[], **options), NODE_S)
    rospy.core.configure_logging = configure
    if not is_there or not rospy.core.is_initialized():
        rospy.signal_shutdown("no node")
        raise failed(f"rospy could not make a node within {NODE_S:g} s; see ROS_MASTER_URI, ROS_IP and ROS_HOSTNAME")


class RospySink(LiveSink):
    """Publishes as a node of ROS 1. Topics are latched: later subscribers receive the last message of each.

    Messages begin to leave when all subscribers are connected, so that they receive every one.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._rospy = _node(place, SinkError)
        self._master = RosMaster(SinkError)
        self._publishers: dict[str, Any] = {}
        self._kinds: dict[str, Any] = {}
        self._absent: dict[str, int] = {}
        # rospy's own queues have threads that keep a program from ending while a subscriber reads nothing.
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(_WAITING)
        self._problem = ""
        threading.Thread(target=self._send_queue, daemon=True, name="rospy sender").start()

    def _announce(self, topics: Mapping[str, str]) -> None:
        """Register the topics, and wait for their subscribers."""
        new = {topic: message_class(kind, SinkError) for topic, kind in topics.items()}
        self._master.check()
        if not succeeds_in_time(partial(self._register, new), NODE_S):
            raise SinkError(f"the ROS master at {self._master.uri} has not registered our topics; see its log")
        self._gather(new)

    def _register(self, topics: Mapping[str, Any]) -> None:
        for topic, kind in topics.items():
            with warnings.catch_warnings():  # it would want a queue
                warnings.simplefilter("ignore")
                self._publishers[topic] = self._rospy.Publisher(topic, kind, latch=True, queue_size=None)
            self._kinds[topic] = kind

    def _send(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002
        """Queue a message for the thread that sends."""
        try:
            message = filled(self._kinds[topic](), fields)
        except (ValueError, TypeError, AttributeError) as error:
            raise SinkError(f"{topic} cannot be published as {kind}: {error}") from error
        self._hand_over(partial(self._publishers[topic].publish, message))

    def close(self) -> None:
        """Wait until all subscribers have been sent everything."""
        try:
            self._gather(self._publishers)
            self._drain()
        except SinkError:
            self.discard()
            raise
        if any(publisher.get_num_connections() for publisher in self._publishers.values()):
            time.sleep(LINGER_S)
        self._hand_over(None)
        self._end()

    def discard(self) -> None:
        """Unregister the topics."""
        self._problem = self._problem or "closed"
        with contextlib.suppress(queue.Full):  # who sends sees that there is a problem
            self._waiting.put_nowait(None)
        self._end()

    def _send_queue(self) -> None:
        while (publish := self._waiting.get()) is not None and not self._problem:
            try:
                publish()
            except Exception as error:  # noqa: BLE001 - raised by `publish` or `close`
                self._problem = shortened(on_one_line(f"{type(error).__name__}: {error}"))
            self._waiting.task_done()

    def _hand_over(self, publish: Callable[[], None] | None) -> None:
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
            raise SinkError(f"rospy cannot publish any more ({self._problem}); start again")

    def _stuck(self) -> str:
        return f"a subscriber has read nothing for {STUCK_S:g} s; see `rostopic info` for who it is, and end it"

    def _gather(self, topics: Collection[str]) -> None:
        """Wait until all subscribers that the master knows are connected; not twice for one that did not connect."""
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
    """Receives as a node of ROS 1."""

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
        """Ask the master, once a second at most."""
        if time.monotonic() - self._asked > 1:
            self._master.check()
            self._asked = time.monotonic()

    def close(self) -> None:
        """Unsubscribe."""
        succeeds_in_time(lambda: [subscriber.unregister() for subscriber in self._subscribers], NODE_S)

    def _receive(self, topic: str, kind: str, message: Any) -> None:  # noqa: ANN401 - messages are untyped
        self._put(topic, kind, fields_of(message))
