"""The socket between this process and a solver's process.

On POSIX systems the solver's process inherits its end of a socket pair. Windows cannot pass descriptors: there the
process connects to a port of the loopback interface, and sends a token that it reads from its standard input.
"""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import time
from collections.abc import Callable

_HOST = "127.0.0.1"
_TOKEN_BYTES = 32
_START_S = 60.0
"""The maximum time for a new process to connect, in seconds."""
_TICK_S = 0.2


def connect_to_parent(address: str) -> socket.socket:
    """In a solver's process: return the socket to the parent, from the argument with which it was started."""
    if not address.startswith(f"{_HOST}:"):
        return socket.socket(fileno=int(address))
    connection = socket.create_connection((_HOST, int(address.removeprefix(f"{_HOST}:"))))
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.sendall(os.read(0, _TOKEN_BYTES))
    return connection


def start_by_port(start: Callable[[str], subprocess.Popen[bytes]]) -> tuple[subprocess.Popen[bytes], socket.socket]:
    """Start a process that calls `connect_to_parent`, and return it and the socket to it.

    Args:
        start: Starts the process with the argument of `connect_to_parent`. Its standard input is a pipe, which stays
            open: the process can detect the end of this one by it.

    Raises:
        OSError: if the process ends, or does not connect in time.
    """
    token = secrets.token_bytes(_TOKEN_BYTES)
    with socket.create_server((_HOST, 0)) as server:
        process = start(f"{_HOST}:{server.getsockname()[1]}")
        try:
            assert process.stdin is not None  # noqa: S101 - for mypy
            process.stdin.write(token)
            process.stdin.flush()
            return process, _accepted(server, process, token)
        except BaseException:
            process.kill()
            process.wait()
            raise


def _accepted(server: socket.socket, process: subprocess.Popen[bytes], token: bytes) -> socket.socket:
    """Return the first connection that sends the token. Other programs may connect to the port, too."""
    server.settimeout(_TICK_S)
    deadline = time.monotonic() + _START_S
    while time.monotonic() < deadline and process.poll() is None:
        try:
            connection, _ = server.accept()
        except TimeoutError:
            continue
        connection.settimeout(_TICK_S)
        if _sent(connection) == token:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            connection.settimeout(None)
            return connection
        connection.close()
    raise OSError("the process of the solver did not connect")


def _sent(connection: socket.socket) -> bytes:
    """Return the first bytes that the other side sends, as many as a token has."""
    received = b""
    try:
        while len(received) < _TOKEN_BYTES and (piece := connection.recv(_TOKEN_BYTES - len(received))):
            received += piece
    except OSError:
        return b""
    return received


def end_process(process: subprocess.Popen[bytes]) -> None:
    """Kill a process, wait for its end, and close its input."""
    process.kill()
    process.wait()
    if process.stdin is not None:
        process.stdin.close()
