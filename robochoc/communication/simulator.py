"""The simulator: the whole team in one thread, deterministic from a seed.

A schedule says which messages arrive next (`communication/schedule.py`); nobody speaks any more when it is empty.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from robochoc.communication.host import Host
from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.schedule import Schedule
from robochoc.message import Envelope
from robochoc.observers.events import Observer
from robochoc.outcome import Verdict
from robochoc.problem import Team
from robochoc.protocols.protocol import Protocol
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.part import parts

PROGRESS_EVERY = 256
"""Packets between two reports of progress."""


class Simulation:
    """One run of one team in this thread.

    `domains` holds the compiled domains of robots whose private constraints need a solver (`solver/compile.py`).
    `observer` is told of all events, with the schedule's time.
    """

    def __init__(
        self,
        team: Team,
        protocol: type[Protocol],
        schedule: Schedule,
        *,
        domains: Mapping[str, CompiledDomain] = MappingProxyType({}),
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
    ) -> None:
        traits = protocol.traits
        given = parts(team, domains, everywhere=traits.everywhere, tree=traits.tree)
        self._hosts = {name: Host.of(protocol, part) for name, part in given.items()}
        self._schedule = schedule
        self._progress = progress
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        if observer:
            for host in self._hosts.values():
                host.observe(observer, lambda: float(schedule.now))

    def run(self, timeout: float | None = None) -> RunResult:
        """Run to a verdict, or until `timeout` seconds of wall-clock time are over (`unknown`).

        Every robot starts before any message arrives, as the paper's master orders the start when all are there.
        """
        began = time.monotonic()
        for host in self._hosts.values():
            self._pass_on(host, host.start())
        packets = 0
        while self._verdict is None:
            elapsed_s = time.monotonic() - began
            if timeout is not None and elapsed_s > timeout:
                self._verdict = Verdict.UNKNOWN
                break
            if self._progress and packets % PROGRESS_EVERY == 0:
                self._progress(Progress(self._sent(), elapsed_s))
            packet = self._schedule.get()
            if not packet:
                self._verdict = Verdict.SOLUTION
                break
            host = self._hosts[packet[0].receiver]
            self._pass_on(host, host.handle(packet))
            packets += 1
        return RunResult.of(
            self._verdict,
            self._witness,
            {name: host.protocol.assignment for name, host in self._hosts.items()},
            [host.metrics() for host in self._hosts.values()],
            time.monotonic() - began,
        )

    def _pass_on(self, host: Host, said: Sequence[Envelope]) -> None:
        for envelope in said:
            self._schedule.put(envelope)
        self._schedule.done(host.name, host.clock)
        if host.protocol.verdict is not None:
            self._verdict, self._witness = host.protocol.verdict, host.name

    def _sent(self) -> int:
        return sum(sum(host.sent.values()) for host in self._hosts.values())
