"""Replays one recorded run with its packets."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence

import msgspec

from robochoc.communication.host import Host
from robochoc.journal.events import AnyEvent, Received, Sent
from robochoc.journal.journal import Header
from robochoc.protocols.message import Envelope, Message
from robochoc.replay.channels import MessageDecoder, RecordedChannels
from robochoc.replay.comparison import StepComparison, StepDifference
from robochoc.replay.rebuild import RebuiltRobots
from robochoc.replay.steps import RecordedRun, RecordedStep, steps_of
from robochoc.system.errors import RobochocError

SIMULATED = "simulator"
"""The runtime whose schedules may delay messages. The delay of a message advances the receiver's clock."""
MAX_EXTRA_MESSAGES = 10_000
"""The maximum number of messages that a replayed step may send beyond those recorded."""

Listener = Callable[[str, Message], None]
"""Called within the step, with the receiver and the message, when the protocol sends a message."""


class NoEndError(RobochocError):
    """The protocol has sent so many messages in a step that the step may never end."""


class ReplayStopsError(RobochocError):
    """A robot cannot be replayed any further.

    `needs_sender`: a message to this robot can only be restored by replaying its sender.
    """

    def __init__(self, why: str, *, needs_sender: bool = False) -> None:
        super().__init__(why)
        self.needs_sender = needs_sender


class _Outbox(list[tuple[str, Message]]):
    """An outbox of limited size, because most faulty protocols send messages endlessly."""

    def __init__(self, most: int, listener: Listener) -> None:
        super().__init__()
        self._most = most
        self._listener = listener

    def append(self, sent: tuple[str, Message]) -> None:
        """Add one message. Raises `NoEndError` if there are too many messages."""
        if len(self) >= self._most:
            raise NoEndError(f"{len(self):,} messages in one step, which may never end")
        super().append(sent)
        self._listener(*sent)


class RunReplay:
    """A replay of one run: `robots` repeat its steps."""

    def __init__(self, run: RecordedRun, robots: RebuiltRobots, header: Header | None) -> None:
        self.run = run
        self.robots = robots
        self.received_messages: list[tuple[Sent, Message]] = []
        """The messages received in the last step."""
        self._decoder = MessageDecoder(robots.protocol)
        self._channels = RecordedChannels(run.events, self._decoder)
        self._comparison = StepComparison(self._decoder, header)
        self._simulated = header is None or header.runtime == SIMULATED
        self._started: set[str] = set()

    def steps(self) -> Iterator[RecordedStep]:
        """Yield the steps in order; each must be played before the next is requested.

        Clocks differ across machines, so a message may seem to be received before it was sent. Such a step is delayed.
        """
        waiting: dict[str, deque[RecordedStep]] = {}
        for step in steps_of(self.run.events):
            if step.robot in waiting or not self._channels.can_deliver(step.received):
                waiting.setdefault(step.robot, deque()).append(step)
                continue
            yield step
            yield from self._enabled_steps(waiting)
        for steps in waiting.values():
            yield from steps

    def _enabled_steps(self, waiting: dict[str, deque[RecordedStep]]) -> Iterator[RecordedStep]:
        """Yield the delayed steps that can be played now; each of these may enable another step."""
        moved = True
        while moved:
            moved = False
            for name, steps in list(waiting.items()):
                while steps and self._channels.can_deliver(steps[0].received):
                    moved = True
                    yield steps.popleft()
                if not steps:
                    del waiting[name]

    def play(self, step: RecordedStep, number: int, listener: Listener = lambda *_: None) -> StepDifference | None:
        """Replay a step, and return its first difference from the recording; None if there is no difference.

        Args:
            step: The step.
            number: The step's number among the steps of its robot.
            listener: Called for each message that the protocol sends.

        Raises:
            ReplayStopsError: if the robot, or a message that it received, is not available.
        """
        host = self.robots.hosts.get(step.robot)
        if host is None:
            raise ReplayStopsError("it is not in the team")
        events: list[AnyEvent] = []
        host.observe(events.append, lambda: 0.0)
        recorded = sum(isinstance(event, Sent) for event in step.done)
        host.protocol.outbox = _Outbox(recorded + MAX_EXTRA_MESSAGES, listener)
        host.protocol.checks_at_send.clear()
        self.received_messages = []
        sent: Sequence[Envelope] = ()
        packet: list[Sent] = []
        raised = ""
        try:
            self._receive(host, step, packet, events)
            sent = self._finish_step(host, step)
        except ReplayStopsError:
            raise
        except Exception as error:  # noqa: BLE001 - a protocol under development may raise anything
            raised = _error_with_place(error)
        found = self._comparison.first_difference(step, events, raised=bool(raised))
        if found is None and not raised:
            self._channels.send_again(sent)
            return None
        return self._difference(step, number, packet, found or (None, None), raised)

    def _receive(self, host: Host, step: RecordedStep, packet: list[Sent], events: list[AnyEvent]) -> None:
        """Deliver the messages of a step to its robot, and add them to `packet`."""
        for received in step.received:
            message, envelope = self._delivered(received)
            packet.append(message)
            self._receive_message(host, message, envelope)
            self._delay(host, received, events)

    def _delivered(self, received: Received) -> tuple[Sent, Envelope]:
        """Return the message that was received. Raises `ReplayStopsError`."""
        sent, envelope = self._channels.deliver(received)
        if sent is None:
            raise ReplayStopsError(f"the message {received.type} from {received.sender} is not in the journal")
        if envelope is None:
            why = f"the message {received.type} from {received.sender} cannot be restored from the journal"
            raise ReplayStopsError(why, needs_sender=True)
        return sent, envelope

    def _receive_message(self, host: Host, message: Sent, envelope: Envelope) -> None:
        host.receive(envelope)
        self.received_messages.append((message, self._decoder.message(envelope.content)))

    def _delay(self, host: Host, received: Received, events: list[AnyEvent]) -> None:
        """Advance the clock by the delay of a message: only the recorded clock shows this delay."""
        if self._simulated and received.clock > host.clock and events and isinstance(events[-1], Received):
            host.catch_up(received.clock)
            events[-1] = msgspec.structs.replace(events[-1], clock=received.clock)

    def _finish_step(self, host: Host, step: RecordedStep) -> Sequence[Envelope]:
        """Call the robot's `settle`, or `start` if it has not started before."""
        sent: Sequence[Envelope] = ()
        if step.received and (step.is_complete or step.done):
            sent = host.settle()
        elif not step.received and step.robot not in self._started:
            sent = host.start(lossless=self.robots.lossless)
        self._started.add(step.robot)
        return sent

    def _difference(
        self,
        step: RecordedStep,
        number: int,
        packet: Sequence[Sent],
        events: tuple[AnyEvent | None, AnyEvent | None],
        raised: str,
    ) -> StepDifference:
        return StepDifference(
            run=self.run.number,
            protocol=self.robots.protocol.__name__,
            robot=step.robot,
            step=number,
            packet=tuple(packet),
            recorded=events[0],
            replayed=events[1],
            raised=raised,
        )


def _error_with_place(error: Exception) -> str:
    """Return an exception with the file and line that raised it."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    place = f" ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})" if trace is not None else ""
    return f"{type(error).__name__}: {error}{place}"
