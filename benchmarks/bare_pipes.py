"""The same traffic with nothing around it: forked processes, a `multiprocessing.Pipe` a directed edge, epoll.

What robochoc's transport is held against: the least that Python processes joined by pipes can do one message a time.
"""

from __future__ import annotations

import multiprocessing
import resource
import select
import struct
from collections.abc import Mapping
from multiprocessing.connection import Connection

from token_ring import OFFSETS

_BODY = struct.Struct("!QH40s")
_CARGO = bytes(40)
Edge = tuple[int, int]
"""Sender and offset; the receiver is that much further round the ring."""


def run_bare(agents: int, hops: int) -> None:
    """Let tokens run round a ring of processes until all have made their hops."""
    allow_descriptors(2 * agents * len(OFFSETS) + 64)
    context = multiprocessing.get_context("fork")
    pipes = {(place, offset): context.Pipe(duplex=False) for place in range(agents) for offset in OFFSETS}
    readers = {edge: reader for edge, (reader, _) in pipes.items()}
    writers = {edge: writer for edge, (_, writer) in pipes.items()}
    processes = [
        context.Process(target=_agent, args=(place, agents, hops, readers, writers)) for place in range(agents)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join()


def allow_descriptors(needed: int) -> None:
    """Raise the limit of open files to `needed`."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, max(needed, hard)))


def _agent(
    place: int, agents: int, hops: int, readers: Mapping[Edge, Connection], writers: Mapping[Edge, Connection]
) -> None:
    """Pass tokens on until as many have come as will come."""
    epoll = select.epoll()
    onward = {}
    for offset in OFFSETS:
        reader = readers[(place - offset) % agents, offset]
        onward[reader.fileno()] = reader, writers[place, offset]
        epoll.register(reader.fileno(), select.EPOLLIN)
    if hops:
        for _, writer in onward.values():
            writer.send_bytes(_BODY.pack(0, hops - 1, _CARGO))
    awaited = hops * len(OFFSETS)
    while awaited:
        for fd, _ in epoll.poll():
            reader, writer = onward[fd]
            clock, left, cargo = _BODY.unpack(reader.recv_bytes())
            awaited -= 1
            if left:
                writer.send_bytes(_BODY.pack(clock, left - 1, cargo))
