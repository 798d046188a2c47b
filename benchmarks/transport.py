"""Part `transport`: what a message costs on its way, beside the bare pipe."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bare_pipes import run_bare
from measure import RUNS, FailedError, Sample, say, spread, timed_call
from report import Row, Section
from token_ring import OFFSETS, messages, ring_protocol, ring_team

from robochoc.communication.processes.processes import ProcessesRun

AGENTS = (16, 121)
MESSAGES = 100_000
"""About so many a run."""
AIM = 1.5

Run = Callable[[int, int], None]


class Cost(NamedTuple):
    """One round: CPU microseconds a message, thousands of messages a second, CPU milliseconds to open a queue."""

    cpu_us: float
    per_ms: float
    opening_us: float


def measured() -> Section:
    """Both transports, for each number of agents, in turns."""
    rows: list[Row] = [
        (
            "agents",
            "transport",
            "CPU us a message",
            "thousand messages a second",
            "CPU us to open a queue",
            "ratio of CPU",
        )
    ]
    for agents in AGENTS:
        rows += _compared(agents)
    notes = (
        f"Tokens of about 50 bytes run round a ring, {len(OFFSETS)} neighbours an agent, some {MESSAGES:,} messages. "
        "CPU is user and system time of all processes, the parent too. `robochoc`: ProcessesRun, with a protocol that "
        "passes tokens on; so decoding, encoding, clock stamps, counters and termination detection are in it. `bare`: "
        "forked processes, a multiprocessing.Pipe a directed edge, epoll, send_bytes and recv_bytes. A run in which "
        "every edge carries one message is subtracted from each, as it holds the start and the opening of queues; "
        "less a run without messages it gives the cost of opening (the bare pipes are all opened before the fork). "
        f"Aim: at most {AIM:g} times the bare pipe's CPU. Median (min..max) of {RUNS} rounds in turns."
    )
    return Section("transport", "A message on its way", notes, (rows,))


def run_ours(agents: int, hops: int) -> None:
    """The ring in robochoc's processes; fails unless exactly the messages due were sent."""
    result = ProcessesRun(ring_team(agents), ring_protocol(agents, hops)).run()
    sent = sum(result.metrics.messages.values())
    if sent != messages(agents, hops):
        raise FailedError(f"{sent} messages instead of {messages(agents, hops)}")


def _compared(agents: int) -> list[Row]:
    hops = MESSAGES // messages(agents, 1)
    ours, bare = [], []
    for turn in range(1, RUNS + 1):
        say(f"transport, {agents} agents, round {turn}")
        ours.append(_cost(run_ours, agents, hops))
        bare.append(_cost(run_bare, agents, hops))
    ratio = statistics.median(one.cpu_us for one in ours) / statistics.median(one.cpu_us for one in bare)
    return [_row(agents, "robochoc", ours, f"{ratio:.2f} (aim <= {AIM:g})"), _row(agents, "bare pipes", bare, "1")]


def _cost(run: Run, agents: int, hops: int) -> Cost:
    idle, first, full = (_sample(run, agents, count) for count in (0, 1, hops))
    extra = messages(agents, hops) - messages(agents, 1)
    return Cost(
        (full.cpu_s - first.cpu_s) / extra * 1e6,
        extra / max(full.wall_s - first.wall_s, 1e-9) / 1e3,
        (first.cpu_s - idle.cpu_s) / messages(agents, 1) * 1e6,
    )


def _sample(run: Run, agents: int, hops: int) -> Sample:
    return timed_call(lambda: run(agents, hops))


def _row(agents: int, transport: str, costs: Sequence[Cost], ratio: str) -> Row:
    opening = spread((cost.opening_us for cost in costs), 0) if transport == "robochoc" else "-"
    return (
        str(agents),
        transport,
        spread((cost.cpu_us for cost in costs), 1),
        spread((cost.per_ms for cost in costs), 0),
        opening,
        ratio,
    )
