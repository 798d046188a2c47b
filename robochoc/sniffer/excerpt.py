"""An excerpt of a journal, as a journal with the selected messages only."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

from robochoc.journal.events import AnyEvent, Began, Received, Sent
from robochoc.journal.journal import Journal
from robochoc.sniffer.trace import Trace


def excerpt_of(journal: Journal, trace: Trace, messages: Sequence[int]) -> Journal:
    """Return `journal`, whose trace is `trace`, reduced to `messages`: other sends and receipts are left out.

    All other events are kept.
    """
    return replace(journal, events=tuple(_meant(journal.events, trace, set(messages))))


def _meant(events: Sequence[AnyEvent], trace: Trace, messages: set[int]) -> Iterator[AnyEvent]:
    """Yield the events without other messages.

    A sender's messages in a run have ascending numbers, and each receiver receives them in that order.
    """
    of = trace.messages
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
