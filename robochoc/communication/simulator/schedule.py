"""Schedules: the messages that are under way in a simulator, and which of them arrive next.

Channels are FIFO: between two robots no message overtakes another. What reaches a robot together is one packet.
Every schedule is deterministic from its seed.
"""

from __future__ import annotations

import heapq
import random
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from itertools import count

from robochoc.model.message import Envelope
from robochoc.system.compiling import mypyc_attr


@mypyc_attr(allow_interpreted_subclasses=True)
class Schedule(ABC):
    """The messages under way. `now` is the time, in the schedule's own unit."""

    now: int = 0

    @abstractmethod
    def put(self, envelope: Envelope, checks: int = 0) -> None:
        """Send `envelope` on its way: its sender has said it `checks` checks after it had begun with its packet."""

    @abstractmethod
    def get(self) -> Sequence[Envelope]:
        """Return the next packet, all for one robot, oldest first in each channel; empty when nothing is under way."""

    @abstractmethod
    def clear(self) -> None:
        """Drop all messages under way, and reset all clocks."""

    def done(self, robot: str, clock: int, checks: int) -> None:  # noqa: B027 - not every schedule has to know
        """`robot` has finished with its packet (or its start), all it said being put: its NCCC clock stands at `clock`.

        `checks` is the number of constraint checks that this took.
        """

    def time(self, checks: int) -> float:  # noqa: ARG002 - not every schedule has to know
        """Return the time of an event, this number of checks after a robot began with its packet."""
        return float(self.now)

    @property
    def elapsed_s(self) -> float:
        """Simulated seconds until the last robot had finished; 0 where time is not counted in seconds."""
        return 0.0

    @property
    def cycles(self) -> int:
        """Cycles that have begun; 0 where time is not counted in cycles."""
        return 0

    @property
    def next_cycle(self) -> int:
        """The cycle in which the next packet arrives; 0 where there is none, or time is not counted in cycles."""
        return 0


@mypyc_attr(allow_interpreted_subclasses=True)
class Concurrent(Schedule):
    """All robots compute at the same time, and time is counted in constraint checks. The default.

    The asynchronous message-delaying simulator of Zivan and Meisels (2006): a robot is busy for as long as its
    checks take, then takes in all that has arrived meanwhile. A message leaves at the check at which it is said,
    which its clock tells, so it may be there before its sender is free again. It takes a number of checks drawn from
    0..`longest`, which the receiver's NCCC clock takes up as well. Ties are broken by the seed.

    With `one_by_one` a robot takes in one message at a time, and settles after each.
    """

    def __init__(self, seed: int, longest: int = 0, *, one_by_one: bool = False) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._longest = longest
        self._one_by_one = one_by_one
        self._count = count()
        self._busy_until: dict[str, int] = {}
        self._inboxes: dict[str, list[tuple[int, int, Envelope]]] = {}
        self._last_arrival: dict[tuple[str, str], int] = {}
        self._agenda: list[tuple[int, float, str]] = []
        self._turns: dict[str, int] = {}

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - they are in its clock
        """Draw the delay; never earlier than the message before it in the same channel."""
        edge = (envelope.sender, envelope.receiver)
        delay = self._chance.randint(0, self._longest) if self._longest else 0
        arrival = max(envelope.clock + delay, self._last_arrival.get(edge, 0))
        self._last_arrival[edge] = arrival
        inbox = self._inboxes.setdefault(envelope.receiver, [])
        first = not inbox or arrival < inbox[0][0]
        if arrival > envelope.clock:
            envelope = envelope._replace(clock=arrival)
        heapq.heappush(inbox, (arrival, next(self._count), envelope))
        if first:
            self._note(envelope.receiver)

    def get(self) -> Sequence[Envelope]:
        """Return all messages in the inbox of the robot that reads its inbox next, or the first of them."""
        while self._agenda:
            due, _, robot = heapq.heappop(self._agenda)
            if self._turns.get(robot) != due:  # it has had its turn, or has been given another
                continue
            del self._turns[robot]
            inbox = self._inboxes[robot]
            self.now = due
            packet = []
            while inbox and inbox[0][0] <= due:
                packet.append(heapq.heappop(inbox)[2])
                if self._one_by_one:
                    break
            return packet
        return ()

    def clear(self) -> None:
        """Drop all messages under way. No robot is busy afterwards."""
        for state in (self._busy_until, self._inboxes, self._last_arrival, self._agenda, self._turns):
            state.clear()
        self.now = 0

    def done(self, robot: str, clock: int, checks: int) -> None:  # noqa: ARG002 - they are in the clock
        """Note that the robot is free from `clock` on."""
        self._busy_until[robot] = clock
        if self._inboxes.get(robot):
            self._note(robot)

    def _note(self, robot: str) -> None:
        """Give `robot` its turn at the time when something has arrived and it is not busy; a robot has one at most."""
        due = max(self._inboxes[robot][0][0], self._busy_until.get(robot, 0))
        if self._turns.get(robot) != due:
            self._turns[robot] = due
            heapq.heappush(self._agenda, (due, self._chance.random(), robot))


@mypyc_attr(allow_interpreted_subclasses=True)
class Cycles(Schedule):
    """All robots go in step: in each cycle, each takes in all that was sent to it in the cycle before.

    The synchronous simulator by which Yokoo, Durfee, Ishida and Kuwabara (1998, section 6) and Modi, Shen, Tambe and
    Yokoo (2005, section 6) count cycles. The start is no cycle. Within a cycle robots are drawn by the seed; no
    protocol can tell.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._packets: list[list[Envelope]] = []
        self._sent: dict[str, list[Envelope]] = {}

    @property
    def cycles(self) -> int:
        """Cycles that have begun."""
        return self.now

    @property
    def next_cycle(self) -> int:
        """The cycle in which the next packet arrives; 0 where there is none."""
        return self.now if self._packets else self.now + 1 if self._sent else 0

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - a cycle is as long as it takes
        """Send `envelope`: it arrives in the next cycle."""
        self._sent.setdefault(envelope.receiver, []).append(envelope)

    def get(self) -> Sequence[Envelope]:
        """Return what has been sent to a robot that has not had its turn in this cycle."""
        if not self._packets and self._sent:
            self.now += 1
            self._packets = list(self._sent.values())
            self._sent = {}
            self._chance.shuffle(self._packets)
        return self._packets.pop() if self._packets else ()

    def clear(self) -> None:
        """Drop all messages under way; cycles are counted from 0 again."""
        self._packets.clear()
        self._sent.clear()
        self.now = 0


@mypyc_attr(allow_interpreted_subclasses=True)
class RandomChannels(Schedule):
    """Any channel may come next, so any message may be slow for any time: a hard test, not a model. A packet a step.

    A packet is the head of a channel drawn from all, and, each time with the chance of one half, the head of
    another channel to the same robot.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._channels: dict[tuple[str, str], deque[Envelope]] = {}
        self._waiting: list[tuple[str, str]] = []

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - there is no time
        """Append to the channel from sender to receiver."""
        edge = (envelope.sender, envelope.receiver)
        channel = self._channels.setdefault(edge, deque())
        if not channel:
            self._waiting.append(edge)
        channel.append(envelope)

    def get(self) -> Sequence[Envelope]:
        """Draw a channel, then perhaps more that lead to the same robot."""
        if not self._waiting:
            return ()
        self.now += 1
        packet = [self._take(self._chance.randrange(len(self._waiting)))]
        while self._chance.getrandbits(1):
            more = [place for place, edge in enumerate(self._waiting) if edge[1] == packet[0].receiver]
            if not more:
                break
            packet.append(self._take(self._chance.choice(more)))
        return packet

    def clear(self) -> None:
        """Drop all messages under way."""
        self._channels.clear()
        self._waiting.clear()

    def _take(self, place: int) -> Envelope:
        """Return the head of the waiting channel at `place`; an empty channel leaves the list, unordered."""
        edge = self._waiting[place]
        channel = self._channels[edge]
        head = channel.popleft()
        if not channel:
            self._waiting[place] = self._waiting[-1]
            self._waiting.pop()
        return head
