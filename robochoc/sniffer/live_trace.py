"""The trace of a growing journal, extended piece by piece.

Robots report events in batches, so during a run the journal contains events in the order of their arrival. A trace
accepts this order: its causes are correct, and the page can show it at once. If the complete journal is not sorted by
time, it is read again in the order of time, which all other readers use. The resulting trace has the next generation.
If nobody writes the journal any more, the first trace ends at the first event out of order, and the second one is shown
while it grows.

Entries are discarded after reading, so a file of any length needs only the memory for its trace.
"""

from __future__ import annotations

import time
from array import array
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BufferedReader
from itertools import pairwise
from math import inf
from mmap import ACCESS_READ, mmap
from operator import attrgetter, gt

import msgspec

from robochoc.journal.blocks import MAGIC
from robochoc.journal.events import AnyEvent, Began
from robochoc.journal.journal import Ended, Follower, Header, JournalEntry, JournalError, is_journal
from robochoc.model.outcome import Outcome
from robochoc.sniffer.growing_file import GrowingFile
from robochoc.sniffer.trace import Trace
from robochoc.system.temporary_files import unnamed_file

PIECE_BYTES = 1 << 16
"""The number of bytes read at once, which takes a fraction of a second."""
TEXT = b'{"event":"Journal"'
"""The start of a journal in text form; the binary form starts with `MAGIC`."""
_AT_ONCE_S = 0.5
"""The maximum time for work before the first display, in seconds."""
_EVENTS_AT_ONCE = 5_000
MOST_PENDING = 100_000
"""The maximum number of events that wait in memory for earlier ones."""
_FORSAKEN_S = 30.0
"""The seconds without new entries after which the writer of an unfinished journal counts as ended."""


class LiveTrace:
    """Follows the journal in `file`, one piece per call of `advance`.

    `trace` is the trace so far, or None before the first block. `loaded` is the fraction of the file read so far, from
    0 to 1.
    """

    def __init__(self, file: GrowingFile, age_s: Callable[[], float] = lambda: 0.0) -> None:
        self._age_s = age_s
        self.trace: Trace | None = None
        self._generation = -1
        self._worked_s = 0.0
        self._waits = False
        self.restart(file)

    def restart(self, file: GrowingFile) -> None:
        """Start again with the journal in `file`. The trace has the next generation."""
        self._file = file
        self._follower = Follower(BufferedReader(file))
        self._head = file.head
        self._generation += 1
        self.trace = None
        self._earliest = EarliestTimes()
        self._sorted_only = False
        self._outcome: Outcome | None = None
        self._ordering: Iterator[None] | None = None
        self._done = False

    @property
    def loaded(self) -> float:
        """The fraction of the file that has been read, from 0 to 1."""
        return self._file.end / max(1, self._file.size)

    @property
    def settled(self) -> bool:
        """True if the complete journal has been read and sorted."""
        return self._done

    def events(self) -> Iterator[AnyEvent]:
        """Yield the events of the complete journal, sorted by time within each run."""
        for events in events_by_time(self._file, self._earliest):
            yield from events

    @property
    def _ended(self) -> bool:
        return self._done or self._ordering is not None

    @property
    def presentable(self) -> bool:
        """True if there is something to show. A small journal is first sorted, which is fast."""
        return self.trace is not None and (self._done or self._waits or self._worked_s > _AT_ONCE_S)

    def advance(self) -> bool:
        """Do a little work. Return False if there was nothing to do. Raises `JournalError`, `TraceTooLargeError`."""
        began = time.monotonic()
        done = self._advance()
        self._worked_s += time.monotonic() - began
        self._waits = not done
        return done

    def _advance(self) -> bool:
        if self._file.size < self._file.end or not self._file.head.startswith(self._head):
            self.restart(self._file.again())  # another journal was written into the same file
        if self._ordering is not None:
            if next(self._ordering, self) is self:
                self._ordering, self._done = None, True
            return True
        if self._done:
            continues = self._outcome is None and self._follower.damage is None and self._file.size > self._file.end
            if continues:  # the writer was slow and had not ended
                self.restart(self._file.again())
            return continues
        if self._read() or self._file.widen(PIECE_BYTES):
            return True
        if self._age_s() > _FORSAKEN_S:
            rest, _ = self._follower.finish()
            self._add(rest)
            if not self._ended:
                self._end()
            return True
        return False

    def _read(self) -> bool:
        """Read a few entries. Return whether there was anything to do."""
        if self.trace is None and not _may_begin(self._file.head):
            raise JournalError("the file does not start like a journal")
        lines = self._follower.read(_EVENTS_AT_ONCE)
        self._add(lines)
        if self._follower.damage is None:
            return bool(lines)
        if not self._ended:
            self._end()
        return True

    def _add(self, lines: Iterable[JournalEntry]) -> None:
        events: list[AnyEvent] = []
        for line in lines:
            if isinstance(line, Header):
                self.trace = Trace(line, self._generation)
            elif isinstance(line, Ended):
                self._outcome = line.complete_outcome
            else:
                events.append(line)
        self._earliest.add(events)
        self._sorted_only = self._sorted_only or (self._earliest.disordered and self._age_s() > _FORSAKEN_S)
        if self.trace is not None and not self._sorted_only:  # the follower ensures that the header is the first entry
            self.trace.add(events)
        if self._outcome is not None:
            self._end()

    def _end(self) -> None:
        if self.trace is None:
            raise JournalError("the journal has no header")
        if self._earliest.disordered:  # the trace is not complete until it is sorted
            self._ordering = self._in_order(self.trace.header)
        else:
            self.trace.end(self._outcome, self._follower.damage)
            self._done = True

    def _in_order(self, header: Header) -> Iterator[None]:
        """Build the trace again from the events sorted by time, and yield after each part."""
        trace = Trace(header, self._generation + 1)
        self._generation += 1
        for events in events_by_time(self._file, self._earliest):
            trace.add(events)
            if self._sorted_only:
                self.trace = trace
            yield
        trace.end(self._outcome, self._follower.damage)
        self.trace = trace


def _may_begin(head: bytes) -> bool:
    """Return whether `head` is the start of a journal, or could become one with more bytes."""
    return is_journal(head) or any(form.startswith(head) for form in (MAGIC, TEXT))


def next_entries(follower: Follower, file: GrowingFile, end: int) -> list[JournalEntry]:
    """Return the next entries before `end` from the `follower` of `file`, or an empty list at the end."""
    lines = follower.read(_EVENTS_AT_ONCE)
    while not lines and file.end < end and file.widen(min(PIECE_BYTES, end - file.end)):
        lines = follower.read(_EVENTS_AT_ONCE)
    return lines


def events_by_time(file: GrowingFile, earliest: EarliestTimes | None = None) -> Iterator[list[AnyEvent]]:
    """Yield the events up to the current end of `file`, sorted by time within each run. See `sorted_by_time`."""
    return sorted_by_time(entries_of(file), earliest)


def entries_of(file: GrowingFile) -> Iterator[list[JournalEntry]]:
    """Yield lists of entries up to the current end of `file`."""
    here = file.again()
    follower = Follower(BufferedReader(here))
    while lines := next_entries(follower, here, file.end):
        yield lines


class EarliestTimes:
    """The earliest times of consecutive pieces of a journal's events, from which it follows when events can be yielded.

    `disordered`: whether an event is earlier than its predecessor in the same run.
    """

    def __init__(self) -> None:
        self.disordered = False
        self._last = -inf
        self._count = 0
        self._starts: list[int] = []
        self._minima: list[float] = []
        self._begins: list[bool] = []

    def add(self, events: Sequence[AnyEvent]) -> None:
        """Add the next events."""
        begun = [place for place, event in enumerate(events) if type(event) is Began]
        for first, end in pairwise([0, *begun, len(events)]):
            if first < end:
                self._add_piece([event.t for event in events[first:end]], begins=type(events[first]) is Began)

    def _add_piece(self, times: Sequence[float], *, begins: bool) -> None:
        self._starts.append(self._count)
        self._minima.append(min(times))
        self._begins.append(begins)
        before = [-inf if begins else self._last, *times]
        self.disordered = self.disordered or any(map(gt, before, times))
        self._last = times[-1]
        self._count += len(times)

    def of_rest(self) -> Callable[[int], float]:
        """Return a function from a number of events to the earliest time of the events after these in their run."""
        rest, minima = inf, array("d")
        for minimum, begins in zip(reversed(self._minima), reversed(self._begins), strict=True):
            rest = min(rest, minimum)
            minima.append(rest)
            rest = inf if begins else rest
        minima.reverse()
        return lambda count: minima[bisect_right(self._starts, count) - 1] if count < self._count else inf


def sorted_by_time(
    pieces: Iterable[Iterable[JournalEntry]], earliest: EarliestTimes | None = None
) -> Iterator[list[AnyEvent]]:
    """Yield lists of the events in `pieces`, sorted by time within each run.

    A list may be empty, so that the caller can do other work in between. Events with equal times stay in their order.
    With the `earliest` times of the same events, an event is yielded as soon as no earlier one can follow. Otherwise,
    and for events far out of order, the events of a run are stored in an unnamed temporary file until the run ends;
    only their times and positions are in memory.
    """
    earliest_after = earliest.of_rest() if earliest else None
    count = 0
    stored: _StoredEvents | None = None
    pending: list[AnyEvent] = []
    try:
        for lines in pieces:
            events = [line for line in lines if not isinstance(line, Header | Ended)]
            begun = [place for place, event in enumerate(events) if type(event) is Began]
            for first, end in pairwise([0, *begun, len(events)]):
                if first in begun:
                    yield from stored.sorted() if stored else [sorted(pending, key=_time)]
                    stored, pending = None, []
                pending += events[first:end]
                count += end - first
                if stored is None and (earliest_after is None or len(pending) > MOST_PENDING):
                    stored = _StoredEvents()
                if stored:
                    stored.add(pending)
                    pending = []
            if not stored and earliest_after:
                pending.sort(key=_time)
                ready = bisect_right(pending, earliest_after(count), key=_time)
                yield pending[:ready]
                del pending[:ready]
            else:
                yield []
        yield from stored.sorted() if stored else [sorted(pending, key=_time)]
    finally:
        if stored:
            stored.close()


_time = attrgetter("t")


class _StoredEvents:
    """The packed events of one run, stored in an unnamed temporary file."""

    def __init__(self) -> None:
        self._times = array("d")
        self._ends = array("Q", [0])
        self._file = unnamed_file()
        self._encode = msgspec.msgpack.Encoder().encode
        self._decode = msgspec.msgpack.Decoder(AnyEvent).decode

    def close(self) -> None:
        self._file.close()

    def add(self, events: Iterable[AnyEvent]) -> None:
        for event in events:
            self._times.append(event.t)
            self._ends.append(self._ends[-1] + self._file.write(self._encode(event)))

    def sorted(self) -> Iterator[list[AnyEvent]]:
        """Yield lists of the events sorted by time, then delete the file."""
        import numpy as np  # noqa: PLC0415 - slow, and only needed for sorting

        with self._file as file:
            file.flush()
            if not self._times:
                return
            order = np.argsort(np.frombuffer(self._times), kind="stable")
            with mmap(file.fileno(), 0, access=ACCESS_READ) as packed:
                for first in range(0, len(order), _EVENTS_AT_ONCE):
                    places = order[first : first + _EVENTS_AT_ONCE].tolist()
                    yield [self._decode(packed[self._ends[place] : self._ends[place + 1]]) for place in places]
