"""A web server for pages that are only accessible on this machine.

The server runs in the calling thread, and listens only on the loopback interface. All paths are below an unguessable
path, since the machine may have other users. Other sites in the same browser have no access: requests for another Host
(DNS rebinding) get 404, and tornado refuses WebSockets with another Origin.
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
"""The maximum size of a message from a browser, in bytes; browsers send none."""
_LONGEST_REQUEST_BYTES = 1 << 16
REQUEST_S = 30.0
"""The time limit for receiving a request, in seconds, after which the connection is closed."""
MAX_CONNECTIONS = 200
"""The maximum number of open connections; further connections are closed at once."""


def application(handlers: Sequence[tuple[Any, ...]], *, compress: bool = False) -> Application:
    """Return an application with `handlers` (pattern, class, arguments), for requests to this machine only."""
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
    """Serve `application` on a socket within the context."""
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
    """Open `url` in the user's browser, if `enabled`. The browser's command line does not contain the secret path.

    The browser is started in a thread, since a terminal browser returns only when it is closed.
    """
    if not enabled:
        yield
        return
    with RedirectFile(url) as redirect:
        await asyncio.to_thread(webbrowser.open, redirect.url)
        yield


def check_secret(given: str, secret: str) -> None:
    """Raise `HTTPError` 404 unless the path `given` equals `secret`, compared in constant time."""
    if not hmac.compare_digest(given.encode(), secret.encode()):
        raise HTTPError(404)


class SecretHandler(RequestHandler):
    """Answers requests whose URLs begin with the secret path, except requests from pages of other sites.

    Browsers must store nothing, since the next server on this port is a different one.
    """

    secret: str

    def prepare(self) -> None:
        """Refuse requests without the secret, or from other sites."""
        check_secret(self.path_args[0], self.secret)
        origin = self.request.headers.get("Origin")
        if origin is not None and origin != f"http://{self.request.host}":
            raise HTTPError(403)

    def set_default_headers(self) -> None:
        """Set headers that forbid storing, framing, and sending the URL to other sites."""
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
        """Answer with the error as one line of text."""
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code}: {self._reason}")


class SecretPage(SecretHandler):
    """A static page."""

    def initialize(self, secret: str, page: bytes) -> None:
        """Store the page (HTML in UTF-8)."""
        self.secret = secret
        self.page = page

    def get(self, _secret: str) -> None:
        """Send the page."""
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.write(self.page)


class SecretSocket(WebSocketHandler):
    """A WebSocket at the secret path. Messages from browsers are ignored."""

    secret: str

    def prepare(self) -> None:
        """Refuse requests without the secret."""
        check_secret(self.path_args[0], self.secret)

    def on_message(self, message: str | bytes) -> None:
        """Ignore a message."""
        del message
