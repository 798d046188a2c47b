"""Protection of the application's server: access control, and limits on requests and connections."""

from __future__ import annotations

import asyncio
import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import TYPE_CHECKING, Any

from starlette.requests import ClientDisconnect

from robochoc.app.texts import say

if TYPE_CHECKING:
    from uvicorn.protocols.http.h11_impl import H11Protocol as HTTPProtocol
else:
    from uvicorn.protocols.http.auto import AutoHTTPProtocol as HTTPProtocol


Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Served = Callable[[Scope, Receive, Send], Awaitable[None]]

_HEADERS = (
    (b"cache-control", b"no-store"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"SAMEORIGIN"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"cross-origin-opener-policy", b"same-origin"),
)
MOST_BYTES = (64 << 20) + (1 << 16)
"""The maximum number of bytes in a request: the largest file that can be opened, and the overhead of a form."""
PART_S = 30.0
"""The maximum time to wait for the next part of a request's body, in seconds."""
NOT_FOUND = 404
_METHODS = frozenset({"GET", "HEAD", "POST"})
"""The allowed methods. POST: for uploaded files, and for browsers without WebSockets."""
_MOST_DIGITS = 12
_NO_ANSWER = "No response returned."
"""Starlette's error message for a page that was closed before it was built, which is harmless."""
_POLICY = (
    "default-src 'self'; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval'; "  # NiceGUI's pages require both
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws://{host}; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""The Content-Security-Policy for pages without their own policy: no connections to other hosts."""


class AccessGuard:
    """Passes requests to `served` if they have the secret path and come from this machine and the application's pages.

    Other users of this machine do not know the path. Other sites in the same browser do not know the path either, and
    have a different Origin header; after DNS rebinding, their Host header differs.
    """

    def __init__(self, served: Served, secret: str, port: int) -> None:
        self.app = served
        """The served application. NiceGUI requires this attribute."""
        self._secret = secret.encode()
        self._hosts = {f"127.0.0.1:{port}".encode(), f"localhost:{port}".encode()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or reject it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif (status := self._rejection(scope)) is None:
            await self._serve(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await _answer(send, status, say("app.nothing-here") if status == NOT_FOUND else "")

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        body = _BoundedBody(receive)
        is_started = False

        async def sending(message: MutableMapping[str, Any]) -> None:
            nonlocal is_started
            if is_started or not (body.too_much or body.is_late):  # otherwise the answer below contains the reason
                is_started = True
                await send(message)

        try:
            await self.app(scope, body, self._with_headers(scope, sending))
        except ClientDisconnect:  # the client closed the connection during an upload, or the upload is too long
            pass
        except RuntimeError as error:
            if is_started or not body.gone or str(error) != _NO_ANSWER:
                raise
        if (body.too_much or body.is_late) and not is_started:
            await _answer(send, 413 if body.too_much else 408)

    def _rejection(self, scope: Scope) -> int | None:
        """Return the HTTP status for rejecting a request, or None to accept it."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        host = headers.get(b"host", b"")
        given = scope["path"].split("/")[1] if "/" in scope["path"] else ""
        if host not in self._hosts or not hmac.compare_digest(given.encode(), self._secret):
            return NOT_FOUND
        origin = headers.get(b"origin")
        if origin is not None and origin != b"http://" + host:
            return 403
        if scope.get("method", "GET") not in _METHODS:
            return 405
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or len(length) > _MOST_DIGITS or int(length) > MOST_BYTES:
            return 413
        return None

    def _with_headers(self, scope: Scope, send: Send) -> Send:
        policy = _POLICY.format(host=dict(scope["headers"])[b"host"].decode()).encode()
        ours = (*_HEADERS, (b"content-security-policy", policy))

        async def sending(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                known = {name.lower() for name, _ in message.get("headers", ())}
                more = [header for header in ours if header[0] not in known]
                message = {**message, "headers": [*message.get("headers", ()), *more]}
            await send(message)

        return sending


class _BoundedBody:
    """Receives a request. If the request is too long or too late, the client counts as disconnected."""

    def __init__(self, receive: Receive) -> None:
        self.too_much = False
        self.is_late = False
        """True if the next part of the request's body was late."""
        self.gone = False
        """True if the client has disconnected."""
        self._receive, self._left = receive, MOST_BYTES
        self._is_complete = False

    async def __call__(self) -> MutableMapping[str, Any]:
        try:
            async with asyncio.timeout(None if self._is_complete else PART_S):
                message = await self._receive()
        except TimeoutError:
            self.is_late = self._is_complete = True
            return {"type": "http.disconnect"}
        if message["type"] == "http.request":
            self._is_complete = not message.get("more_body", False)
            self._left -= len(message.get("body", b""))
            if self._left < 0:
                self.too_much = True
                return {"type": "http.disconnect"}
        self.gone |= message["type"] == "http.disconnect"
        return message


async def _answer(send: Send, status: int, text: str = "") -> None:
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": (text or str(status)).encode()})


MAX_CONNECTIONS = 200
"""The maximum number of open connections; further ones are closed at once. A browser opens six for each page."""
MAX_HEAD = 1 << 16
"""The maximum number of bytes in a request's first line and headers."""
HEAD_S = 30.0
"""The time limit for a request's first line and headers in seconds, doubled on a connection with earlier requests."""


class BoundedConnection(HTTPProtocol):
    """A connection that is closed if a request is late, or its first line and headers are too long."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Start the time limit for the first request."""
        super().connection_made(transport)
        self._head = 0
        if len(self.connections) > MAX_CONNECTIONS:
            self.transport.close()
        else:
            self.loop.call_later(HEAD_S, self._check, None)

    def data_received(self, data: bytes) -> None:
        """Receive a part of a request."""
        before, is_waiting = self.cycle, self._is_waiting
        super().data_received(data)
        self._head = self._head + len(data) if is_waiting and self.cycle is before else 0
        if self._head > MAX_HEAD:
            self.transport.close()

    @property
    def _is_waiting(self) -> bool:
        return bool(getattr(self.cycle, "response_complete", True))

    def _check(self, last: object) -> None:
        """Close the connection if it is still waiting for the request after `last`."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:  # it has become a WebSocket
            return
        if self._is_waiting and self.cycle is last:
            self.transport.close()
        else:
            self.loop.call_later(HEAD_S, self._check, self.cycle)
