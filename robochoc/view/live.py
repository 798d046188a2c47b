"""The scene in meshcat's live viewer: the page from a server of our own, the commands over its WebSocket.

meshcat's server listens on every interface, with a zmq socket beside it, and outlives its parent. This one is the
calling thread itself, on the loopback interface only (`loopback.py`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from tornado.web import Application
from tornado.websocket import WebSocketHandler

from robochoc.view.address import listening, url_of
from robochoc.view.loopback import FixedPage, application, open_in_browser, served
from robochoc.view.page import live_page
from robochoc.view.scene import Scene
from robochoc.view.stage import commands


def serve(
    scene: Scene, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Show `scene` to every browser of this machine that asks, until interrupted (Ctrl-C); then return.

    Port 0 is any free one. `ready` is told the URL once it can be opened. Raises `OSError` when the port is taken.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(scene, port, ready, open_browser=open_browser))


async def _serve(scene: Scene, port: int, ready: Callable[[str], None] | None, *, open_browser: bool) -> None:
    with listening(port) as here:
        url = url_of(here)
        async with served(_application(scene, here.getsockname()[1]), here):
            if ready:
                ready(url)
            if open_browser:
                await open_in_browser(url)
            await asyncio.Event().wait()


def _application(scene: Scene, port: int) -> Application:
    return application(
        [
            (r"/", FixedPage, {"page": live_page(scene, port)}),
            (r"/commands", _Commands, {"commands": commands(scene)}),
        ]
    )


class _Commands(WebSocketHandler):
    """Sends each browser everything from the start; what browsers say is ignored."""

    def initialize(self, commands: list[bytes]) -> None:
        self.commands = commands

    def open(self, *_: str) -> None:
        for command in self.commands:
            self.write_message(command, binary=True)

    def on_message(self, message: str | bytes) -> None:
        del message
