"""Bounded connections of the application's server: uvicorn has no time limit for the rest of a request."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from uvicorn.protocols.http.h11_impl import H11Protocol as HTTPProtocol
else:
    from uvicorn.protocols.http.auto import AutoHTTPProtocol as HTTPProtocol

MAX_CONNECTIONS = 200
"""The maximum number of open connections; more are closed at once. A browser opens six for each page."""
MAX_HEAD = 1 << 16
"""The maximum number of bytes of a request's line and headers."""
HEAD_S = 30.0
"""The time limit for the line and headers of a request; twice that on a connection with earlier requests."""


class BoundedConnection(HTTPProtocol):
    """One connection, closed if a request is late or its line and headers are too long."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Start the time limit of the first request."""
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
        """Close the connection if it still waits for the request after `last`."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:  # it is a WebSocket now
            return
        if self._is_waiting and self.cycle is last:
            self.transport.close()
        else:
            self.loop.call_later(HEAD_S, self._check, self.cycle)
