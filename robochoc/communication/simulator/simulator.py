"""The simulator: runs the whole team in one thread, deterministically for a given seed.

A schedule decides which messages arrive next (`communication/simulator/schedule.py`). The search is over when no
message is in transit and no robot sends another one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from robochoc.communication.host import Host, MessageCache, may_be_shared, order_of
from robochoc.communication.search_result import Progress, SearchResult
from robochoc.communication.search_watch import SearchWatch, snapshot_of
from robochoc.communication.session import Epoch, Session, is_past
from robochoc.communication.simulator.losses import Losses
from robochoc.communication.simulator.schedule import Schedule
from robochoc.journal.events import Observer
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Envelope
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, AgentProblem, RunParameters
from robochoc.solver.compile import TeamCompileTimeoutError
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.system.compiling import answer_signals, mypyc_attr
from robochoc.system.garbage import collection_paused, collection_seldom, garbage_frozen
from robochoc.system.stopping import stop_requested
from robochoc.system.time_limit import TimeLimitError, computed_by

PROGRESS_EVERY = 256
"""The number of packets between two progress reports."""
PROGRESS_S = 0.25
"""The longest time between two progress reports, in seconds, since some packets take long."""
LONGEST_STEP_S = 0.3
"""The time after the time limit at which a step is interrupted, in seconds."""


@dataclass(frozen=True)
class EffortLimits:
    """Limits on the total effort in all searches of a simulation. None: no limit.

    Attributes:
        ncccs: Non-concurrent constraint checks.
        cycles: Cycles, if the schedule counts them.
    """

    ncccs: int | None = None
    cycles: int | None = None


NO_LIMITS = EffortLimits()


@mypyc_attr(allow_interpreted_subclasses=True)
class Simulation(Session):
    """Simulates one team in the calling thread.

    Args:
        team: The team, whether compiled or not.
        protocol: The protocol of the robots.
        schedule: Decides which messages arrive next.
        observer: Receives all events, with the schedule's time.
        progress: Receives the message count from time to time.
        parameters: The robots' parameters besides the problem.
        limits: The limits on the effort of the searches, checked after each packet.
        deadline: The end of the run's time, on the monotonic clock.
        bounds: True if the observer receives lower bounds, too.
        losses: Draws the messages that are lost; None if no messages are lost.

    Raises:
        TeamCompileTimeoutError: if the deadline passes before all robots are set up. `change` raises it as well.
    """

    def __init__(  # noqa: PLR0913 - keyword options
        self,
        team: Team | CompiledTeam,
        protocol: type[Protocol],
        schedule: Schedule,
        *,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        parameters: RunParameters = DEFAULT_PARAMETERS,
        limits: EffortLimits = NO_LIMITS,
        deadline: float | None = None,
        bounds: bool = False,
        losses: Losses | None = None,
    ) -> None:
        super().__init__(team)
        self._protocol = protocol
        self._schedule = schedule
        self._observer = observer
        self._progress = progress
        self._limits = limits
        self._deadline = deadline
        self._bounds = bounds
        self._losses = losses
        self._lossless = True
        self._checks = self._ncccs = self._sent = 0
        self._verdict: Verdict | None = None
        self._witness: str | None = None
        self._order: PriorityOrder | None = None
        self._message_cache = MessageCache() if may_be_shared(protocol.messages) else None
        with collection_paused():
            parts = Epoch(self.compiled, parameters=parameters).parts(protocol)
            self._hosts: dict[str, Host] = {}
            try:
                computed_by(deadline, self._set_up, parts)
            except TimeLimitError:
                late = next((name for name in parts if name not in self._hosts), "the last robot")
                raise TeamCompileTimeoutError(f"the time limit was reached before {late} was set up") from None
        if losses is not None:
            losses.follow(self.compiled.team, self._values_of)

    @property
    def lossless(self) -> bool:
        """See `Session.lossless`."""
        return self._lossless

    def search(self, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        """See `Session.search`. The limit on messages is checked after each packet."""
        began = time.monotonic()
        if self._verdict is None:
            end = None if timeout is None else began + timeout + LONGEST_STEP_S
            # Most objects belong to the robots' problems, and are not garbage.
            with garbage_frozen(), collection_seldom(), suppress(TimeLimitError):
                computed_by(end, self._play, began, timeout, messages)
        simulated_s, cycles = self._schedule.elapsed_s, self._schedule.cycles
        self._schedule.clear()
        result = SearchResult.of(
            self._verdict or Verdict.UNKNOWN,
            self._witness,
            {name: host.protocol.assignment for name, host in self._hosts.items()},
            [host.metrics() for host in self._hosts.values()],
            time.monotonic() - began,
        )
        lost = 0 if self._losses is None else self._losses.reset()
        metrics = replace(result.metrics, simulated_s=simulated_s, cycles=cycles, lost_messages=lost)
        self._limits = _left(self._limits, metrics)
        findings = {name: host.protocol.findings for name, host in self._hosts.items()}
        return replace(result, metrics=metrics, findings=findings)

    def change(self, epoch: Epoch) -> None:
        """See `Session.change`."""
        self.compiled = epoch.compiled
        self._verdict = self._witness = None
        self._ncccs = self._sent = 0
        before = self._hosts
        self._hosts = {}
        for name, part in epoch.parts(self._protocol).items():
            if name in before and name not in epoch.restarted:
                self._check_time(name)
                self._hosts[name] = before[name]
                before[name].change(part, epoch.invalidated, self._order_of(part))
                self._note_verdict(before[name])
            else:
                self._hosts[name] = self._host(part)
        if self._losses is not None:
            self._losses.follow(self.compiled.team, self._values_of)

    def close(self) -> None:
        """Do nothing: a simulation has no resources to release."""

    def _check_time(self, name: str) -> None:
        """Raise `TeamCompileTimeoutError` if the deadline passed before the robot `name` was set up."""
        if is_past(self._deadline):
            raise TeamCompileTimeoutError(f"the time limit was reached before {name} was set up")

    def _set_up(self, parts: Mapping[str, AgentProblem]) -> None:
        """Set up all robots."""
        for name, part in parts.items():
            self._hosts[name] = self._host(part)

    def _host(self, part: AgentProblem) -> Host:
        self._check_time(part.robot.name)
        host = Host.create(self._protocol, part, self._order_of(part))
        host.message_cache = self._message_cache
        if self._observer:
            host.observe(self._observer, lambda: self._time(host.checks), self._time, bounds=self._bounds)
        return host

    def _order_of(self, part: AgentProblem) -> PriorityOrder:
        """Return the order of an epoch's robots. They share one object, because its tree is as large as the team."""
        if self._order is None or self._order.rank is not part.known.rank:
            self._order = order_of(part)
        return self._order

    def _play(self, began: float, timeout: float | None, messages: int | None) -> None:
        """Start every robot, then deliver one packet after the other."""
        lossless, self._lossless = self._lossless, False
        for host in self._hosts.values():
            self._checks = host.checks
            self._send(host, host.start(lossless=lossless))
        packets, shown_s = 0, 0.0
        schedule, hosts, watch = self._schedule, self._hosts, self.watch
        most_ncccs, most_cycles = self._limits.ncccs, self._limits.cycles
        while self._verdict is None:
            answer_signals()
            elapsed_s = time.monotonic() - began
            late = timeout is not None and elapsed_s > timeout
            if (
                late
                or (messages is not None and self._sent >= messages)
                or (watch is not None and self._watched(watch))
            ):
                return
            if most_ncccs is not None and self._ncccs >= most_ncccs:
                return
            if most_cycles is not None and schedule.next_cycle > most_cycles:
                return
            if packets % PROGRESS_EVERY == 0 or elapsed_s - shown_s >= PROGRESS_S:
                shown_s = elapsed_s
                if self._is_to_stop(elapsed_s):
                    return
            packet = schedule.get()
            if packet:
                host = hosts[packet[0].receiver]
                self._checks = host.counted
                self._send(host, self._handle(host, packet, self._losses) if self._losses else host.handle(packet))
                packets += 1
            elif not self._go_on():
                self._verdict, self._lossless = Verdict.SOLUTION, self._losses is None or not self._losses.lost

    def _handle(self, host: Host, packet: Sequence[Envelope], losses: Losses) -> list[Envelope]:
        """Let `host` handle a packet, before which messages may have been lost, and return its messages.

        If the protocol cannot continue without the lost messages, the search is over.
        """
        replies = host.handle_lossy(packet, losses.missing_before, lost=losses.lost > 0)
        if replies is None:
            self._verdict = Verdict.UNKNOWN
            return []
        return replies

    def _go_on(self) -> bool:
        """Let all robots continue without the messages that they wait for. Return whether any robot continues."""
        if self._losses is None or not self._protocol.traits.bears_loss:
            return False
        self._schedule.wait()
        went = False
        for host in self._hosts.values():
            self._checks = host.counted
            replies = host.go_on()
            if replies is not None:
                went = True
                self._send(host, replies)
        return went

    def _is_to_stop(self, elapsed_s: float) -> bool:
        """Report the progress; return whether a stop was requested."""
        if self._progress:
            self._progress(Progress(self._sent, elapsed_s))
        return stop_requested()

    def _watched(self, watch: SearchWatch) -> bool:
        """Pass a snapshot to `watch` if it is due, and return whether the search may stop."""
        if watch.wants_snapshot(time.monotonic()):
            hosts, losses = self._hosts, self._losses
            watch.receive(
                snapshot_of(
                    {name: host.protocol.assignment for name, host in hosts.items()},
                    {name: host.protocol.findings for name, host in hosts.items()},
                    0 if losses is None else losses.lost,
                )
            )
        return watch.satisfied

    def _send(self, host: Host, envelopes: Sequence[Envelope]) -> None:
        """Pass the messages from the last step of `host` to the schedule."""
        schedule, before, clock = self._schedule, self._checks, host.clock
        if envelopes:
            self._sent += len(envelopes)
            losses = self._losses
            for envelope, checks in zip(envelopes, host.checks_at_send, strict=True):
                if losses is not None and losses.loses(envelope):
                    schedule.lose(envelope, checks - before)
                else:
                    schedule.put(envelope, checks - before)
        schedule.done(host.name, clock, host.counted - before)
        if clock > self._ncccs:  # noqa: PLR1730 - faster
            self._ncccs = clock
        self._note_verdict(host)

    def _values_of(self, name: str) -> dict[str, int]:
        """Return a robot's current values; empty until the robot has decided."""
        return self._hosts[name].protocol.assignment

    def _time(self, checks: int) -> float:
        """Return the time at which the working robot had done this number of checks."""
        return self._schedule.time(checks - self._checks)

    def _note_verdict(self, host: Host) -> None:
        verdict = host.protocol.verdict
        if verdict is not None:
            self._verdict, self._witness = verdict, host.name


def _left(limits: EffortLimits, spent: Metrics) -> EffortLimits:
    """Return the part of `limits` that remains after a search."""
    ncccs = None if limits.ncccs is None else max(0, limits.ncccs - spent.ncccs)
    cycles = None if limits.cycles is None else max(0, limits.cycles - spent.cycles)
    return EffortLimits(ncccs, cycles)
