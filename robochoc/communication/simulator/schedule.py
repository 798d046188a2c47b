"""Schedules: store the messages in transit in a simulator, and decide the order in which they arrive.

Channels are FIFO: no message between two robots overtakes another one. Messages that reach a robot together form one
packet. Every schedule is deterministic for a given seed.
"""

from __future__ import annotations

import heapq
import random
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Final

from robochoc.protocols.message import Envelope
from robochoc.system.compiling import mypyc_attr

NEVER: Final = -1
"""Means that no turn is scheduled."""


@mypyc_attr(allow_interpreted_subclasses=True)
class Schedule(ABC):
    """Stores the messages in transit. `now` is the time, in the schedule's unit."""

    now: int = 0

    @abstractmethod
    def put(self, envelope: Envelope, checks: int = 0) -> None:
        """Send `envelope`, written `checks` constraint checks after its sender started to handle its packet."""

    @abstractmethod
    def get(self) -> Sequence[Envelope]:
        """Return the next packet for one robot, in the order of each channel; empty if no message is in transit."""

    @abstractmethod
    def clear(self) -> None:
        """Drop all messages in transit, and reset all clocks."""

    def done(self, robot: str, clock: int, checks: int) -> None:  # noqa: B027 - not every schedule has to know
        """Record that `robot` has handled its packet (or its start), and that all its messages were put.

        `clock` is its NCCC clock, `checks` the number of constraint checks in this step.
        """

    def lose(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: B027 - not every schedule has to know
        """Send `envelope` like `put`, but lose it in transit."""

    def wait(self) -> None:  # noqa: B027 - not every schedule has to know
        """Advance the time until robots notice that no more messages arrive."""

    def time(self, checks: int) -> float:  # noqa: ARG002 - not every schedule has to know
        """Return the time of an event `checks` constraint checks after a robot started to handle its packet."""
        return float(self.now)

    @property
    def elapsed_s(self) -> float:
        """The simulated seconds until the last robot finished; 0 if time is not counted in seconds."""
        return 0.0

    @property
    def cycles(self) -> int:
        """The number of cycles started; 0 if time is not counted in cycles."""
        return 0

    @property
    def next_cycle(self) -> int:
        """The cycle in which the next packet arrives; 0 if there is no packet, or time is not counted in cycles."""
        return 0


@mypyc_attr(allow_interpreted_subclasses=True)
class Concurrent(Schedule):
    """All robots compute at the same time, and time is counted in constraint checks. This is the default schedule.

    This is the asynchronous message-delaying simulator of Zivan and Meisels (2006): a robot is busy for as long as its
    checks take, and then receives all messages that have arrived meanwhile. A message leaves at the check at which it
    was written (its clock), so it may arrive before its sender is free again. Its delay, in checks, is drawn from
    0..`longest` and also advances the receiver's NCCC clock. Ties are broken by the seed.

    With `one_by_one` a robot receives one message at a time, and settles after each message.
    """

    def __init__(self, seed: int, longest: int = 0, *, one_by_one: bool = False) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._longest = longest
        self._one_by_one = one_by_one
        self._said = 0
        self._readers: dict[str, _Reader] = {}
        self._times: list[int] = []
        """The times of turns, in a heap without duplicates."""
        self._turns: dict[int, list[tuple[float, str]]] = {}
        """For each time, a heap of the robots with a turn, in random order. Small heaps are faster than a large one."""

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - they are in its clock
        """Send `envelope` with a random delay. It arrives no earlier than its predecessor in the same channel."""
        receiver, sender, sent_at = envelope.receiver, envelope.sender, envelope.clock
        reader = self._readers.get(receiver)
        if reader is None:
            reader = self._readers[receiver] = _Reader(receiver)
        arrival = sent_at + self._chance.randint(0, self._longest) if self._longest else sent_at
        before = reader.last_arrival.get(sender, 0)
        if before > arrival:  # noqa: PLR1730 - faster
            arrival = before
        reader.last_arrival[sender] = arrival
        if arrival > sent_at:
            envelope = Envelope(sender, receiver, envelope.content, arrival)
        inbox = reader.inbox
        first = not inbox or arrival < inbox[0][0]
        self._said += 1
        heapq.heappush(inbox, (arrival, self._said, envelope))
        if first:
            self._note(reader, arrival)

    def get(self) -> Sequence[Envelope]:
        """Return all messages (or the first one) in the inbox of the robot with the next turn."""
        while self._times:
            due = self._times[0]
            turns = self._turns[due]
            reader = self._readers[heapq.heappop(turns)[1]]
            if not turns:
                heapq.heappop(self._times)
                del self._turns[due]
            if reader.due != due:  # the robot has had this turn, or its turn was moved
                continue
            reader.due = NEVER
            inbox = reader.inbox
            self.now = due
            packet = [heapq.heappop(inbox)[2]]
            while inbox and inbox[0][0] <= due and not self._one_by_one:
                packet.append(heapq.heappop(inbox)[2])
            return packet
        return ()

    def clear(self) -> None:
        """Drop all messages in transit, and free all robots."""
        self._readers.clear()
        self._times.clear()
        self._turns.clear()
        self.now = 0

    def done(self, robot: str, clock: int, checks: int) -> None:  # noqa: ARG002 - they are in the clock
        """Record that the robot is busy until `clock`."""
        reader = self._readers.get(robot)
        if reader is None:
            reader = self._readers[robot] = _Reader(robot)
        reader.busy_until = clock
        if reader.inbox:
            self._note(reader, reader.inbox[0][0])

    def _note(self, reader: _Reader, arrival: int) -> None:
        """Schedule the robot's turn, once its first message has arrived and it is free. It has at most one turn."""
        due, free = arrival, reader.busy_until
        if free > due:  # noqa: PLR1730 - faster
            due = free
        if reader.due == due:
            return
        reader.due = due
        turn = (self._chance.random(), reader.name)
        turns = self._turns.get(due)
        if turns is None:
            self._turns[due] = [turn]
            heapq.heappush(self._times, due)
        else:
            heapq.heappush(turns, turn)


class _Reader:
    """The state of a robot in `Concurrent`: its inbox, the end of its busy time, and the time of its turn."""

    __slots__ = ("busy_until", "due", "inbox", "last_arrival", "name")

    def __init__(self, name: str) -> None:
        self.name = name
        self.inbox: list[tuple[int, int, Envelope]] = []
        self.last_arrival: dict[str, int] = {}
        self.busy_until = 0
        self.due = NEVER


@mypyc_attr(allow_interpreted_subclasses=True)
class Cycles(Schedule):
    """All robots work in lockstep: in each cycle, each robot receives all messages sent to it in the previous cycle.

    This is the synchronous simulator with which Yokoo, Durfee, Ishida and Kuwabara (1998, section 6) and Modi, Shen,
    Tambe and Yokoo (2005, section 6) count cycles. The start is not a cycle. The order of robots within a cycle is
    drawn from the seed; it does not influence any protocol.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._packets: list[list[Envelope]] = []
        self._sent: dict[str, list[Envelope]] = {}

    @property
    def cycles(self) -> int:
        """The number of cycles started."""
        return self.now

    @property
    def next_cycle(self) -> int:
        """The cycle in which the next packet arrives; 0 if there is no packet."""
        return self.now if self._packets else self.now + 1 if self._sent else 0

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - a cycle has no length
        """Send `envelope` to arrive in the next cycle."""
        self._sent.setdefault(envelope.receiver, []).append(envelope)

    def get(self) -> Sequence[Envelope]:
        """Return the messages to a robot that has not yet had its turn in this cycle."""
        if not self._packets and self._sent:
            self.now += 1
            self._packets = list(self._sent.values())
            self._sent = {}
            self._chance.shuffle(self._packets)
        return self._packets.pop() if self._packets else ()

    def clear(self) -> None:
        """Drop all messages in transit, and restart the count of cycles at 0."""
        self._packets.clear()
        self._sent.clear()
        self.now = 0


@mypyc_attr(allow_interpreted_subclasses=True)
class RandomChannels(Schedule):
    """Any channel may be next, so any message may be delayed for any time: a hard test, not a model.

    One packet arrives per step: the head of a random channel, and, repeatedly with probability 1/2, the head of another
    channel to the same robot.
    """

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - a schedule is no secret
        self._channels: dict[tuple[str, str], deque[Envelope]] = {}
        self._waiting: list[tuple[str, str]] = []

    def put(self, envelope: Envelope, checks: int = 0) -> None:  # noqa: ARG002 - there is no time
        """Append `envelope` to the channel from its sender to its receiver."""
        edge = (envelope.sender, envelope.receiver)
        channel = self._channels.setdefault(edge, deque())
        if not channel:
            self._waiting.append(edge)
        channel.append(envelope)

    def get(self) -> Sequence[Envelope]:
        """Draw a channel, and possibly more channels to the same robot."""
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
        """Drop all messages in transit."""
        self._channels.clear()
        self._waiting.clear()

    def _take(self, place: int) -> Envelope:
        """Remove and return the head of the channel at index `place`. An empty channel is removed from the list."""
        edge = self._waiting[place]
        channel = self._channels[edge]
        head = channel.popleft()
        if not channel:
            self._waiting[place] = self._waiting[-1]
            self._waiting.pop()
        return head
