"""A link that a test can freeze or cut: TCP carried on from one port of loopback to another."""

from __future__ import annotations

import socket
import threading
from contextlib import suppress
from types import TracebackType
from typing import Self

_CHUNK = 65536


class Relay:
    """Carries every connection on to `endpoint`; its own is `endpoint` too. A context manager."""

    def __init__(self, endpoint: str) -> None:
        host, _, port = endpoint.rpartition(":")
        self._to = (host, int(port))
        self._listener = socket.create_server((host, 0))
        self.endpoint = f"{host}:{self._listener.getsockname()[1]}"
        self._flows = threading.Event()
        self._flows.set()
        self._cut = False
        self._connections: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept)]

    def freeze(self) -> None:
        """Nothing comes through, and nobody notices but by that."""
        self._flows.clear()

    def cut(self) -> None:
        """All connections are gone, and there are no new ones."""
        self._cut = True
        self._hang_up()

    def mend(self) -> None:
        """As before."""
        self._cut = False
        self._flows.set()

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._flows.set()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self._threads[0].join()
        self._hang_up()
        for thread in self._threads:
            thread.join()

    def _hang_up(self) -> None:
        for connection in self._connections:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
        self._connections = []

    def _accept(self) -> None:
        while True:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            try:
                if self._cut:
                    raise ConnectionRefusedError
                far = socket.create_connection(self._to, 5)
            except OSError:
                near.close()
                continue
            self._connections += [near, far]
            ends = _Ends(near, far)
            for one, other in ((near, far), (far, near)):
                self._threads.append(threading.Thread(target=self._carry, args=[one, other, ends]))
                self._threads[-1].start()

    def _carry(self, one: socket.socket, other: socket.socket, ends: _Ends) -> None:
        with suppress(OSError):
            while content := one.recv(_CHUNK):
                self._flows.wait()
                other.sendall(content)
        ends.close()


class _Ends:
    """Both ends of one connection, closed when both directions are over."""

    def __init__(self, *sockets: socket.socket) -> None:
        self._sockets = sockets
        self._open = len(sockets)
        self._lock = threading.Lock()

    def close(self) -> None:
        with self._lock:
            self._open -= 1
            for one in self._sockets:
                with suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)
                if not self._open:
                    one.close()
