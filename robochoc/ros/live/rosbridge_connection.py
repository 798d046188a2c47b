"""A connection to a rosbridge by roslibpy (protocol rosbridge v2), and the JSON of its messages.

Only this module uses roslibpy. A place is `//HOST:PORT`, or `wss://HOST:PORT` for TLS.

The version of ROS need not be known. Times are sent in JSON as `secs` and `nsecs`, which the bridges of both versions
accept, and may be received as `sec` and `nanosec` from ROS 2. JSON has no NaN: it is received as null, and sent as
`NaN`, which the bridges' parsers (Python's) accept.
"""

from __future__ import annotations

import importlib
import logging
import math
import socket
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from functools import partial
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.robots.sink import Fields
from robochoc.system.errors import RobochocError

_DEPTH_MAX = 10
"""The maximum nesting depth of fields."""
_BILLION = 1_000_000_000
_SECONDS = range(-(2**31), 2**32)
PORT = 9090
"""The default port of rosbridge."""
CONNECT_S = 5.0
"""The longest wait for a server's answer, in seconds."""
DRAIN_S = 10.0
"""The longest time in which the server may leave messages unread, in seconds."""
LOOP_S = 10.0
"""The longest wait for the connection's thread, in seconds."""
CONFIRM_S = 3.0
"""The longest wait for the confirmation that all messages were read, in seconds. Servers without services send none."""
CLOSE_S = 4.0
"""The longest wait for the closing handshake, in seconds; shorter than roslibpy's."""
MESSAGE_BYTES_MAX = 256 * 1024
"""Longer messages from the server end the connection: reports are short."""
_BUFFERED = 1_000_000
"""The number of unsent bytes beyond which the sink waits for the server."""
_START = "start it there: `roslaunch rosbridge_server rosbridge_websocket.launch`, or `ros2 launch` the .xml in ROS 2"


class RosbridgeAddress(NamedTuple):
    """The address of a rosbridge."""

    host: str
    port: int
    secure: bool = False
    path: str = ""

    @classmethod
    def parse(cls, place: str) -> RosbridgeAddress:
        """Parse a place. Raises `ValueError`."""
        wanted = f"expected rosbridge://HOST:PORT, as in rosbridge://localhost:{PORT}, or rosbridge:wss://HOST:PORT"
        try:
            parts = urlsplit(place if "//" in place else f"//{place}")
            port = PORT if parts.port is None else parts.port
        except ValueError as error:
            raise ValueError(f"{shortened(place)!r}: {error}; {wanted}") from error
        if not parts.hostname or parts.scheme not in {"", "ws", "wss"} or parts.query or parts.username or port == 0:
            raise ValueError(f"{shortened(place)!r} is not the address of a rosbridge; {wanted}")
        return cls(parts.hostname, port, parts.scheme == "wss", parts.path)

    @property
    def url(self) -> str:
        """The WebSocket URL of the address."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{'wss' if self.secure else 'ws'}://{host}:{self.port}{self.path}"


class Connection:
    """A connection to a rosbridge. Raises `failed` if no rosbridge answers, or if the connection is lost."""

    def __init__(self, place: str, failed: type[Exception]) -> None:
        self._failed = failed
        try:
            address = RosbridgeAddress.parse(place)
        except ValueError as error:
            raise failed(str(error)) from error
        self.url = address.url
        self.ended = threading.Event()
        self.error = ""
        self._transport: Any = None
        self.on_end: Callable[[], None] = lambda: None
        ready = threading.Event()
        _check_listening(address, failed)
        self.roslibpy = _roslibpy(failed)
        self.ros = _connect(self.roslibpy, self.url)
        self.ros.on("close", self._on_close)
        self.ros.factory.on_ready(partial(self._on_open, ready))
        until = time.monotonic() + CONNECT_S
        while not ready.wait(0.02):
            if self.ended.is_set() or time.monotonic() > until:
                self.abort()
                secure = ", or this machine does not trust its certificate" if address.secure else ""
                raise failed(f"the server at {self.url} does not answer as a rosbridge{secure}; {_START}")

    def _on_open(self, ready: threading.Event, protocol: Any) -> None:  # noqa: ANN401 - roslibpy is untyped
        self._protocol, self._transport = protocol, protocol.transport
        # roslibpy ignores status messages, and has no public way to register a handler for them.
        protocol._message_handlers["status"] = self._on_status  # noqa: SLF001
        ready.set()

    def _on_status(self, message: Mapping[str, object]) -> None:
        if message.get("level") == "error":
            self.error = self.error or shortened(on_one_line(str(message.get("msg", ""))[:1000]))

    def _on_close(self, *_: object) -> None:
        self.ended.set()
        self.on_end()

    def topic(self, name: str, kind: str) -> Any:  # noqa: ANN401 - roslibpy is untyped
        """Return a latched topic, to publish or subscribe. Bridges of both versions accept types without `/msg/`."""
        return self.roslibpy.Topic(self.ros, name, kind.replace("/msg/", "/"), latch=True, reconnect_on_close=False)

    def serve(self, name: str, kind: str, receive: Callable[[object], None]) -> None:
        """Offer the service `name` of the type `kind`; pass each call to `receive`, in the connection's thread.

        Services of roslibpy must answer before they return; ours answer later, when a team has decided.
        """
        self.ros.on(name, receive)
        self._send_operation(op="advertise_service", type=kind, service=name)

    def respond(self, name: str, number: str | int, values: Mapping[str, object]) -> None:
        """Answer the call `number` of the service `name`. Without a connection, the answer is dropped."""
        self._send_operation(op="service_response", service=name, id=number, values=dict(values), result=True)

    def stop_serving(self, names: Iterable[str]) -> None:
        """Stop offering services."""
        for name in names:
            self._send_operation(op="unadvertise_service", service=name)

    def send(self, operation: Mapping[str, object]) -> None:
        """Send an operation of the protocol in the background. Without a connection, it is dropped."""
        if not self.ended.is_set():
            self.ros.send_on_ready(self.roslibpy.Message(dict(operation)))

    def intercept(self, operation: str, receive: Callable[[Mapping[str, object]], bool]) -> None:
        """Pass messages of the type `operation` to `receive`, in the connection's thread.

        Messages for which it returns False are handled by roslibpy.
        """
        handlers = self._protocol._message_handlers  # noqa: SLF001 - roslibpy has no public way
        usual = handlers.get(operation)

        def handle(message: Mapping[str, object]) -> None:
            if not receive(message) and usual is not None:
                usual(message)

        handlers[operation] = handle

    def _send_operation(self, **fields: object) -> None:
        self.send(fields)

    def check(self) -> None:
        """Raise `failed` if the connection is lost."""
        if self.ended.is_set():
            raise self._failed(f"the rosbridge at {self.url} has closed the connection; see its log, and start again")

    def drain(self) -> None:
        """Wait until all messages have been sent. Raises `failed` if the server stops reading, or is lost."""
        left, since = self._buffered(), time.monotonic()
        while left:
            self.check()
            if time.monotonic() - since > DRAIN_S:
                raise self._failed(
                    f"the rosbridge at {self.url} has not read any data for {DRAIN_S:g} s; see its log, and start again"
                )
            time.sleep(0.005)
            now = self._buffered()
            left, since = now, (time.monotonic() if now < left else since)
        self.check()

    def is_ahead(self) -> bool:
        """Return whether more than `_BUFFERED` bytes wait to be sent."""
        return self._buffered() > _BUFFERED

    def _buffered(self) -> int:
        """Return the number of bytes that wait to be sent."""
        size: Future[int] = Future()

        def measure() -> None:
            size.set_result(self._transport.get_write_buffer_size())

        self.ros.factory.manager.loop.call_soon_threadsafe(measure)
        try:
            return size.result(LOOP_S)
        except TimeoutError:
            raise self._failed(f"the rosbridge at {self.url} does not respond: restart robochoc") from None

    def confirm(self) -> bool:
        """Wait until the server has handled all messages. Return whether the server confirms this.

        A server that closes a connection drops messages that it has read but not handled. So a service is called: the
        server handles requests in order, and answers calls of any service, even if the service does not exist.
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
        """End the connection and wait; return whether the server agreed, which means that it has read all messages."""
        if not self.ended.is_set():
            self._protocol.send_close()
            if not self.ended.wait(CLOSE_S):
                self.abort()
        return bool(self._protocol.wasClean)

    def abort(self) -> None:
        """End the connection at once."""
        factory = self.ros.factory
        factory._stop = True  # noqa: SLF001 - otherwise the factory would retry
        if self._transport is not None:
            factory.manager.loop.call_soon_threadsafe(self._transport.abort)
            self.ended.wait(CLOSE_S)


def _check_listening(address: RosbridgeAddress, failed: type[Exception]) -> None:
    """Raise `failed` with the reason if no server listens at `address`. roslibpy gives no reason."""
    try:
        socket.create_connection((address.host, address.port), CONNECT_S).close()
    except OSError as error:
        why = error.strerror or str(error) or type(error).__name__
        raise failed(f"no rosbridge listens at {address.url} ({why}); {_START}") from error
    except UnicodeError as error:
        raise failed(f"{shortened(address.host)!r} is not a host name") from error


def _roslibpy(failed: type[Exception]) -> Any:  # noqa: ANN401 - it is untyped
    """Return the optional module roslibpy, with its log switched off, since errors are raised here."""
    try:
        roslibpy = importlib.import_module("roslibpy")
        importlib.import_module("roslibpy.comm").select_factory("asyncio")
    except ModuleNotFoundError as missing:
        raise failed(f"rosbridge needs {missing.name}; run: pip install 'robochoc[rosbridge]'") from missing
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise failed(f"rosbridge needs roslibpy 2.1 or later, over asyncio: {error}") from error
    for name in ("roslibpy", "autobahn"):
        logging.getLogger(name).addHandler(logging.NullHandler())
        logging.getLogger(name).propagate = False
    logging.getLogger("asyncio").addFilter(_is_worth_logging)
    return roslibpy


def _is_worth_logging(record: logging.LogRecord) -> bool:
    """Return False for the log records that asyncio writes for each message to a lost server."""
    return record.msg != "socket.send() raised exception."


def _connect(roslibpy: Any, url: str) -> Any:  # noqa: ANN401 - roslibpy is untyped
    """Return a new connection, which does not reconnect."""

    class Once(roslibpy.Ros):  # type: ignore[misc]  # untyped
        """Does not reconnect, and accepts only short, uncompressed messages: compressed messages may become long."""

        def connect(self) -> None:
            if not self.is_connecting:
                self.factory.maxRetries = 0
                self.factory.setProtocolOptions(
                    maxFramePayloadSize=MESSAGE_BYTES_MAX,
                    maxMessagePayloadSize=MESSAGE_BYTES_MAX,
                    perMessageCompressionOffers=[],
                    perMessageCompressionAccept=lambda _: None,
                )
            super().connect()

    # The loop's thread is a daemon that later connections in this process reuse. asyncio is used because Twisted would
    # add thread pools, signal handlers and a log.
    connection = Once(url, transport="asyncio")
    connection.factory.manager.loop.set_exception_handler(lambda *_: None)
    return connection


class MalformedMessageError(RobochocError, ValueError):
    """A message from the server is malformed."""


def outgoing(fields: Fields) -> dict[str, Any]:
    """Return `fields` as the JSON that rosbridge accepts."""
    return {name: _encoded(name, value) for name, value in fields.items()}


def _encoded(name: str, value: object) -> object:
    match value:
        case Mapping():
            return outgoing(value)
        case list() | tuple():
            return [_encoded("", item) for item in value]
        case int() if name == "stamp":
            seconds, rest = divmod(value, _BILLION)
            return {"secs": seconds, "nsecs": rest}
        case int() if name == "duration":  # only in services of ROS 2
            seconds, rest = divmod(value, _BILLION)
            return {"sec": seconds, "nanosec": rest}
        case _:
            return value


def incoming(message: object) -> tuple[dict[str, Any], int]:
    """Return the fields of a `message` from rosbridge, and its weight: the number of characters and fields.

    Raises:
        MalformedMessageError: `message` is not an object, is nested too deeply, or has an invalid time.
    """
    if not isinstance(message, dict):
        raise MalformedMessageError("not an object")
    return _object(message, 0)


def _object(message: dict[str, Any], depth: int) -> tuple[dict[str, Any], int]:
    if depth > _DEPTH_MAX:
        raise MalformedMessageError(f"nested more than {_DEPTH_MAX} levels deep")
    fields: dict[str, Any] = {}
    weight = 1
    for name, value in message.items():
        fields[name], more = (_stamp(value), 1) if name == "stamp" else _decoded(value, depth + 1)
        weight += len(name) + more
    return fields, weight


def _decoded(value: object, depth: int) -> tuple[Any, int]:
    match value:
        case dict():
            return _object(value, depth)
        case list():
            if depth > _DEPTH_MAX:
                raise MalformedMessageError(f"nested more than {_DEPTH_MAX} levels deep")
            parts = [_decoded(item, depth + 1) for item in value]
            return [part for part, _ in parts], 1 + sum(weight for _, weight in parts)
        case str():
            return value, 1 + len(value)
        case None:
            return math.nan, 1
        case _:
            return value, 1


def _stamp(value: object) -> int:
    """Return the nanoseconds of a time with the field names of ROS 1 or ROS 2."""
    match value:
        case {"secs": int(seconds), "nsecs": int(rest)} | {"sec": int(seconds), "nanosec": int(rest)} if (
            seconds in _SECONDS and 0 <= rest < _BILLION
        ):
            return seconds * _BILLION + rest
        case _:
            raise MalformedMessageError("'stamp' is not a time")
