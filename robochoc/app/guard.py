"""Who may speak with the application: browsers of this machine that know its address, and no other page in them."""

from __future__ import annotations

import asyncio
import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from starlette.requests import ClientDisconnect

from robochoc.app.texts import say

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
"""Bytes that are taken of one request: the largest file that is opened, and what a form adds to it."""
PART_S = 30.0
"""The longest wait for the next part of a request's body, in seconds."""
NOT_FOUND = 404
_METHODS = frozenset({"GET", "HEAD", "POST"})
"""POST: files that are opened, and sockets of browsers that have no better one."""
_MOST_DIGITS = 12
_NO_ANSWER = "No response returned."
"""Starlette's error for a page that was left before it was made: nobody waits for it any more, and nothing is wrong."""
_POLICY = (
    "default-src 'self'; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval'; "  # NiceGUI makes its pages of both
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
    "connect-src 'self' ws://{host}; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""What a page may do that has no policy of its own: nothing is loaded from elsewhere, and nothing is sent there."""


class Guard:
    """Lets requests through to `served` that know the secret path, and come from this machine and its own pages.

    Others use this machine, too: they do not know the path. Another site in the same browser does not know it either;
    should it ever, its Origin gives it away, and a name that it bends to this machine (DNS rebinding) is not our Host.
    """

    def __init__(self, served: Served, secret: str, port: int) -> None:
        self.app = served
        """What is served. NiceGUI finds its server by this name."""
        self._secret = secret.encode()
        self._hosts = {f"127.0.0.1:{port}".encode(), f"localhost:{port}".encode()}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
        elif (status := self._refused(scope)) is None:
            await self._serve(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await _answer(send, status, say("app.nothing-here") if status == NOT_FOUND else "")

    async def _serve(self, scope: Scope, receive: Receive, send: Send) -> None:
        taken = _Taken(receive)
        begun = False

        async def sending(message: MutableMapping[str, Any]) -> None:
            nonlocal begun
            if begun or not (taken.too_much or taken.is_late):  # else it says that it has failed, and we say why
                begun = True
                await send(message)

        try:
            await self.app(scope, taken, self._with_headers(scope, sending))
        except ClientDisconnect:  # it has gone before all of its file was here, or sends too much
            pass
        except RuntimeError as error:
            if begun or not taken.gone or str(error) != _NO_ANSWER:
                raise
        if (taken.too_much or taken.is_late) and not begun:
            await _answer(send, 413 if taken.too_much else 408)

    def _refused(self, scope: Scope) -> int | None:
        """Return the HTTP status of a request that is refused; None: it is served."""
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
                more = [one for one in ours if one[0] not in known]
                message = {**message, "headers": [*message.get("headers", ()), *more]}
            await send(message)

        return sending


class _Taken:
    """Receives a request; if the request is too long or late, the client counts as disconnected."""

    def __init__(self, receive: Receive) -> None:
        self.too_much = False
        self.is_late = False
        """Whether the next part of the request's body was late."""
        self.gone = False
        """Whether its sender has gone."""
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
