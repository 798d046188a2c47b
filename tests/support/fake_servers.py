"""A listener that is not the server that clients expect."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress


@contextmanager
def fake_server(answer: bytes, *, hangs_up: bool) -> Iterator[int]:
    """Yield the port of a listener that sends `answer` to every client.

    It then closes the connection, or at the end.
    """
    with ExitStack() as kept, socket.create_server(("127.0.0.1", 0)) as listener:

        def serve() -> None:
            with suppress(OSError):  # the listener has been shut down
                while True:
                    meet(listener.accept()[0])

        def meet(connection: socket.socket) -> None:
            kept.enter_context(connection)
            with suppress(OSError):  # they may have gone
                connection.recv(10_000)
                connection.sendall(answer)
                if hangs_up:
                    connection.close()

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            listener.shutdown(socket.SHUT_RDWR)
            thread.join()
