"""The trace: runs as columns of numbers, from which a page draws them and the causes of messages are found.

A trace is built from events. A robot's step is the processing of one packet: receiving messages, changing its state,
and sending messages. Steps are numbered in the order of their ends, and the messages sent in a step are consecutive, so
message numbers are in causal order. This is true for any order of events: if a step received a message whose sending is
not yet recorded, the step waits for that event, since the robots' clocks and the order of their reports may differ.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Self

import msgspec
from msgspec import UNSET

from robochoc.journal.events import (
    AnyEvent,
    Began,
    Concluded,
    Decided,
    DroppedOut,
    Given,
    Granted,
    Heard,
    Improved,
    Leads,
    Lost,
    Received,
    Refused,
    Registered,
    Sent,
    Settled,
)
from robochoc.journal.journal import Header, Journal
from robochoc.journal.team_events import cost_in_user_units
from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import Outcome
from robochoc.sniffer.columns import NOT_YET, Contents, floats, longs, shorts
from robochoc.system.errors import RobochocError


class RunRecord(msgspec.Struct, frozen=True):
    """A run, or epoch: its first message and step, and the robots' problems (`given`; None: unknown).

    `files`: the robots' XML files by name, including files from earlier runs.
    """

    number: int
    protocol: str
    epoch: int | None
    opened_by: str | None
    message: int
    step: int
    given: Given | None = None
    files: Mapping[str, str] = {}


class TraceNote(msgspec.Struct, frozen=True):
    """An event that is neither a message nor a decision. `step`: the step of `robot` in which it happened.

    For events outside of steps, such as losses and refusals, `step` is the number of the next step.
    """

    t: float
    step: int
    kind: str
    robot: str
    text: str


class MessageTable(NamedTuple):
    """The columns for messages; see `columns.py` for their types.

    `taken`: the step that received the message, or `NOT_YET`, which may change later. `sequence`: the sender's number
    for the message within the run, from 1.
    """

    t: Any
    clock: Any
    step: Any
    bytes: Any
    sender: Any
    receiver: Any
    kind: Any
    run: Any
    taken: Any
    sequence: Any


class StepTable(NamedTuple):
    """The columns for steps. `packet_end`, `said_end`: the numbers of messages received and sent up to a step's end."""

    t: Any
    clock: Any
    checks: Any
    packet_end: Any
    robot: Any
    run: Any
    said_end: Any


def note_of(event: AnyEvent, step: int) -> TraceNote | None:
    """Return the note for an event that is not a message, or None if the event has no note."""
    match event:
        case Improved():
            return TraceNote(event.t, step, "improved", "", f"the best cost so far is {cost_shown(event.cost)}")
        case DroppedOut() | Lost():
            end = "was lost" if isinstance(event, Lost) else "has dropped out"
            return TraceNote(event.t, step, "lost", event.robot, f"{event.robot} {end}: {event.why}")
        case Leads():
            words = f"{event.master} leads in term {event.term}: {event.why}"
            return TraceNote(event.t, step, "granted", event.master, words)
        case Refused():
            return TraceNote(event.t, step, "refused", event.who, f"{event.who} was refused {event.what}: {event.why}")
        case Granted():
            return TraceNote(event.t, step, "granted", event.who, f"{event.who} was granted {event.what}")
        case _:
            return None


MOST_NAMES = 0xFFFF
"""The maximum number of robots, message types, and runs, which are numbered by two bytes."""


MOST_COUNTED = 1 << 53


class TraceTooLargeError(RobochocError, ValueError):
    """The journal has more robots, message types, or runs than a trace can number."""


class PendingChannel:
    """The messages in transit from one robot to another in a run.

    `owed`: the number of received messages whose sending is not yet recorded.
    """

    __slots__ = ("in_transit", "owed")

    def __init__(self) -> None:
        self.in_transit: deque[int] = deque()
        self.owed = 0


class PendingStep:
    """A step that has not ended, or waits until the sending of its received messages is recorded."""

    __slots__ = ("checks", "clock", "decided", "notes", "packet", "received", "sent", "t")

    def __init__(self) -> None:
        self.received: deque[PendingChannel] = deque()
        self.packet: list[int] = []
        self.decided: dict[str, int] | None = None
        self.notes: list[tuple[float, str, str]] = []
        self.sent: list[Sent] = []
        self.t = 0.0
        self.clock = self.checks = 0

    def is_complete(self) -> bool:
        """Move known received messages to the step's packet. Return whether all received messages are known."""
        received, packet = self.received, self.packet
        while received:
            if not (in_transit := received[0].in_transit):
                return False
            packet.append(in_transit.popleft())
            received.popleft()
        return True


class Trace:
    """The events in all runs of a journal. Columns, lists and numbers only grow.

    `generation` distinguishes traces with different numberings: a rebuilt trace has the next generation.
    """

    def __init__(self, header: Header, generation: int = 0) -> None:
        self.header = header
        self.generation = generation
        self.robots: list[str] = []
        self.kinds: list[str] = []
        self.runs: list[RunRecord] = []
        self.messages = MessageTable(
            floats(), floats(), longs(), longs(), shorts(), shorts(), shorts(), shorts(), longs(), longs()
        )
        self.steps = StepTable(floats(), floats(), floats(), longs(), shorts(), shorts(), longs())
        self.packets = longs()
        self.decisions: list[tuple[int, dict[str, int]]] = []
        self.notes: list[TraceNote] = []
        self.variables: dict[str, dict[str, None]] = {}
        """The variables that each robot has decided, by robot, in the order of their first decisions."""
        self.over = False
        self.outcome: Outcome | None = None
        self.damage: str | None = None
        self.unseen = 0
        """The number of received messages whose sending is not recorded."""
        self.outdated = False
        """True if the sending of an unseen message was recorded later: a rebuilt trace would be more complete."""
        self._contents = Contents()
        self._number_of_robot = _Numbers(self.robots)
        self._number_of_kind = _Numbers(self.kinds)
        self._reset_run()

    @classmethod
    def of(cls, journal: Journal, generation: int = 0) -> Self:
        """Return the trace of a complete journal. Raises `TraceTooLargeError`."""
        trace = cls(journal.header, generation)
        trace.add(journal.events)
        trace.end(journal.outcome, journal.damage)
        return trace

    def add(self, events: Iterable[AnyEvent]) -> None:
        """Add `events`, in which each robot's events are in order. Raises `TraceTooLargeError`."""
        opened, channels = self._open, self._channels
        for event in events:
            if isinstance(event, Sent):
                step = opened.get(event.sender) or self._open_step(event.sender, event)
                step.t, step.clock = event.t, event.clock
                step.sent.append(event)
            elif isinstance(event, Received):
                step = opened.get(event.receiver) or self._open_step(event.receiver, event)
                step.t, step.clock = event.t, event.clock
                edge = event.sender, event.receiver
                step.received.append(channels.get(edge) or self._channel(*edge))
            elif isinstance(event, Settled):
                self._settle(event)
            else:
                self._add_rare(event)
                opened, channels = self._open, self._channels  # both are new in a new run

    def flush(self) -> None:
        """Stop waiting: count received messages whose sending is not recorded as unseen."""
        waiting = [(queue[0].t, robot) for robot, queue in self._waiting.items()]
        heapq.heapify(waiting)
        while waiting:
            _, robot = heapq.heappop(waiting)
            queue = self._waiting.get(robot)
            if not queue:
                continue
            self._give_up(queue[0])
            self._write_ready([robot])
            if queue:
                heapq.heappush(waiting, (queue[0].t, robot))

    def end(self, outcome: Outcome | None = None, damage: str | None = None) -> None:
        """End the trace: there are no more events."""
        self._close()
        self.over, self.outcome, self.damage = True, outcome, damage

    def content(self, message: int) -> dict[str, Any]:
        """Return the fields of a message, by name."""
        return self._contents[message]

    def packed_content(self, message: int) -> bytes:
        """Return the fields of a message as msgpack."""
        return self._contents.packed(message)

    def packet(self, step: int) -> list[int]:
        """Return the messages received in a step, in order."""
        first = self.steps.packet_end[step - 1] if step else 0
        return list(self.packets[first : self.steps.packet_end[step]])

    def sent_in(self, step: int) -> range:
        """Return the messages sent in a step."""
        return range(self.steps.said_end[step - 1] if step else 0, self.steps.said_end[step])

    def causes(self, message: int) -> list[int]:
        """Return the messages received by the step that sent this message; empty if it was sent at the start."""
        return self.packet(self.messages.step[message])

    def consequences(self, message: int) -> range:
        """Return the messages sent by the step that received this message."""
        taken = self.messages.taken[message]
        return range(0) if taken == NOT_YET else self.sent_in(taken)

    def number_of(self, robot: str) -> int:
        """Return the number of a robot, which is assigned if the robot is new. Raises `TraceTooLargeError`."""
        return self._number_of_robot[robot]

    # Runs

    def _reset_run(self) -> None:
        self._channels: dict[tuple[str, str], PendingChannel] = {}
        self._open: dict[str, PendingStep] = {}
        self._waiting: dict[str, deque[PendingStep]] = {}
        self._checks: dict[str, int] = {}
        self._sent_counts: dict[str, int] = {}

    def _close(self) -> None:
        """End the run: stop waiting, and end the steps whose end is not recorded."""
        for robot, step in list(self._open.items()):
            step.checks = self._checks.get(robot, 0)
            self._ready(robot, step)
        self.flush()
        self._reset_run()

    def _new_run(self, began: Began) -> None:
        self._close()
        if len(self.runs) == MOST_NAMES:
            raise TraceTooLargeError(f"the journal has more than {MOST_NAMES} runs")
        self.runs.append(
            RunRecord(
                number=len(self.runs),
                protocol=began.protocol,
                epoch=None if began.epoch is UNSET else began.epoch,
                opened_by=None if began.opened_by is UNSET else began.opened_by,
                message=len(self.messages.t),
                step=len(self.steps.t),
            )
        )

    def _set_given(self, given: Given) -> None:
        """Record the robots' problems in this run, and number the robots in their order."""
        if not self.runs:
            self._new_run(Began(t=given.t, protocol=self.header.protocol))
        known = self.runs[-2].files if len(self.runs) > 1 else {}
        files = {name: file for name in given.order if (file := given.robots.get(name, known.get(name))) is not None}
        self.runs[-1] = msgspec.structs.replace(self.runs[-1], given=given, files=files)
        for name in given.order:
            self.number_of(name)

    # Steps

    def _open_step(self, robot: str, event: Sent | Received | Decided | Heard | Concluded) -> PendingStep:
        step = self._open.get(robot)
        if step is None:
            if not self.runs:
                self._new_run(Began(t=event.t, protocol=self.header.protocol))
            step = self._open[robot] = PendingStep()
        step.t = event.t
        if isinstance(event, Sent | Received | Decided):
            step.clock = event.clock
        return step

    def _channel(self, sender: str, receiver: str) -> PendingChannel:
        channel = self._channels.get((sender, receiver))
        if channel is None:
            channel = self._channels[sender, receiver] = PendingChannel()
        return channel

    def _add_rare(self, event: AnyEvent) -> None:
        match event:
            case Decided():
                self._open_step(event.robot, event).decided = event.assignment
            case Concluded():
                note = (event.t, "concluded", f"concluded: {event.verdict.replace('-', ' ')}")
                self._open_step(event.robot, event).notes.append(note)
            case Heard():
                cost = cost_in_user_units(self.runs[-1].given, event.cost) if self.runs else event.cost
                note = (event.t, "heard", f"{event.robot} knows an assignment with cost {cost_shown(cost)}")
                self._open_step(event.robot, event).notes.append(note)
            case Began():
                self._new_run(event)
            case Given():
                self._set_given(event)
            case Registered():
                self.number_of(event.robot)
            case _:
                note_there = note_of(event, len(self.steps.t))
                if note_there is not None:
                    self.notes.append(note_there)

    def _settle(self, event: Settled) -> None:
        robot = event.robot
        step = self._open.get(robot)
        if step is None:
            if not self.runs:
                self._new_run(Began(t=event.t, protocol=self.header.protocol))
            step = PendingStep()
        step.t, step.clock, step.checks = event.t, event.clock, event.checks
        self._checks[robot] = event.checks
        self._ready(robot, step)

    def _ready(self, robot: str, step: PendingStep) -> None:
        """Write an ended step, or store it until the sending of the messages it received is recorded."""
        self._open.pop(robot, None)
        queue = self._waiting.get(robot)
        if queue is not None:
            queue.append(step)
        elif step.is_complete():
            self._write(robot, step)
            if self._waiting and step.sent:
                self._write_ready(dict.fromkeys(sent.receiver for sent in step.sent))
        else:
            self._waiting[robot] = deque([step])

    def _write_ready(self, robots: Iterable[str]) -> None:
        """Write the complete stored steps of `robots`, and of the robots that received messages from these."""
        ready = list(robots)
        while ready:
            robot = ready.pop()
            queue = self._waiting.get(robot)
            while queue and queue[0].is_complete():
                step = queue.popleft()
                self._write(robot, step)
                ready.extend(dict.fromkeys(sent.receiver for sent in step.sent if sent.receiver in self._waiting))
            if queue is not None and not queue:
                del self._waiting[robot]

    def _give_up(self, step: PendingStep) -> None:
        """Count the messages for which `step` is still waiting as unseen."""
        while not step.is_complete():
            step.received.popleft().owed += 1
            self.unseen += 1

    def _write(self, robot: str, step: PendingStep) -> None:
        """Write a step and each of its messages as rows."""
        steps, number = self.steps, len(self.steps.t)
        run = len(self.runs) - 1
        for message in step.packet:
            self.messages.taken[message] = number
        self.packets.extend(step.packet)
        for t, kind, text in step.notes:
            self.notes.append(TraceNote(t, number, kind, robot, text))
        if step.decided is not None:
            self.decisions.append((number, step.decided))
            self.variables.setdefault(robot, {}).update(dict.fromkeys(step.decided))
        robot_number = self.number_of(robot)
        if step.sent:
            self._write_messages(step.sent, number, robot_number, run)
        steps.t.append(step.t)
        steps.clock.append(_counted(step.clock))
        steps.checks.append(_counted(step.checks))
        steps.packet_end.append(len(self.packets))
        steps.robot.append(robot_number)
        steps.run.append(run)
        steps.said_end.append(len(self.messages.t))

    def _write_messages(self, sent: Sequence[Sent], step: int, sender: int, run: int) -> None:
        """Write the messages that `sender` sent in a step: each column at once, since a journal has millions."""
        messages, first, count = self.messages, len(self.messages.t), len(sent)
        name = sent[0].sender
        for number, event in enumerate(sent, first):
            channel = self._channels.get((name, event.receiver)) or self._channel(name, event.receiver)
            if channel.owed:
                channel.owed -= 1
                self.unseen -= 1
                self.outdated = True
            else:
                channel.in_transit.append(number)
        self._contents.extend([event.content for event in sent])
        robots, kinds = self._number_of_robot, self._number_of_kind
        messages.t.extend([event.t for event in sent])
        messages.clock.extend([_counted(event.clock) for event in sent])
        messages.step.extend([step] * count)
        messages.bytes.extend(
            [size if 0 <= (size := event.bytes) <= NOT_YET else min(max(size, 0), NOT_YET) for event in sent]
        )
        messages.sender.extend([sender] * count)
        messages.receiver.extend([robots[event.receiver] for event in sent])
        messages.kind.extend([kinds[event.type] for event in sent])
        messages.run.extend([run] * count)
        messages.taken.extend([NOT_YET] * count)
        before = self._sent_counts.get(name, 0)
        messages.sequence.extend(range(before + 1, before + count + 1))
        self._sent_counts[name] = before + count


class _Numbers(dict[str, int]):
    """The numbers of `names`. A new name gets the next number. Raises `TraceTooLargeError`."""

    def __init__(self, names: list[str]) -> None:
        super().__init__()
        self._names = names

    def __missing__(self, name: str) -> int:
        if len(self) == MOST_NAMES:
            raise TraceTooLargeError(f"the journal has more than {MOST_NAMES} robots or types of messages")
        self[name] = number = len(self)
        self._names.append(name)
        return number


def _counted(number: int) -> int:
    """Return a count clamped to integers that a float represents exactly, since a journal may contain any number."""
    return number if 0 <= number <= MOST_COUNTED else min(max(number, 0), MOST_COUNTED)
