"""The Authority's service on this machine, and what an unknown client may send to it."""

from __future__ import annotations

import socket
import ssl
import time
from contextlib import suppress
from pathlib import Path

import pytest

from robochoc.authority.authority import Authority
from robochoc.authority.certificates import pem
from robochoc.authority.enrolment_server import EnrolmentServer
from robochoc.authority.frames import (
    Answer,
    Exchange,
)
from tests.support.authorities import Clock, Seen
from tests.support.limits import HANG_S, wait_until

SOON_S = HANG_S


class AuthorityService:
    """An Authority with its service, whose clock is the machine's plus what a test adds."""

    def __init__(self, folder: Path, patience_s: float = HANG_S) -> None:
        self.clock = Clock(0)
        self.seen = Seen()
        self.authority = Authority.create(folder, observer=self.seen, clock=lambda: time.time() + self.clock.now)
        self.master = self.authority.master_identity(["127.0.0.1"])
        self.server = EnrolmentServer(self.authority, self.master, patience_s=patience_s, connections=4)

    @property
    def place(self) -> tuple[str, int]:
        return self.server.address

    def refusal(self, count: int = 1) -> str:
        """Why the last one was refused, as soon as `count` were."""
        wait_until(lambda: len(self.seen.refusals) >= count, lambda: f"not refused: {self.seen.refusals}")
        assert len(self.seen.refusals) == count, self.seen.refusals
        return self.seen.refusals[-1].why


def open_files() -> int:
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def trusting(desk: AuthorityService) -> ssl.SSLContext:
    context = ssl.create_default_context(cadata=pem(desk.authority.certificate).decode())
    context.check_hostname = False
    return context


def answered(desk: AuthorityService, raw: bytes, context: ssl.SSLContext | None = None) -> Answer:
    """What the service answers to `raw`, over good TLS."""
    with (
        socket.create_connection(desk.place, SOON_S) as plain,
        (context or trusting(desk)).wrap_socket(plain) as connection,
    ):
        connection.sendall(raw)
        return Exchange(connection, SOON_S).answer()


def framed(content: bytes) -> bytes:
    return len(content).to_bytes(4, "big") + content


def drip(connection: socket.socket, content: bytes) -> None:
    """Send a byte now and then, until the other side has hung up."""
    with suppress(OSError):
        for byte in content:
            connection.sendall(bytes([byte]))
            time.sleep(0.05)
        pytest.fail("nobody hung up")
