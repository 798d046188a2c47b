"""A web server for pages on this machine alone.

It listens on the loopback interface only, in the calling thread, and ends with it. All paths are below an unguessable
one, since the machine may have other users. Other sites in the same browser have no access: a Host that is not this
machine's (DNS rebinding) gets 404, and tornado refuses a WebSocket of another Origin.
"""

from __future__ import annotations

import asyncio
import hmac
import webbrowser
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from socket import socket
from typing import Any

from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketHandler

from robochoc.view.local_address import RedirectFile

_HOSTS = r"(127\.0\.0\.1|localhost)$"
_LONGEST_MESSAGE_BYTES = 1024
"""Browsers do not send messages."""
_LONGEST_REQUEST_BYTES = 1 << 16
REQUEST_S = 30.0
"""The time limit for receiving a request; a connection without one is then closed."""
MAX_CONNECTIONS = 200
"""The maximum number of open connections; more are closed at once."""


def application(handlers: Sequence[tuple[Any, ...]], *, compress: bool = False) -> Application:
    """Return `handlers` (tornado's: pattern, class, arguments) for requests that are meant for this machine."""
    made = Application(
        compress_response=compress,
        websocket_max_message_size=_LONGEST_MESSAGE_BYTES,
        log_function=lambda _: None,
    )
    made.add_handlers(_HOSTS, list(handlers))
    return made


class _Server(HTTPServer):
    """An HTTP server that closes connections beyond the limit."""

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        if len(self._connections) >= MAX_CONNECTIONS:
            stream.close()
        else:
            super().handle_stream(stream, address)


@asynccontextmanager
async def served(application: Application, listening: socket) -> AsyncIterator[None]:
    """Serve `application` on a socket for as long as the context lasts."""
    listening.setblocking(False)
    server = _Server(
        application,
        idle_connection_timeout=REQUEST_S,
        body_timeout=REQUEST_S,
        max_header_size=_LONGEST_REQUEST_BYTES,
        max_body_size=_LONGEST_REQUEST_BYTES,
    )
    server.add_socket(listening)
    try:
        yield
    finally:
        server.stop()
        await server.close_all_connections()


@asynccontextmanager
async def in_browser(url: str, *, enabled: bool) -> AsyncIterator[None]:
    """Open `url` in the user's browser, if `enabled`. Its command line does not contain the secret path.

    It is started in a thread: a browser for the terminal returns only when it is closed.
    """
    if not enabled:
        yield
        return
    with RedirectFile(url) as redirect:
        await asyncio.to_thread(webbrowser.open, redirect.url)
        yield


def check_secret(given: str, secret: str) -> None:
    """Raise `HTTPError` 404 unless the path `given` is the `secret` one, in constant time."""
    if not hmac.compare_digest(given.encode(), secret.encode()):
        raise HTTPError(404)


class SecretHandler(RequestHandler):
    """Answers requests whose URL begins with the secret path, except those from pages of other sites.

    Browsers store nothing: the next server at this port is a different one.
    """

    secret: str

    def prepare(self) -> None:
        """Refuse requests without the secret, or from other sites."""
        check_secret(self.path_args[0], self.secret)
        origin = self.request.headers.get("Origin")
        if origin is not None and origin != f"http://{self.request.host}":
            raise HTTPError(403)

    def set_default_headers(self) -> None:
        """Forbid storing, framing, and sending the URL to other sites."""
        for name, value in (
            ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"),
            ("X-Content-Type-Options", "nosniff"),
            ("X-Frame-Options", "DENY"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
            ("Cross-Origin-Opener-Policy", "same-origin"),
        ):
            self.set_header(name, value)

    def compute_etag(self) -> None:
        """Return None, since browsers store nothing."""

    def write_error(self, status_code: int, **_: Any) -> None:  # noqa: ANN401 - tornado's signature
        """Answer with one line of text: the error."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}")


class SecretPage(SecretHandler):
    """A static page."""

    def initialize(self, secret: str, page: bytes) -> None:
        """Store the page, which is HTML in UTF-8."""
        self.secret = secret
        self.page = page

    def get(self, _secret: str) -> None:
        """Send the page."""
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.write(self.page)


class SecretSocket(WebSocketHandler):
    """A WebSocket at the secret path. Messages of browsers are ignored."""

    secret: str

    def prepare(self) -> None:
        """Refuse requests without the secret."""
        check_secret(self.path_args[0], self.secret)

    def on_message(self, message: str | bytes) -> None:
        """Ignore a message."""
        del message
