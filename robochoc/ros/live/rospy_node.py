"""rospy: a node of ROS 1 in this process, where rospy can be imported. It is on no package index.

rospy is untyped, and is wrapped here alone. A process has one node, and keeps it: rospy can make no other.
rospy waits for ever where there is no master, so whoever opens a sink or a source asks for the master first.
"""

from __future__ import annotations

import contextlib
import http.client
import importlib
import logging
import os
import queue
import re
import threading
import time
import warnings
import xmlrpc.client
from collections.abc import Callable, Collection, Mapping
from functools import partial
from types import ModuleType
from typing import Any
from xml.parsers.expat import ExpatError

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.live.inbox import Inbox
from robochoc.ros.sink import Fields, Sink, SinkError
from robochoc.ros.source import ReceivedMessage, Source, SourceError

MASTER_S = 3.0
"""How long the master may take to answer."""
NODE_S = 15.0
"""How long our node, or its topics, may take to be registered."""
GATHER_S = 5.0
"""How long subscribers that the master knows of may take to connect. Some are dead, and the master does not know."""
STUCK_S = 10.0
"""How long a subscriber may read nothing of what is there for it."""
LINGER_S = 0.3
"""How long topics stay once all has been sent: some subscribers forget what they have not read when a topic ends."""
_WAITING = 10_000
"""Messages that wait to be sent before whoever publishes waits too."""
_NANO = 1_000_000_000
_TYPE = re.compile(r"([a-z][a-z0-9_]*)/([A-Za-z][A-Za-z0-9_]*)")
_DEFAULT_MASTER = "http://localhost:11311"
_CALLER = "/robochoc"

Failed = type[SinkError] | type[SourceError]


class _Bounded(xmlrpc.client.Transport):
    """A transport that does not wait for ever."""

    def make_connection(self, host: Any) -> http.client.HTTPConnection:  # noqa: ANN401 - typeshed's is private
        connection = super().make_connection(host)
        connection.timeout = MASTER_S
        return connection


class _Master:
    """The ROS master, as far as we ask it."""

    def __init__(self, failed: Failed) -> None:
        self._failed = failed
        self.uri = os.environ.get("ROS_MASTER_URI", _DEFAULT_MASTER)

    def check(self) -> None:
        """Raise what is to be raised if no master answers."""
        self._ask("getPid")

    def subscribers(self) -> dict[str, set[str]]:
        """The nodes that have subscribed to each topic."""
        match self._ask("getSystemState"):
            case [_, list(subscribed), _]:
                return {topic: set(nodes) for topic, nodes in subscribed}
            case answer:
                raise self._failed(
                    f"what answers at {self.uri} is no ROS master: {shortened(on_one_line(str(answer)))}"
                )

    def _ask(self, what: str) -> object:
        try:
            with xmlrpc.client.ServerProxy(self.uri, transport=_Bounded()) as server:
                match getattr(server, what)(_CALLER):
                    case [1, _, answer]:
                        return answer
                    case answer:
                        said = shortened(on_one_line(str(answer)))
                        raise self._failed(f"the ROS master at {self.uri} refuses, it says: {said}; see its log")
        except (OSError, ValueError, http.client.HTTPException, xmlrpc.client.Error, ExpatError) as error:
            why = getattr(error, "strerror", None) or str(error) or type(error).__name__
            message = f"no ROS master answers at {self.uri} ({shortened(on_one_line(why))})"
            raise self._failed(f"{message}; start `roscore`, or set ROS_MASTER_URI") from error


_lock = threading.Lock()


def _node(place: str, failed: Failed) -> Any:  # noqa: ANN401 - rospy is untyped
    """rospy, with this process's node registered. Raises what it is told to raise."""
    if place:
        raise failed(f"rospy takes no place, and got {shortened(place)!r}; say where the master is in ROS_MASTER_URI")
    try:
        rospy = importlib.import_module("rospy")
    except ImportError as missing:
        raise failed(
            f"rospy cannot be imported ({missing}), and no package index has it; source a ROS 1 workspace, or install "
            "Debian's python3-rospy and set PYTHONPATH=/usr/lib/python3/dist-packages"
        ) from missing
    _Master(failed).check()
    with _lock:
        if rospy.core.is_shutdown():
            raise failed("the ROS node of this process was shut down, and rospy can make no other; start again")
        if not rospy.core.is_initialized():
            _register(rospy, failed)
    return rospy


def _register(rospy: Any, failed: Failed) -> None:  # noqa: ANN401 - rospy is untyped
    """Make the node. Signals stay ours; rospy's log would go to a file, and set up logging anew for everybody."""
    for name in ("rospy", "rosout", "rosgraph", "xmlrpc"):
        logging.getLogger(name).addHandler(logging.NullHandler())
        logging.getLogger(name).propagate = False
    configure, rospy.core.configure_logging = rospy.core.configure_logging, lambda *_, **__: None
    options = {"anonymous": True, "disable_signals": True, "disable_rosout": True, "disable_rostime": True}
    is_there = _in_time(partial(rospy.init_node, "robochoc", argv=[], **options))
    rospy.core.configure_logging = configure
    if not is_there or not rospy.core.is_initialized():
        rospy.signal_shutdown("no node")
        raise failed(f"rospy could not make a node within {NODE_S:g} s; see ROS_MASTER_URI, ROS_IP and ROS_HOSTNAME")


def message_class(kind: str, failed: Failed) -> Any:  # noqa: ANN401 - messages are untyped
    """The class of the ROS type `kind`, however it is spelled: in ROS 2 `/msg/` stands in the middle."""
    found = _TYPE.fullmatch(kind.replace("/msg/", "/"))
    try:
        package: ModuleType = importlib.import_module(f"{found[1]}.msg" if found else "")
        return getattr(package, found[2] if found else "")
    except (ImportError, AttributeError, ValueError) as missing:
        where = f"install the package {found[1]!r} for Python" if found else "expected PACKAGE/TYPE"
        raise failed(f"rospy knows no message type {shortened(kind)!r}; {where}") from missing


def filled(message: Any, fields: Fields) -> Any:  # noqa: ANN401 - messages are untyped
    """`message` with these fields. Raises `ValueError` where it has none of that name."""
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
    """A new element of an array field."""
    kind = message._slot_types[message.__slots__.index(name)]  # noqa: SLF001 - genpy's way to say it
    return message_class(kind.partition("[")[0], SinkError)()


def fields_of(message: Any) -> dict[str, Any]:  # noqa: ANN401 - messages are untyped
    """A rospy message's fields. `seq`, which ROS 1 counts by itself and ROS 2 does not have, is left out."""
    return {name: _plain(getattr(message, name)) for name in message.__slots__ if name != "seq"}


def _plain(value: Any) -> Any:  # noqa: ANN401 - a field is anything
    if hasattr(value, "nsecs"):
        return value.to_nsec()
    if hasattr(value, "_slot_types"):
        return fields_of(value)
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value


class RospySink(Sink):
    """Publishes as a node of ROS 1. Topics are latched: who subscribes later hears the last message of each.

    Messages begin to leave when all that have subscribed are connected, so that they hear every one.
    """

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._rospy = _node(place, SinkError)
        self._master = _Master(SinkError)
        self._publishers: dict[str, Any] = {}
        self._kinds: dict[str, Any] = {}
        self._absent: dict[str, int] = {}
        # rospy's own queues have threads that keep a program from ending while a subscriber reads nothing.
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(_WAITING)
        self._problem = ""
        threading.Thread(target=self._send, daemon=True, name="rospy sender").start()

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Register the topics, and wait for those who have subscribed to them."""
        new = {topic: message_class(kind, SinkError) for topic, kind in topics.items() if topic not in self._kinds}
        if not new:
            return
        self._master.check()
        if not _in_time(partial(self._register, new)):
            raise SinkError(f"the ROS master at {self._master.uri} has not registered our topics; see its log")
        self._gather(new)

    def _register(self, topics: Mapping[str, Any]) -> None:
        for topic, kind in topics.items():
            with warnings.catch_warnings():  # it would want a queue
                warnings.simplefilter("ignore")
                self._publishers[topic] = self._rospy.Publisher(topic, kind, latch=True, queue_size=None)
            self._kinds[topic] = kind

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002 - theirs is the clock
        """Hand it to the thread that sends."""
        self.advertise({topic: kind})
        try:
            message = filled(self._kinds[topic](), fields)
        except (ValueError, TypeError, AttributeError) as error:
            raise SinkError(f"{topic} cannot be published as {kind}: {error}") from error
        self._hand_over(partial(self._publishers[topic].publish, message))

    def close(self) -> None:
        """Wait until everybody who has subscribed has been sent everything."""
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
        """Take the topics back."""
        self._problem = self._problem or "closed"
        with contextlib.suppress(queue.Full):  # who sends sees that there is a problem
            self._waiting.put_nowait(None)
        self._end()

    def _send(self) -> None:
        while (publish := self._waiting.get()) is not None and not self._problem:
            try:
                publish()
            except Exception as error:  # noqa: BLE001 - told by who publishes, or waits for the end
                self._problem = shortened(on_one_line(f"{type(error).__name__}: {error}"))
            self._waiting.task_done()

    def _hand_over(self, publish: Callable[[], None] | None) -> None:
        try:
            self._check()
            self._waiting.put(publish, timeout=STUCK_S)
        except queue.Full:
            raise SinkError(self._stuck()) from None

    def _drain(self) -> None:
        """Wait until nothing waits."""
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
        """Wait until all that the master knows to have subscribed are connected, but not twice for who did not come."""
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
        _in_time(lambda: [publisher.unregister() for publisher in self._publishers.values()])


class RospySource(Source):
    """Gives what others publish."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._rospy = _node(place, SourceError)
        self._master = _Master(SourceError)
        self._asked = time.monotonic()
        self._inbox = Inbox()
        self._subscribers: list[Any] = []

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe."""
        kinds = {topic: (kind, message_class(kind, SourceError)) for topic, kind in topics.items()}
        self._master.check()
        if not _in_time(partial(self._subscribe, kinds)):
            raise SourceError(
                f"the ROS master at {self._master.uri} has not registered us as a subscriber; see its log"
            )

    def _subscribe(self, topics: Mapping[str, tuple[str, Any]]) -> None:
        for topic, (kind, type_) in topics.items():
            heard = partial(self._heard, topic, kind)
            self._subscribers.append(self._rospy.Subscriber(topic, type_, heard, queue_size=100))

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """The oldest message that is here, or that comes within `wait_s`."""
        heard = self._inbox.get(wait_s)
        if heard is None and time.monotonic() - self._asked > 1:
            self._master.check()
            self._asked = time.monotonic()
        return heard

    def close(self) -> None:
        """Unsubscribe."""
        _in_time(lambda: [subscriber.unregister() for subscriber in self._subscribers])

    def _heard(self, topic: str, kind: str, message: Any) -> None:  # noqa: ANN401 - messages are untyped
        fields = fields_of(message)
        self._inbox.put(ReceivedMessage(topic, kind, fields, time.time_ns()), _weight(fields))


def _weight(value: object) -> int:
    """How many characters and fields `value` has."""
    match value:
        case dict():
            return 1 + sum(map(_weight, value.values()))
        case list() | tuple():
            return 1 + sum(map(_weight, value))
        case str() | bytes():
            return 1 + len(value)
        case _:
            return 1


def _in_time(work: Callable[[], object]) -> bool:
    """Do `work`, which asks the master, in a thread that may be left behind: rospy would ask for ever."""
    problems: list[Exception] = []

    def watched() -> None:
        try:
            work()
        except Exception as problem:  # noqa: BLE001 - whoever waits is told that it did not work
            problems.append(problem)

    doing = threading.Thread(target=watched, daemon=True, name="asks the master")
    doing.start()
    doing.join(NODE_S)
    return not doing.is_alive() and not problems
