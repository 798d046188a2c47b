"""Connections of the application's server, bounded: uvicorn itself waits for ever for the rest of a request."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uvicorn.protocols.http.h11_impl import H11Protocol as HTTPProtocol
else:
    from uvicorn.protocols.http.auto import AutoHTTPProtocol as HTTPProtocol

MAX_CONNECTIONS = 200
"""The number of connections beyond which further ones are closed at once. A browser opens six a page."""
MAX_HEAD = 1 << 16
"""The maximum number of bytes of a request's line and headers."""
HEAD_S = 30.0
"""The time within which a request's line and headers must have come; twice that on a connection with earlier ones."""


class BoundedConnection(HTTPProtocol):
    """One connection. It is closed when a request does not come in time, or begins with too much."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Begin to wait for the first request."""
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
        """Close the connection if it waits for a request, and no other one came since `last`."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:  # it is a WebSocket now
            return
        if self._is_waiting and self.cycle is last:
            self.transport.close()
        else:
            self.loop.call_later(HEAD_S, self._check, self.cycle)
