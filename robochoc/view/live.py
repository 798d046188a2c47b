"""The scene in meshcat's live viewer: our own server sends the page, and the commands over a WebSocket.

meshcat's server is not used, since it listens on all interfaces, opens a zmq socket, and outlives its parent. Our
server runs in the calling thread, only on the loopback interface, below an unguessable path (`loopback.py`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from tornado.web import Application

from robochoc.view.drawing import commands
from robochoc.view.local_address import loopback_socket, secret_path, url_of
from robochoc.view.loopback import SecretPage, SecretSocket, application, in_browser, served
from robochoc.view.page import live_page
from robochoc.view.scene import Scene


def serve_scene(
    scene: Scene, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Show `scene` to browsers on this machine; return after an interrupt (Ctrl-C).

    Args:
        scene: The scene.
        port: The port; 0 selects any free port.
        open_browser: True to open the scene in the user's browser.
        ready: Called with the URL once it can be opened.

    Raises:
        OSError: The port is in use.
    """
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(scene, port, ready, open_browser=open_browser))


async def _serve(scene: Scene, port: int, ready: Callable[[str], None] | None, *, open_browser: bool) -> None:
    with loopback_socket(port) as here:
        secret = secret_path()
        url = url_of(here, f"{secret}/")
        async with served(_application(scene, here.getsockname()[1], secret), here):
            if ready:
                ready(url)
            async with in_browser(url, enabled=open_browser):
                await asyncio.Event().wait()


def _application(scene: Scene, port: int, secret: str) -> Application:
    return application(
        [
            (r"/([^/]*)/", SecretPage, {"secret": secret, "page": live_page(scene, port)}),
            (r"/([^/]*)/commands", _Commands, {"secret": secret, "commands": commands(scene)}),
        ]
    )


class _Commands(SecretSocket):
    """Sends all commands to each browser."""

    def initialize(self, secret: str, commands: list[bytes]) -> None:
        self.secret = secret
        self.commands = commands

    def open(self, *_: str) -> None:
        for command in self.commands:
            self.write_message(command, binary=True)
