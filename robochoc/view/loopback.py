"""A web server of this machine's own, for pages of ours.

It listens on the loopback interface only, in the calling thread, and ends with it. Other sites in the same browser
get nothing from it: a Host that is not this machine's (DNS rebinding) is not found, and tornado refuses a WebSocket
of another Origin.
"""

from __future__ import annotations

import asyncio
import webbrowser
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from socket import socket
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.web import Application, RequestHandler

_HOSTS = r"(127\.0\.0\.1|localhost)$"
_LONGEST_MESSAGE_BYTES = 1024
"""Of a browser, which has nothing to say."""


def application(handlers: Sequence[tuple[Any, ...]], *, compress: bool = False) -> Application:
    """`handlers` (tornado's: pattern, class, arguments), for requests that are meant for this machine."""
    made = Application(
        compress_response=compress,
        websocket_max_message_size=_LONGEST_MESSAGE_BYTES,
        log_function=lambda _: None,
    )
    made.add_handlers(_HOSTS, list(handlers))
    return made


@asynccontextmanager
async def served(application: Application, listening: socket) -> AsyncIterator[None]:
    """While it lasts, `application` answers on the socket `listening`."""
    listening.setblocking(False)
    server = HTTPServer(application)
    server.add_socket(listening)
    try:
        yield
    finally:
        server.stop()
        await server.close_all_connections()


async def open_in_browser(url: str) -> None:
    """Ask the user's browser to show `url`. In a thread: a browser for the terminal returns when it is closed."""
    await asyncio.to_thread(webbrowser.open, url)


class FixedPage(RequestHandler):
    """A page that does not change, and is not kept: the next server at this port is another."""

    def initialize(self, page: bytes) -> None:
        """`page` is HTML, UTF-8."""
        self.page = page

    def get(self) -> None:
        """Give it."""
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Cache-Control", "no-store")
        self.write(self.page)
