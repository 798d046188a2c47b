"""The schedule for a channel model: robots compute, and messages travel by radio, in simulated seconds.

Events are discrete, with times in whole nanoseconds, so that sums are exact and a seed determines a run. Time is
counted as by Sultanik, Lass and Regli (2007, DCOPolis), who add computation and communication. But computation is
counted in constraint checks of a fixed duration, because processor time is not reproducible. NCCCs are the same as
without delays: the clocks in envelopes are not changed.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Sequence
from itertools import count

import msgspec

from robochoc.communication.simulator.channel import NS_PER_MS, NS_PER_S, ChannelModel
from robochoc.communication.simulator.schedule import Schedule
from robochoc.protocols.message import Envelope

_SEND, _WAKE = 0, 1
"""Kinds of events. At equal times, ready messages are sent before any robot reads its inbox."""


class Timed(Schedule):
    """All robots compute at the same time, and share the medium of `channel`.

    `now` is in nanoseconds. Ties are broken by the seed.

    A robot receives all messages that have arrived, and is busy for as long as its checks take. It passes each message
    to its radio at the check at which the message is written, and continues to compute. Messages get the medium in the
    order in which they are ready.
    """

    def __init__(self, seed: int, channel: ChannelModel) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._channel = channel
        self._count = count()
        self.now = self._end_ns = 0
        self._said: list[tuple[int, Envelope]] = []
        self._busy_until: dict[str, int] = {}
        self._free_at: dict[str, int] = {}
        self._inboxes: dict[str, list[tuple[int, int, Envelope]]] = {}
        self._last_arrival: dict[tuple[str, str], int] = {}
        self._agenda: list[tuple[int, int, float, int, Envelope | str]] = []
        self._turns: dict[str, int] = {}

    @property
    def elapsed_s(self) -> float:
        """See `Schedule.elapsed_s`."""
        return self._end_ns / NS_PER_S

    def put(self, envelope: Envelope, checks: int = 0) -> None:
        """Store `envelope`, with its sending time, until all messages of its sender are known."""
        self._said.append((self.now + checks * self._channel.check_ns, envelope))

    def lose(self, envelope: Envelope, checks: int = 0) -> None:
        """Store `envelope` like `put`. It needs time on the air, but does not arrive."""
        self.put(msgspec.structs.replace(envelope, receiver=""), checks)

    def wait(self) -> None:
        """Advance to the first timeout in the channel after the last robot finished."""
        self.now = self._end_ns + round(self._channel.timeout_ms * NS_PER_MS)

    def done(self, robot: str, clock: int, checks: int) -> None:  # noqa: ARG002 - time is not the NCCC clock
        """Record that the robot is free again, `checks` constraint checks after the start of its step."""
        free = self.now + checks * self._channel.check_ns
        self._end_ns = max(self._end_ns, free)
        self._busy_until[robot] = free
        lot = self._chance.random()
        for ready, envelope in self._said:
            self._note(ready, _SEND, lot, envelope)
        self._said.clear()
        if self._inboxes.get(robot):
            self._wake(robot)

    def get(self) -> Sequence[Envelope]:
        """Return all messages in the inbox of the robot with the next turn."""
        while self._agenda:
            due, _, _, _, what = heapq.heappop(self._agenda)
            if isinstance(what, Envelope):
                self._transmit(due, what)
                continue
            if self._turns.get(what) != due:  # the robot has had this turn, or its turn was moved
                continue
            del self._turns[what]
            inbox = self._inboxes[what]
            self.now = due
            packet = []
            while inbox and inbox[0][0] <= due:
                packet.append(heapq.heappop(inbox)[2])
            return packet
        return ()

    def clear(self) -> None:
        """Drop all messages in transit, reset the time, and free all robots."""
        states = (self._busy_until, self._free_at, self._inboxes, self._last_arrival, self._turns)
        for state in states:
            state.clear()
        self._agenda.clear()
        self._said.clear()
        self.now = self._end_ns = 0

    def time(self, checks: int) -> float:
        """Return the simulated time in seconds, `checks` constraint checks after the start of the current step."""
        return (self.now + checks * self._channel.check_ns) / NS_PER_S

    def _transmit(self, ready: int, envelope: Envelope) -> None:
        """Send `envelope` when the medium is free. It arrives no earlier than its predecessor in the same channel."""
        edge = (envelope.sender, envelope.receiver)
        medium = "" if self._channel.shared else envelope.sender
        crossing = self._channel.crossing(len(envelope.content), self._chance)
        sent = max(ready, self._free_at.get(medium, 0)) + crossing.air
        self._free_at[medium] = sent
        if not envelope.receiver:
            return
        arrival = max(sent + crossing.waiting + crossing.latency, self._last_arrival.get(edge, 0))
        self._last_arrival[edge] = arrival
        inbox = self._inboxes.setdefault(envelope.receiver, [])
        first = not inbox or arrival < inbox[0][0]
        heapq.heappush(inbox, (arrival, next(self._count), envelope))
        if first:
            self._wake(envelope.receiver)

    def _wake(self, robot: str) -> None:
        """Schedule the turn of `robot`, once a message has arrived and it is not busy. A robot has at most one turn."""
        due = max(self._inboxes[robot][0][0], self._busy_until.get(robot, 0))
        if self._turns.get(robot) != due:
            self._turns[robot] = due
            self._note(due, _WAKE, self._chance.random(), robot)

    def _note(self, due: int, kind: int, lot: float, what: Envelope | str) -> None:
        """Add an event to the agenda. Ties between robots are broken at random; a robot's messages stay in order."""
        heapq.heappush(self._agenda, (due, kind, lot, next(self._count), what))
