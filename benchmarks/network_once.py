"""One figure of part `network`, in a process of its own: `network_once.py CASE` prints seconds and messages as JSON.

A process that is forked while zenoh is open hangs, so those that play by zenoh are spawned.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import zenoh
from ping_pong import End, LongRally, ManyBalls, Rally, ShortRally, pair, play, return_all

from robochoc.authority.admission import InMemoryAuthority
from robochoc.authority.identity import Identity, IdentityTexts
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.local import LOOPBACK, LocalNetwork
from robochoc.communication.network.router import RefusalObserver, Router
from robochoc.communication.network.settings import LEASE_MS, NetworkSettings
from robochoc.communication.network.transport import Transport
from robochoc.communication.network.zenoh_config import config
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.processes.queues import QueueReader, QueueWriter
from robochoc.communication.session import Session
from robochoc.generators.queens3d import queens3d
from robochoc.run.registry import protocol_named

ENDS = ("A", "B")
Opens = Callable[[], "ZenohEnd | PostEnd"]
GAMES = {"one": (1, 2_000), "many": (200, 50)}
"""Balls, and how often each player hits each of them."""
LIMIT_S = 60.0


class PipeEnd:
    """Two `multiprocessing.Pipe`s."""

    def __init__(self, reader: Connection, writer: Connection) -> None:
        self._reader, self._writer = reader, writer

    def send(self, content: bytes) -> None:
        """Put."""
        self._writer.send_bytes(content)

    def receive(self) -> bytes:
        """Get."""
        return self._reader.recv_bytes()


class QueueEnd:
    """Two queues of the processes runtime, each read when the system says that there is something."""

    def __init__(self, reader: Connection, writer: Connection) -> None:
        self._reader, self._writer = QueueReader(os.dup(reader.fileno())), QueueWriter(os.dup(writer.fileno()))
        self._poll = select.epoll()
        self._poll.register(self._reader.fd, select.EPOLLIN)
        self._come: list[bytes] = []

    def send(self, content: bytes) -> None:
        """Put, and flush."""
        self._writer.put(content)
        while not self._writer.flush():
            time.sleep(0)

    def receive(self) -> bytes:
        """Get, whenever nothing is left of what came last."""
        while not self._come:
            self._poll.poll()
            self._come = self._reader.get()[::-1]
        return self._come.pop()


class ZenohEnd:
    """zenoh as it comes: a session, a subscriber, a publisher, TCP."""

    def __init__(self, endpoint: str, name: str, other: str) -> None:
        settings = {"mode": "client", "listen/endpoints": [], "connect/endpoints": [f"tcp/{endpoint}"]}
        self._session = zenoh.open(config({**settings, "connect/timeout_ms": 10_000}))
        self._inbox: SimpleQueue[bytes] = SimpleQueue()
        self._subscriber = self._session.declare_subscriber(f"to/{name}", self._take)
        block = zenoh.CongestionControl.BLOCK
        self._publisher = self._session.declare_publisher(f"to/{other}", congestion_control=block)
        self._matched = False

    def send(self, content: bytes) -> None:
        """Put, but not before there is somebody to take it: plain publishers drop it without a word."""
        while not self._matched:
            self._matched = self._publisher.matching_status.matching  # type: ignore[attr-defined]  # zenoh's stubs
        self._publisher.put(content)

    def receive(self) -> bytes:
        """Get."""
        return self._inbox.get()

    def _take(self, sample: zenoh.Sample) -> None:
        self._inbox.put(sample.payload.to_bytes())

    def close(self) -> None:
        """End the session."""
        self._session.close()  # type: ignore[no-untyped-call]  # zenoh's stubs


class PostEnd:
    """robochoc's post: mutual TLS, access control, advanced publishers and subscribers."""

    def __init__(self, endpoint: str, texts: IdentityTexts, other: str) -> None:
        self._post = Transport(endpoint, Identity.from_texts(texts), watch=())
        self._other = other

    def send(self, content: bytes) -> None:
        """Send."""
        self._post.send(self._other, content)

    def receive(self) -> bytes:
        """The next letter."""
        while True:
            item = self._post.inbox.get()
            if isinstance(item, FrameArrived):
                return item.content

    def close(self) -> None:
        """End the connection."""
        self._post.close()


class Robots(NamedTuple):
    """A search whose messages are to be timed, by which runtime, through which filters."""

    network: bool
    filters: tuple[str, ...] = ()


ROBOTS: Mapping[str, Robots] = {
    "processes": Robots(network=False),
    "network": Robots(network=True),
    "network-signed": Robots(network=True, filters=("signed",)),
    "network-sealed": Robots(network=True, filters=("signed", "sealed")),
}


def main() -> None:
    """Time what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", choices=["team", *ROBOTS, *JOINED], help="who plays; team: how a team begins and ends")
    parser.add_argument("how", metavar="GAME|N", help="the game; team: the number of robots")
    asked = parser.parse_args()
    print(json.dumps(_team(int(asked.how)) if asked.what == "team" else _timed(asked.what, asked.how)))


def _timed(what: str, game: str) -> dict[str, float]:
    """Seconds for so many messages, of 200 bytes: `one` ball at a time, or `many`."""
    if what in ROBOTS:
        return _robots(ROBOTS[what], ManyBalls if game == "many" else LongRally)
    balls, hits = GAMES[game]
    return {"seconds": JOINED[what](balls, hits), "messages": 2 * balls * hits}


def _robots(how: Robots, protocol: type[Rally]) -> dict[str, float]:
    """The search with many messages, less that with hardly any, both from the word to search to the end."""
    seconds, messages = _search(how, protocol)
    idle, few = _search(how, ShortRally)
    return {"seconds": seconds - idle, "messages": messages - few}


def _search(how: Robots, protocol: type[Rally]) -> tuple[float, int]:
    with _session(how, protocol) as session:
        result = session.search(LIMIT_S)
    return result.metrics.wall_s, sum(result.metrics.messages.values())


def _session(how: Robots, protocol: type[Rally]) -> Session:
    if how.network:
        return LocalNetwork(pair(), protocol, settings=NetworkSettings(filters=how.filters))
    return ProcessesRun(pair(), protocol)


def _team(side: int) -> dict[str, float | str]:
    """3D queens (planar) on a network of this machine: what it takes to have all robots there, and what it comes to."""
    team = queens3d(side, "planar")
    began = time.perf_counter()
    with LocalNetwork(team, protocol_named("abt")) as session:
        result = session.search(LIMIT_S)
        took = time.perf_counter() - began
        robots = [Path("/proc", str(process.pid)) for process in session.processes.values()]
        figures: dict[str, float | str] = {
            "verdict": str(result.verdict),
            "registered_s": took - result.metrics.wall_s,
            "search_s": result.metrics.wall_s,
            "messages": sum(result.metrics.messages.values()),
            "memory_mb": sum(map(_memory_mb, robots)),
            "threads": sum(len(list((robot / "task").iterdir())) for robot in robots),
            "descriptors": sum(len(list((robot / "fd").iterdir())) for robot in robots),
        }
    return {**figures, "whole_s": time.perf_counter() - began}


def _memory_mb(process: Path) -> float:
    """The process's share of the memory: what it has with others counts in parts (PSS)."""
    lines = (process / "smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) / 1024


# What joins two players


def _by_pipe(balls: int, hits: int) -> float:
    return _by_pipes(PipeEnd, balls, hits)


def _by_queue(balls: int, hits: int) -> float:
    return _by_pipes(QueueEnd, balls, hits)


def _by_pipes(end: type[PipeEnd | QueueEnd], balls: int, hits: int) -> float:
    context = multiprocessing.get_context("spawn")
    (here, out), (there, back) = context.Pipe(duplex=False), context.Pipe(duplex=False)
    partner = context.Process(target=_partner, args=(end, (there, out), balls, hits))
    partner.start()
    seconds = play(end(here, back), balls, hits)
    partner.join()
    return seconds


def _by_zenoh(balls: int, hits: int) -> float:
    endpoint = _free()
    settings = {"mode": "router", "listen/endpoints": [f"tcp/{endpoint}"], "connect/endpoints": []}
    command = [sys.executable, "-m", "robochoc.communication.network.router_process"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as router:
        if router.stdin is None or router.stdout is None:
            raise OSError("the router has no standard streams")
        router.stdin.write(json.dumps(settings).encode() + b"\n")
        router.stdin.flush()
        router.stdout.readline()
        mine, other = (partial(ZenohEnd, endpoint, *names) for names in (ENDS, ENDS[::-1]))
        seconds = _with_partner(mine, other, balls, hits)
        router.kill()
    return seconds


def _by_post(balls: int, hits: int) -> float:
    return _by_letters(None, balls, hits)


def _by_watched_post(balls: int, hits: int) -> float:
    return _by_letters(lambda _refusal: None, balls, hits)


def _by_letters(refused: RefusalObserver | None, balls: int, hits: int) -> float:
    household = InMemoryAuthority(ENDS)
    router = Router(_free(), household.master_identity((LOOPBACK,)), refused, LEASE_MS)
    router.open({"A": ("B",), "B": ("A",)})
    try:
        texts = {name: household.identity(name).texts for name in ENDS}
        mine, other = (partial(PostEnd, router.endpoint, texts[one], two) for one, two in (ENDS, ENDS[::-1]))
        return _with_partner(mine, other, balls, hits)
    finally:
        router.close()


def _with_partner(mine: Opens, other: Opens, balls: int, hits: int) -> float:
    context = multiprocessing.get_context("spawn")
    (ready, is_ready), (over, is_over) = context.Pipe(duplex=False), context.Pipe(duplex=False)
    partner = context.Process(target=_networked_partner, args=(other, balls, hits, is_ready, over))
    partner.start()
    with closing(mine()) as end:
        ready.recv()
        seconds = play(end, balls, hits)
        is_over.send(None)
        partner.join()
    return seconds


def _networked_partner(opens: Opens, balls: int, hits: int, is_ready: Connection, over: Connection) -> None:
    with closing(opens()) as end:
        is_ready.send(None)
        return_all(end, balls, hits)
        over.recv()


def _partner(end: Callable[..., End], ends: tuple[Connection, Connection], balls: int, hits: int) -> None:
    return_all(end(*ends), balls, hits)


JOINED: Mapping[str, Callable[[int, int], float]] = {
    "pipe": _by_pipe,
    "queue": _by_queue,
    "zenoh": _by_zenoh,
    "post": _by_post,
    "watched": _by_watched_post,
}


def _free() -> str:
    with socket.create_server((LOOPBACK, 0)) as trial:
        return f"{LOOPBACK}:{trial.getsockname()[1]}"


if __name__ == "__main__":
    main()
