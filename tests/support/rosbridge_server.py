"""A rosbridge of protocol v2 in a thread: it checks what it gets, and can misbehave in all the ways that we know of."""

from __future__ import annotations

import asyncio
import importlib
import json
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Self

from tornado.httpserver import HTTPServer
from tornado.web import Application
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from tests.support.leftovers import shared_by_tests
from tests.support.limits import HANG_S, wait_until

Message = dict[str, Any]


def begin_the_loop_of_roslibpy() -> None:
    """Begin what roslibpy has once for all connections of a process, and never ends: tests share it."""
    with shared_by_tests():
        importlib.import_module("roslibpy.comm.comm_asyncio")._get_shared_manager().run()  # noqa: SLF001


@dataclass
class Manner:
    """How a server behaves. It is good, unless told otherwise."""

    dies_after: int = 0
    """Publications, after which it closes every connection; 0 is never."""
    stalls: bool = False
    """It reads nothing once it has been told of a topic."""
    answers_services: bool = True
    complains: str = ""
    """What it says of every topic."""
    garbage: tuple[str | bytes, ...] = ()
    """What it sends to whoever subscribes, before anything else."""


@dataclass
class Server:
    """Enter it to have it run. Whatever is wrong with what it has got stands in `wrong`."""

    manner: Manner = field(default_factory=Manner)
    published: list[tuple[str, Message]] = field(default_factory=list)
    advertised: dict[str, str] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    log: list[str] = field(default_factory=list)
    """The operations, one after the other."""
    port: int = 0
    handlers: list[Handler] = field(default_factory=list)
    offered: dict[str, tuple[str, Handler]] = field(default_factory=dict)
    """The services that clients offer: the types, and who offers."""
    goals: list[Message] = field(default_factory=list)
    """The operations on goals of actions, which tests answer by `raw`."""
    calls: dict[str, tuple[str, Handler]] = field(default_factory=dict)
    """The calls of these that are not answered yet: how the caller has numbered them, and who calls."""

    def __enter__(self) -> Self:
        self._ready, self._end = threading.Event(), asyncio.Event()
        self.changed = threading.Condition()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()))
        self._thread.start()
        assert self._ready.wait(HANG_S)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join(HANG_S)
        assert not self._thread.is_alive()

    @property
    def place(self) -> str:
        return f"//127.0.0.1:{self.port}"

    def say(self, topic: str, message: object) -> None:
        """Publish to those who have subscribed."""
        self._loop.call_soon_threadsafe(self._say, topic, message)

    def raw(self, content: str | bytes) -> None:
        """Send this to everybody."""
        for handler in [*self.handlers]:
            self._loop.call_soon_threadsafe(handler.send, content)

    def die(self) -> None:
        """Break every connection, without a word."""
        wait_until(lambda: bool(self.handlers), "nobody is connected")
        for handler in [*self.handlers]:
            self._loop.call_soon_threadsafe(handler.break_off)

    def wait_for(self, what: Callable[[], object], seconds: float = HANG_S) -> bool:
        """Whether that comes to be so."""
        with self.changed:
            return bool(self.changed.wait_for(what, seconds))

    async def over(self) -> None:
        """Wait until the server ends."""
        await self._end.wait()

    def _say(self, topic: str, message: object) -> None:
        for handler in self.handlers:
            if topic in handler.subscribed:
                handler.send(json.dumps({"op": "publish", "topic": topic, "msg": message}))

    async def _serve(self) -> None:
        listener = socket.create_server(("127.0.0.1", 0))
        listener.setblocking(False)
        self.port, self._loop = listener.getsockname()[1], asyncio.get_running_loop()
        http = HTTPServer(Application([("/.*", Handler, {"server": self})]))
        http.add_socket(listener)
        self._ready.set()
        await self._end.wait()
        for handler in [*self.handlers]:
            handler.break_off()
        http.stop()
        await http.close_all_connections()


class Handler(WebSocketHandler):
    """One client."""

    def initialize(self, server: Server) -> None:
        self.server = server
        self.subscribed: dict[str, str] = {}

    def open(self, *_: str, **__: str) -> None:
        self.server.handlers.append(self)

    def on_close(self) -> None:
        with self.server.changed:
            if self in self.server.handlers:
                self.server.handlers.remove(self)
            for name, (_, provider) in [*self.server.offered.items()]:
                if provider is self:
                    del self.server.offered[name]
            self.server.log.append("closed")
            self.server.changed.notify_all()

    async def on_message(self, message: str | bytes) -> None:
        with self.server.changed:
            try:
                self._obey(json.loads(message))
            except (KeyError, TypeError, ValueError) as error:
                self.server.wrong.append(f"{error!r}: {message!r}")
            self.server.changed.notify_all()
        if self.server.manner.stalls:
            await self.server.over()

    def _obey(self, message: Message) -> None:  # noqa: C901, PLR0912 - a protocol's words
        server, manner = self.server, self.server.manner
        server.log.append(message["op"])
        match message["op"]:
            case "advertise":
                if message["topic"] in server.advertised or message["latch"] is not True:
                    server.wrong.append(f"advertised twice, or not latched: {message}")
                server.advertised[message["topic"]] = message["type"]
                if manner.complains:
                    self.send(json.dumps({"op": "status", "level": "error", "msg": manner.complains}))
            case "unadvertise":
                del server.advertised[message["topic"]]
            case "publish":
                if message["topic"] not in server.advertised:
                    server.wrong.append(f"not advertised: {message}")
                server.published.append((message["topic"], message["msg"]))
                server._say(message["topic"], message["msg"])  # noqa: SLF001 - in its own loop
                if len(server.published) == manner.dies_after:
                    self.break_off()
            case "subscribe":
                self.subscribed[message["topic"]] = message["type"]
                for garbage in manner.garbage:
                    self.send(garbage)
            case "unsubscribe":
                del self.subscribed[message["topic"]]
            case "advertise_service":
                server.offered[message["service"]] = message["type"], self
                if manner.complains:
                    self.send(json.dumps({"op": "status", "level": "error", "msg": manner.complains}))
            case "unadvertise_service":
                del server.offered[message["service"]]
            case "call_service" if message["service"] in server.offered:
                number = f"service_request:{message['service']}:{len(server.log)}"
                server.calls[number] = message["id"], self
                passed = {"op": "call_service", "id": number, "service": message["service"]}
                server.offered[message["service"]][1].send(json.dumps({**passed, "args": message["args"]}))
            case "service_response":
                number, caller = server.calls.pop(message["id"])
                caller.send(json.dumps({**message, "id": number}))
            case operation if "action" in operation:
                server.goals.append(message)
            case "call_service" if manner.answers_services:
                answer = {"op": "service_response", "id": message["id"], "service": message["service"]}
                self.send(json.dumps({**answer, "values": "there is no such service", "result": False}))
            case "call_service":
                pass
            case operation:
                server.wrong.append(f"unknown operation {operation}")

    def send(self, content: str | bytes) -> None:
        """Send this, unless the client is gone: a rosbridge drops what it can no longer deliver."""
        with suppress(WebSocketClosedError):
            sent = self.write_message(content, binary=isinstance(content, bytes))
            sent.add_done_callback(lambda done: done.cancelled() or done.exception())  # it is known, and not logged

    def break_off(self) -> None:
        if self.ws_connection is not None and self.ws_connection.stream is not None:
            self.ws_connection.stream.close()
