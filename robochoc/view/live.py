"""The scene in meshcat's live viewer: the page from a server of our own, the commands over its WebSocket.

meshcat's server listens on every interface, with a zmq socket beside it, and outlives its parent. This one is the
calling thread itself, on the loopback interface only. Other sites in the same browser get nothing from it: a Host
that is not this machine's (DNS rebinding) is not found, and tornado refuses a WebSocket of another Origin.
"""

from __future__ import annotations

import asyncio
import webbrowser
from collections.abc import Callable
from contextlib import suppress
from socket import create_server

from tornado.httpserver import HTTPServer
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketHandler

from robochoc.view.page import live_page
from robochoc.view.scene import Scene
from robochoc.view.stage import commands

_LOOPBACK = "127.0.0.1"
_LONGEST_MESSAGE_BYTES = 1024
"""Of a browser, which has nothing to say."""


def serve(
    scene: Scene, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Show `scene` to every browser of this machine that asks, until interrupted (Ctrl-C); then return.

    Port 0 is any free one. `ready` is told the URL once it can be opened. Raises `OSError` when the port is taken.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(scene, port, ready, open_browser=open_browser))


async def _serve(scene: Scene, port: int, ready: Callable[[str], None] | None, *, open_browser: bool) -> None:
    with create_server((_LOOPBACK, port)) as listening:
        listening.setblocking(False)
        port = listening.getsockname()[1]
        url = f"http://{_LOOPBACK}:{port}/"
        server = HTTPServer(_application(scene, port))
        server.add_socket(listening)
        try:
            if ready:
                ready(url)
            if open_browser:
                # In a thread, because a browser for the terminal would not return before it is closed.
                await asyncio.to_thread(webbrowser.open, url)
            await asyncio.Event().wait()
        finally:
            server.stop()
            await server.close_all_connections()


def _application(scene: Scene, port: int) -> Application:
    application = Application(websocket_max_message_size=_LONGEST_MESSAGE_BYTES, log_function=lambda _: None)
    application.add_handlers(
        r"(127\.0\.0\.1|localhost)$",
        [
            (r"/", _Page, {"page": live_page(scene, port)}),
            (r"/commands", _Commands, {"commands": commands(scene)}),
        ],
    )
    return application


class _Page(RequestHandler):
    def initialize(self, page: bytes) -> None:
        self.page = page

    def get(self) -> None:
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.write(self.page)


class _Commands(WebSocketHandler):
    """Sends each browser everything from the start; what browsers say is ignored."""

    def initialize(self, commands: list[bytes]) -> None:
        self.commands = commands

    def open(self, *_: str) -> None:
        for command in self.commands:
            self.write_message(command, binary=True)

    def on_message(self, message: str | bytes) -> None:
        del message
