"""The journal: all events of a run, in a compact file that can be read while it is written, and after a crash.

The first entry is a header, the last entry is the outcome. Statistics, pictures and golden tests are computed from the
journal, independently of the robots. docs/guides/journal.md describes the file. Its text form has one JSON object per
line.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from robochoc.journal.entries import VERSION, Ended, Header, JournalEntry, JournalError
from robochoc.journal.events import AnyEvent, Began, Sent, Settled
from robochoc.journal.reader import Follower, Journal, is_journal, lines_of, read_journal, sorted_by_time
from robochoc.journal.recorder import BlockSink, JournalFile, JournalRecorder, improvements
from robochoc.model.outcome import Metrics

__all__ = [
    "VERSION",
    "BlockSink",
    "Ended",
    "Follower",
    "Header",
    "Journal",
    "JournalEntry",
    "JournalError",
    "JournalFile",
    "JournalRecorder",
    "improvements",
    "is_journal",
    "lines_of",
    "metrics_of",
    "read_journal",
    "sorted_by_time",
]


def metrics_of(events: Iterable[AnyEvent]) -> Metrics:
    """Return the counts of messages, bytes, NCCCs and checks in the events. The wall-clock time is unknown: 0."""
    total = Metrics()
    messages: Counter[str] = Counter()
    size = largest = ncccs = 0
    checks: dict[str, int] = {}

    def run() -> Metrics:
        return Metrics(dict(messages), size, ncccs, sum(checks.values()), largest=largest)

    for event in events:
        match event:
            case Began():
                total += run()
                messages.clear()
                checks.clear()
                size = largest = ncccs = 0
            case Sent():
                messages[event.type] += 1
                size += event.bytes
                largest = max(largest, event.bytes)
            case Settled():
                ncccs = max(ncccs, event.clock)
                checks[event.robot] = event.checks
            case _:
                pass
    return total + run()
