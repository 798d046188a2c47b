"""Compares a replayed step with its record."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from robochoc.journal.entries import STAMPED_LATE
from robochoc.journal.events import AnyEvent, Event, Received, Sent, Settled
from robochoc.journal.journal import Header
from robochoc.replay.channels import MessageDecoder
from robochoc.replay.steps import RecordedStep, RobotEvent


class StepDifference(msgspec.Struct, frozen=True, kw_only=True):
    """The first event that differs between journal and replay.

    Attributes:
        run: The number of the run or epoch, counted from 0.
        protocol: The name of the protocol's class.
        robot: The robot of the event.
        step: The number of the robot's step, counted from 0 over the whole journal.
        packet: The messages received in the step; empty for the step in which the robot starts.
        recorded: The event in the journal; None if the journal has no more events in this step.
        replayed: The event in the replay; None if the replay has no more events in this step.
        raised: The exception raised by the protocol, with its file and line; otherwise empty.
    """

    run: int
    protocol: str
    robot: str
    step: int
    packet: tuple[Sent, ...]
    recorded: AnyEvent | None
    replayed: AnyEvent | None
    raised: str = ""

    @property
    def summary(self) -> str:
        """The difference in one line."""
        if self.raised:
            return f"in its step {self.step} the protocol raised {self.raised}"
        recorded = type(self.recorded).__name__ if self.recorded else "nothing more"
        replayed = type(self.replayed).__name__ if self.replayed else "nothing more"
        return f"in its step {self.step} of run {self.run}, the record has {recorded}, and the replay {replayed}"


class StepComparison:
    """Compares the events of steps. Times are not compared.

    In the first version of the journal format, the events had another order, and messages had the clock at the end of
    the step.
    """

    def __init__(self, decoder: MessageDecoder, header: Header | None) -> None:
        self._decoder = decoder
        self._stamped_late = header is not None and header.version == STAMPED_LATE

    def first_difference(
        self, step: RecordedStep, replayed: Sequence[AnyEvent], *, raised: bool
    ) -> tuple[RobotEvent | None, AnyEvent | None] | None:
        """Return the first pair of different events; None if all are equal.

        Args:
            step: The recorded step.
            replayed: The events of the replayed step.
            raised: True if the protocol has raised an exception; then further events may be missing.
        """
        recorded = [*step.received, *step.done]
        if self._stamped_late:
            replayed = sorted(replayed, key=_place_in_first_version)
        for place, event in enumerate(recorded):
            again = replayed[place] if place < len(replayed) else None
            if again is None or not self._same(event, again):
                return event, again
        if len(replayed) > len(recorded) and step.is_complete and not raised:
            return None, replayed[len(recorded)]
        return None

    def _same(self, recorded: Event, replayed: Event) -> bool:
        if type(recorded) is not type(replayed):
            return False
        if isinstance(recorded, Sent) and isinstance(replayed, Sent) and not self._decoder.same(recorded, replayed):
            return False
        ignored = {"t", "content"}
        if self._stamped_late and isinstance(recorded, Sent):
            ignored.add("clock")
        names = [name for name in recorded.__struct_fields__ if name not in ignored]
        return all(getattr(recorded, name) == getattr(replayed, name) for name in names)


def _place_in_first_version(event: AnyEvent) -> int:
    """Return a sort key: in the first version of the journal format, decisions came before messages."""
    match event:
        case Received():
            return 0
        case Sent():
            return 2
        case Settled():
            return 3
        case _:
            return 1
