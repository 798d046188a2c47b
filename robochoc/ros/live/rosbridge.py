"""rosbridge: topics of a ROS 1 or a ROS 2 over a WebSocket, so that none has to be installed here.

roslibpy speaks the protocol (rosbridge v2), and is wrapped here alone. A place is `//HOST:PORT`, or `wss://HOST:PORT`
for TLS. Times travel as `secs` and `nsecs`: both ROS's bridges take these, ROS 2's besides `sec` and `nanosec`, which
it sends; so nobody has to say which ROS is there. A number that JSON has no form for comes as null, and is read as NaN;
it is sent as `NaN`, which the readers that bridges use (Python's) understand.
"""

from __future__ import annotations

import importlib
import logging
import math
import socket
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import partial
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.ros.live.inbox import Inbox
from robochoc.ros.sink import Fields, Sink, SinkError
from robochoc.ros.source import ReceivedMessage, Source, SourceError

PORT = 9090
"""Where rosbridge listens, where nobody says otherwise."""
CONNECT_S = 5.0
"""How long a server may take to answer."""
DRAIN_S = 10.0
"""How long it may read nothing of what is there for it."""
CONFIRM_S = 3.0
"""How long it may take to confirm that it has read all. One that forbids services never does."""
CLOSE_S = 4.0
"""How long it may take to agree to the end; less than roslibpy would wait."""
MOST_BYTES = 256 * 1024
"""A message from the server is no longer: reports are short."""
_BUFFERED = 1_000_000
"""Bytes on their way to the server before we wait for it."""
_LOOK_EVERY = 100
"""Messages published between two looks at how many bytes are on their way."""
_DEEPEST = 10
"""A message's fields within fields."""
_BILLION = 1_000_000_000
_SECONDS = range(-(2**31), 2**32)
_START = "start it there: `roslaunch rosbridge_server rosbridge_websocket.launch`, or `ros2 launch` the .xml in ROS 2"


class MalformedMessageError(ValueError):
    """What came is no message's fields."""


def outgoing(fields: Fields) -> dict[str, Any]:
    """`fields` as rosbridge takes them."""
    return {name: _sent(name, value) for name, value in fields.items()}


def _sent(name: str, value: object) -> object:
    match value:
        case Mapping():
            return outgoing(value)
        case list() | tuple():
            return [_sent("", one) for one in value]
        case int() if name == "stamp":
            seconds, rest = divmod(value, _BILLION)
            return {"secs": seconds, "nsecs": rest}
        case _:
            return value


def incoming(message: object) -> tuple[dict[str, Any], int]:
    """The fields of a `message` that rosbridge sent, and what they weigh in characters and fields.

    Raises `MalformedMessageError`.
    """
    if not isinstance(message, dict):
        raise MalformedMessageError("no object")
    return _object(message, 0)


def _object(message: dict[str, Any], depth: int) -> tuple[dict[str, Any], int]:
    if depth > _DEEPEST:
        raise MalformedMessageError(f"nested more than {_DEEPEST} deep")
    fields: dict[str, Any] = {}
    weight = 1
    for name, value in message.items():
        fields[name], more = (_stamp(value), 1) if name == "stamp" else _came(value, depth + 1)
        weight += len(name) + more
    return fields, weight


def _came(value: object, depth: int) -> tuple[Any, int]:
    match value:
        case dict():
            return _object(value, depth)
        case list():
            if depth > _DEEPEST:
                raise MalformedMessageError(f"nested more than {_DEEPEST} deep")
            parts = [_came(one, depth + 1) for one in value]
            return [part for part, _ in parts], 1 + sum(weight for _, weight in parts)
        case str():
            return value, 1 + len(value)
        case None:
            return math.nan, 1
        case _:
            return value, 1


def _stamp(value: object) -> int:
    """Nanoseconds, by ROS 1's names or by ROS 2's."""
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            raise MalformedMessageError("'stamp' is no time")


class Address(NamedTuple):
    """Where a rosbridge listens."""

    host: str
    port: int
    secure: bool = False
    path: str = ""

    @classmethod
    def of(cls, place: str) -> Address:
        """Raises `ValueError`, saying what was expected."""
        wanted = f"expected rosbridge://HOST:PORT, as in rosbridge://localhost:{PORT}, or rosbridge:wss://HOST:PORT"
        try:
            parts = urlsplit(place if "//" in place else f"//{place}")
            port = PORT if parts.port is None else parts.port
        except ValueError as error:
            raise ValueError(f"{shortened(place)!r}: {error}; {wanted}") from error
        if not parts.hostname or parts.scheme not in {"", "ws", "wss"} or parts.query or parts.username or port == 0:
            raise ValueError(f"{shortened(place)!r} is no place of a rosbridge; {wanted}")
        return cls(parts.hostname, port, parts.scheme == "wss", parts.path)

    @property
    def url(self) -> str:
        """As WebSockets have it."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'wss' if self.secure else 'ws'}://{host}:{self.port}{self.path}"


class _Bridge:
    """A connection. Raises what it is told to raise when there is none (any more)."""

    def __init__(self, place: str, failed: type[Exception]) -> None:
        self._failed = failed
        try:
            address = Address.of(place)
        except ValueError as error:
            raise failed(str(error)) from error
        self.url = address.url
        self.over = threading.Event()
        self.complaint = ""
        self._transport: Any = None
        self.on_over: Callable[[], None] = lambda: None
        ready = threading.Event()
        _reach(address, failed)
        self.roslibpy = _roslibpy(failed)
        self.ros = _connection(self.roslibpy, self.url)
        self.ros.on("close", self._is_over)
        self.ros.factory.on_ready(partial(self._opened, ready))
        until = time.monotonic() + CONNECT_S
        while not ready.wait(0.02):
            if self.over.is_set() or time.monotonic() > until:
                self.abort()
                secure = ", or this machine does not trust its certificate" if address.secure else ""
                raise failed(f"what listens at {self.url} does not answer as a rosbridge does{secure}; {_START}")

    def _opened(self, ready: threading.Event, protocol: Any) -> None:  # noqa: ANN401 - roslibpy is untyped
        self._protocol, self._transport = protocol, protocol.transport
        # roslibpy knows of these messages, but not what to do with them, and lets nobody else register for them.
        protocol._message_handlers["status"] = self._told  # noqa: SLF001
        ready.set()

    def _told(self, message: Mapping[str, object]) -> None:
        if message.get("level") == "error":
            self.complaint = self.complaint or shortened(on_one_line(str(message.get("msg", ""))[:1000]))

    def _is_over(self, *_: object) -> None:
        self.over.set()
        self.on_over()

    def topic(self, name: str, kind: str) -> Any:  # noqa: ANN401 - roslibpy is untyped
        """A topic to publish on, latched, or to listen to. The bridges of both know types without a `/msg/`."""
        return self.roslibpy.Topic(self.ros, name, kind.replace("/msg/", "/"), latch=True, reconnect_on_close=False)

    def check(self) -> None:
        """Raise what is to be raised if there is no connection any more."""
        if self.over.is_set():
            raise self._failed(f"the rosbridge at {self.url} has closed the connection; see its log, and start again")

    def drain(self) -> None:
        """Wait until all that was sent has left. Raises if the server reads nothing for some time, or is gone."""
        left, since = self._buffered(), time.monotonic()
        while left:
            self.check()
            if time.monotonic() - since > DRAIN_S:
                raise self._failed(
                    f"the rosbridge at {self.url} has read nothing for {DRAIN_S:g} s; see its log, and start again"
                )
            time.sleep(0.005)
            now = self._buffered()
            left, since = now, (time.monotonic() if now < left else since)
        self.check()

    def is_ahead(self) -> bool:
        """Whether so much is on its way that we should wait."""
        return self._buffered() > _BUFFERED

    def _buffered(self) -> int:
        """Bytes that the server has not taken yet."""
        size: Future[int] = Future()

        def look() -> None:
            size.set_result(self._transport.get_write_buffer_size())

        self.ros.factory.manager.loop.call_soon_threadsafe(look)
        try:
            return size.result(DRAIN_S)
        except TimeoutError:
            raise self._failed(f"the connection to the rosbridge at {self.url} is stuck; start again") from None

    def confirm(self) -> bool:
        """Whether the server has dealt with all that was sent. Wait for it: one that closes forgets what it has read.

        It answers any call of a service, be it that there is none of that name, and it takes things in their order.
        """
        answered = threading.Event()
        service = self.roslibpy.Service(self.ros, "/rosapi/get_time", "rosapi/GetTime")
        service.call(self.roslibpy.ServiceRequest(), lambda _: answered.set(), lambda _: answered.set())
        until = time.monotonic() + CONFIRM_S
        while not answered.wait(0.01) and time.monotonic() < until:
            self.check()
        self.drain()
        return answered.is_set()

    def close(self) -> bool:
        """End the connection, and wait until it has ended: whether the server has agreed, having read everything."""
        if not self.over.is_set():
            self._protocol.send_close()
            if not self.over.wait(CLOSE_S):
                self.abort()
        return bool(self._protocol.wasClean)

    def abort(self) -> None:
        """End it at once."""
        factory = self.ros.factory
        factory._stop = True  # noqa: SLF001 - it would go on trying
        if self._transport is not None:
            factory.manager.loop.call_soon_threadsafe(self._transport.abort)
            self.over.wait(CLOSE_S)


def _reach(address: Address, failed: type[Exception]) -> None:
    """Whether anybody listens there: roslibpy would not say why not."""
    try:
        socket.create_connection((address.host, address.port), CONNECT_S).close()
    except OSError as error:
        why = error.strerror or str(error) or type(error).__name__
        raise failed(f"no rosbridge listens at {address.url} ({why}); {_START}") from error
    except UnicodeError as error:
        raise failed(f"{shortened(address.host)!r} is no name of a host") from error


def _roslibpy(failed: type[Exception]) -> Any:  # noqa: ANN401 - it is untyped
    """roslibpy, which is an extra. What goes wrong in it is raised here: it should not stand on stderr too."""
    try:
        roslibpy = importlib.import_module("roslibpy")
        importlib.import_module("roslibpy.comm").select_factory("asyncio")
    except ModuleNotFoundError as missing:
        raise failed(f"rosbridge needs {missing.name}; say: pip install 'robochoc[rosbridge]'") from missing
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise failed(f"rosbridge needs roslibpy 2.1 or later, over asyncio: {error}") from error
    for name in ("roslibpy", "autobahn"):
        logging.getLogger(name).addHandler(logging.NullHandler())
        logging.getLogger(name).propagate = False
    logging.getLogger("asyncio").addFilter(_is_news)
    return roslibpy


def _is_news(record: logging.LogRecord) -> bool:
    """Whether it is not what asyncio says of each message that is sent to a server that has just gone."""
    return record.msg != "socket.send() raised exception."


def _connection(roslibpy: Any, url: str) -> Any:  # noqa: ANN401 - roslibpy is untyped
    """A connection that is being made, once, and never again."""

    class Connection(roslibpy.Ros):  # type: ignore[misc]  # untyped
        """It takes short messages only, and none compressed: those may become long ones. It does not come back."""

        def connect(self) -> None:
            if not self.is_connecting:
                self.factory.maxRetries = 0
                self.factory.setProtocolOptions(
                    maxFramePayloadSize=MOST_BYTES,
                    maxMessagePayloadSize=MOST_BYTES,
                    perMessageCompressionOffers=[],
                    perMessageCompressionAccept=lambda _: None,
                )
            super().connect()

    # The loop's thread is a daemon, and stays for the next connection of this process. It is asyncio's: Twisted's would
    # be no other, but has thread pools, handlers of its own, and a log.
    connection = Connection(url, transport="asyncio")
    connection.factory.manager.loop.set_exception_handler(lambda *_: None)
    return connection


class RosbridgeSink(Sink):
    """Publishes through a rosbridge. Topics are latched: who subscribes later hears the last message of each."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._bridge = _Bridge(place, SinkError)
        self._topics: dict[str, Any] = {}
        self._published = 0

    def advertise(self, topics: Mapping[str, str]) -> None:
        """Tell the server of `topics`."""
        self._check()
        for name, kind in topics.items():
            if name not in self._topics:
                topic = self._bridge.topic(name, kind)
                topic.advertise()
                self._topics[name] = topic

    def publish(self, topic: str, kind: str, fields: Fields, at_ns: int) -> None:  # noqa: ARG002 - theirs is the clock
        """Send it; it leaves in its own time."""
        self.advertise({topic: kind})
        self._topics[topic].publish(outgoing(fields))
        self._published += 1
        if self._published % _LOOK_EVERY == 0 and self._bridge.is_ahead():
            self._bridge.drain()

    def close(self) -> None:
        """Wait until the server has read all of it."""
        try:
            self._check()
            self._bridge.drain()
            is_confirmed = self._bridge.confirm()
            self._check()
        except SinkError:
            self._bridge.abort()
            raise
        if not self._bridge.close() and not is_confirmed:
            raise SinkError(f"the rosbridge at {self._bridge.url} has not said that it has read all; see its log")

    def discard(self) -> None:
        """Hang up."""
        self._bridge.abort()

    def _check(self) -> None:
        self._bridge.check()
        if self._bridge.complaint:
            raise SinkError(f"the rosbridge at {self._bridge.url} complains: {self._bridge.complaint}; see its log")


class RosbridgeSource(Source):
    """Gives what others publish. A message that is none, or that nobody asked for, is passed over."""

    def __init__(self, place: str) -> None:
        super().__init__(place)
        self._inbox = Inbox()
        self._bridge = _Bridge(place, SourceError)
        self._bridge.on_over = self._inbox.wake

    def listen(self, topics: Mapping[str, str]) -> None:
        """Subscribe."""
        self._bridge.check()
        for name, kind in topics.items():
            topic = self._bridge.topic(name, kind)
            topic.subscribe(partial(self._heard, name, kind))

    def next(self, wait_s: float) -> ReceivedMessage | None:
        """The oldest message that is here, or that comes within `wait_s`."""
        heard = self._inbox.get(wait_s, over=self._bridge.over)
        if heard is None:
            self._bridge.check()
        return heard

    def close(self) -> None:
        """Hang up."""
        self._bridge.close()

    def _heard(self, topic: str, kind: str, message: object) -> None:
        try:
            fields, weight = incoming(message)
        except MalformedMessageError:
            return
        self._inbox.put(ReceivedMessage(topic, kind, fields, time.time_ns()), weight)
