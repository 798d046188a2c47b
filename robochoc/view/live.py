"""The scene in meshcat's live viewer: the page from a server of our own, the commands over its WebSocket.

meshcat's server listens on every interface, with a zmq socket beside it, and outlives its parent. This one is the
calling thread itself, on the loopback interface only, below a path that cannot be guessed (`loopback.py`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from tornado.web import Application

from robochoc.view.address import loopback_socket, secret_path, url_of
from robochoc.view.drawing import commands
from robochoc.view.loopback import SecretPage, SecretSocket, application, in_browser, served
from robochoc.view.page import live_page
from robochoc.view.scene import Scene


def serve_scene(
    scene: Scene, *, port: int = 0, open_browser: bool = False, ready: Callable[[str], None] | None = None
) -> None:
    """Show `scene` to every browser of this machine that asks, until interrupted (Ctrl-C); then return.

    Args:
        scene: What to show.
        port: The port; 0 is any free one.
        open_browser: Whether the user's browser is asked to show it.
        ready: Called with the URL once it can be opened.

    Raises:
        OSError: The port is taken.
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
            async with in_browser(url, wanted=open_browser):
                await asyncio.Event().wait()


def _application(scene: Scene, port: int, secret: str) -> Application:
    return application(
        [
            (r"/([^/]*)/", SecretPage, {"secret": secret, "page": live_page(scene, port)}),
            (r"/([^/]*)/commands", _Commands, {"secret": secret, "commands": commands(scene)}),
        ]
    )


class _Commands(SecretSocket):
    """Sends each browser everything from the start."""

    def initialize(self, secret: str, commands: list[bytes]) -> None:
        self.secret = secret
        self.commands = commands

    def open(self, *_: str) -> None:
        for command in self.commands:
            self.write_message(command, binary=True)
