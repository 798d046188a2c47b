"""Selects messages in a trace by robot, type, number and conversation, and extracts them from a journal."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence

from robochoc.journal.events import AnyEvent, Began, Received, Sent
from robochoc.sniffer.patterns import matching, unmatched
from robochoc.sniffer.trace import Trace
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass


def excerpt_of(events: Iterable[AnyEvent], trace: Trace, numbers: Sequence[int]) -> Iterator[AnyEvent]:
    """Yield the events of `trace`, without those of messages that are not in `numbers`.

    In a run, a sender's messages have ascending numbers, and each receiver receives them in this order.
    """
    messages, of = {*numbers}, trace.messages
    spoken: dict[tuple[int, str], list[int]] = defaultdict(list)
    for message, (run, sender) in enumerate(zip(of.run, of.sender, strict=True)):
        spoken[run, trace.robots[sender]].append(message)
    said: dict[tuple[int, str], int] = defaultdict(int)
    in_transit: dict[tuple[str, str], list[bool]] = defaultdict(list)
    taken: dict[tuple[str, str], int] = defaultdict(int)
    run = -1
    for event in events:
        match event:
            case Began():
                run += 1
                in_transit.clear()
                taken.clear()
                yield event
            case Sent():
                key = max(run, 0), event.sender
                place = said[key]
                said[key] += 1
                meant = place < len(spoken[key]) and spoken[key][place] in messages
                in_transit[event.sender, event.receiver].append(meant)
                if meant:
                    yield event
            case Received():
                channel = event.sender, event.receiver
                place = taken[channel]
                taken[channel] += 1
                if place < len(in_transit[channel]) and in_transit[channel][place]:
                    yield event
            case _:
                yield event


class NothingSelectedError(RobochocError, ValueError):
    """A part of the selection matches nothing in the journal. The message lists the existing names or numbers."""


@dataclass(frozen=True)
class Selection:
    """A selection of messages. Both the sender and the receiver must match `robots`, and the type `kinds`.

    `robots` and `kinds` are names or patterns. `first` and `last` are message numbers from 0, both included. `run` is
    the number of a run (a conversation) from 1. Empty parts and None do not restrict the selection.
    """

    robots: Sequence[str] = ()
    kinds: Sequence[str] = ()
    first: int = 0
    last: int | None = None
    run: int | None = None

    def numbers_in(self, trace: Trace) -> range | list[int]:
        """Return the numbers of the selected messages in order. Raises `NothingSelectedError`."""
        count = len(trace.messages.t)
        numbers = range(min(self.first, count), count if self.last is None else min(self.last + 1, count))
        if count and not numbers:
            upto = "on" if self.last is None else f"to {self.last}"
            raise NothingSelectedError(f"there is no message from {self.first} {upto}; messages are 0 to {count - 1}")
        if not (self.robots or self.kinds or self.run is not None):
            return numbers
        robots = _places(trace.robots, self.robots, "robot")
        kinds = _places(trace.kinds, self.kinds, "type of message")
        if self.run is not None and not 1 <= self.run <= len(trace.runs):
            raise NothingSelectedError(f"there is no conversation {self.run}; conversations are 1 to {len(trace.runs)}")
        of = trace.messages
        return [
            number
            for number in numbers
            if of.sender[number] in robots
            and of.receiver[number] in robots
            and of.kind[number] in kinds
            and (self.run is None or of.run[number] == self.run - 1)
        ]


def _places(names: Sequence[str], patterns: Sequence[str], what: str) -> set[int]:
    if not patterns:
        return set(range(len(names)))
    lost = unmatched(names, patterns)
    if lost:
        known = ", ".join(sorted(names)[:12]) + (", ..." if len(names) > 12 else "")  # noqa: PLR2004 - a line's worth
        raise NothingSelectedError(f"no {what} matches {lost[0]!r}; known names: {known or 'none'}")
    meant = set(matching(names, patterns))
    return {place for place, name in enumerate(names) if name in meant}
