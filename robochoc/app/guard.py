"""Who may speak with the application: browsers of this machine that know its address, and no other page in them."""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

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
            await self.app(scope, receive, self._with_headers(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            await send({"type": "http.response.start", "status": status, "headers": [(b"content-type", b"text/plain")]})
            await send({"type": "http.response.body", "body": str(status).encode()})

    def _refused(self, scope: Scope) -> int | None:
        """Return the HTTP status of a request that is refused; None: it is served."""
        headers: dict[bytes, bytes] = dict(scope["headers"])
        host = headers.get(b"host", b"")
        given = scope["path"].split("/")[1] if "/" in scope["path"] else ""
        if host not in self._hosts or not hmac.compare_digest(given.encode(), self._secret):
            return 404
        origin = headers.get(b"origin")
        if origin is not None and origin != b"http://" + host:
            return 403
        return None

    def _with_headers(self, send: Send) -> Send:
        async def sending(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                known = {name.lower() for name, _ in message.get("headers", ())}
                more = [one for one in _HEADERS if one[0] not in known]
                message = {**message, "headers": [*message.get("headers", ()), *more]}
            await send(message)

        return sending
