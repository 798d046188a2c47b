"""DDS on this machine alone: domains that nobody else is in, and programs at the other end (`dds_peer.py`)."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from random import Random
from types import TracebackType
from typing import Any, Self

from tests.support.limits import HANG_S
from tests.support.ports import share_of_this_worker

LOOPBACK_ALONE = (
    "<CycloneDDS><Domain><General><Interfaces><NetworkInterface name='lo'/></Interfaces>"
    "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>9</MaxAutoParticipantIndex>"
    "<Peers><Peer address='127.0.0.1'/></Peers></Discovery></Domain></CycloneDDS>"
)
"""A configuration of Cyclone DDS that finds others on this machine, and nobody else."""
_CLIENT = Path(__file__).with_name("dds_client.py")
_PEER = Path(__file__).with_name("dds_peer.py")
_FIRST, _LAST = 1, 98
"""Domains whose ports are below those that the system gives to whoever connects."""
_chance = Random(os.getpid())
_given: set[int] = set()


def free_domain() -> int:
    """A domain that nobody is in, and that no test of this process was given lately."""
    ours = share_of_this_worker(range(_FIRST, _LAST + 1))
    while True:
        if _given.issuperset(ours):
            _given.clear()
        domain = _chance.choice(ours)
        if domain not in _given and all(_is_free(7410 + 250 * domain + 2 * index) for index in range(4)):
            _given.add(domain)
            return domain


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        try:
            tried.bind(("127.0.0.1", port))
        except OSError:
            return False
        return True


class _Program:
    """A program that says "ready" when its topics or services exist, and takes and gives lines of JSON."""

    def __init__(self, path: Path, *words: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(path), *words], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def __enter__(self) -> Self:
        assert self.heard() == "ready"
        return self

    def heard(self) -> Any:  # noqa: ANN401 - JSON
        """The next line that it says."""
        assert self.process.stdout is not None
        return json.loads(self.process.stdout.readline())

    def begin(self, name: str, fields: object) -> None:
        """Give it a line, and do not wait for the answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps([name, fields]) + "\n")
        self.process.stdin.flush()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.process.kill()
        self.process.communicate(timeout=HANG_S)


class Peer(_Program):
    """A program at the other end of topics."""

    def __init__(self, what: str, domain: int, topics: Mapping[str, str], **settings: object) -> None:
        super().__init__(_PEER, what, str(domain), json.dumps({"topics": topics, **settings}))

    def say(self, topic: str, **fields: object) -> None:
        """Have it publish a message."""
        self.begin(topic, fields)
        assert self.heard() == "written"

    def rest(self) -> Iterator[Any]:
        """End it, and yield what it has said until then."""
        said, _ = self.process.communicate(timeout=HANG_S)
        return map(json.loads, said.splitlines())


class ServiceClient(_Program):
    """A program at the other end of services."""

    def __init__(self, domain: int, services: Mapping[str, str]) -> None:
        super().__init__(_CLIENT, str(domain), json.dumps({**services}))

    def ask(self, name: str, **fields: object) -> Any:  # noqa: ANN401 - JSON
        """Have it ask; return the answer."""
        self.begin(name, fields)
        return self.heard()


def subscriber(domain: int, topics: Mapping[str, str], *, reliable: bool = True, **settings: object) -> Peer:
    """Return a program that subscribes, to use as a context."""
    return Peer("subscribe", domain, topics, reliable=reliable, **settings)


def reporter(domain: int, topics: Mapping[str, str], *, reliable: bool = True, **settings: object) -> Peer:
    """Return a program that reports, to use as a context."""
    return Peer("report", domain, topics, reliable=reliable, **settings)
