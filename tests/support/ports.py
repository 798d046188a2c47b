"""Ports that nobody takes by chance: no ports that the system gives to whoever connects, and each test has its own."""

from __future__ import annotations

import os
import socket
from collections.abc import Sequence
from random import Random

LOOPBACK = "127.0.0.1"
_FIRST, _LAST = 10_000, 32_000
"""Below the ports that Linux and others give to connections that go out."""
_chance = Random(os.getpid())
_given: set[int] = set()
_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % _WORKERS
"""A worker that has died is replaced by one with a higher number."""


def share_of_this_worker(numbers: Sequence[int]) -> Sequence[int]:
    """Return the part of `numbers` that no other process of this run of the tests draws from.

    What was free when it was chosen may be taken by another test before it is used.
    """
    size = len(numbers) // _WORKERS
    return numbers[_WORKER * size : (_WORKER + 1) * size]


def free_port(host: str = LOOPBACK, count: int = 1) -> int:
    """The first of `count` ports in a row that nobody listens at, and that no test of this process was given before."""
    while True:
        first = _chance.choice(share_of_this_worker(range(_FIRST, _LAST)))
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
