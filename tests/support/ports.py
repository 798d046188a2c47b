"""Ports that nobody takes by chance: no ports that the system gives to whoever connects, and each test has its own."""

from __future__ import annotations

import os
import socket
from random import Random

LOOPBACK = "127.0.0.1"
_FIRST, _LAST = 10_000, 32_000
"""Below the ports that Linux and others give to connections that go out."""
_chance = Random(os.getpid())
_given: set[int] = set()


def free_port(host: str = LOOPBACK, count: int = 1) -> int:
    """The first of `count` ports in a row that nobody listens at, and that no test of this process was given before."""
    while True:
        first = _chance.randrange(_FIRST, _LAST)
        ports = range(first, first + count)
        if _given.isdisjoint(ports) and all(_is_free(host, port) for port in ports):
            _given.update(ports)
            return first


def free_endpoint() -> str:
    """An address of this machine where nobody listens."""
    return f"{LOOPBACK}:{free_port()}"


def _is_free(host: str, port: int) -> bool:
    try:
        with socket.create_server((host, port)):
            return True
    except OSError:
        return False
