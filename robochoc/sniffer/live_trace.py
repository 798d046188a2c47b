"""The trace of a growing journal, extended piece by piece.

Robots report events in batches, so during a run the journal contains events in the order of their arrival. A trace
accepts this order: its causes are correct, and the page can show it at once. If the complete journal is not sorted by
time, it is read again in the order of time, which all other readers use. The resulting trace has the next generation.

Entries are discarded after reading, so a file of any length needs only the memory for its trace.
"""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable, Iterable, Iterator
from io import BufferedReader
from mmap import ACCESS_READ, mmap

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
        self._last = float("-inf")
        self._disordered = False
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
            match line:
                case Header():
                    self.trace = Trace(line, self._generation)
                case Ended():
                    self._outcome = line.complete_outcome
                case _:
                    if line.t < self._last and not isinstance(line, Began):
                        self._disordered = True
                    self._last = line.t
                    events.append(line)
        if self.trace is not None:  # the follower ensures that the header is the first entry
            self.trace.add(events)
        if self._outcome is not None:
            self._end()

    def _end(self) -> None:
        if self.trace is None:
            raise JournalError("the journal has no header")
        if self._disordered:  # the trace is not complete until it is sorted
            self._ordering = self._in_order(self.trace.header)
        else:
            self.trace.end(self._outcome, self._follower.damage)
            self._done = True

    def _in_order(self, header: Header) -> Iterator[None]:
        """Build the trace again from the events sorted by time, and yield after each part."""
        trace = Trace(header, self._generation + 1)
        for events in events_by_time(self._file):
            trace.add(events)
            yield
        trace.end(self._outcome, self._follower.damage)
        self._generation += 1
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


def events_by_time(file: GrowingFile) -> Iterator[list[AnyEvent]]:
    """Yield the events up to the current end of `file`, sorted by time within each run. See `sorted_by_time`."""
    return sorted_by_time(entries_of(file))


def entries_of(file: GrowingFile) -> Iterator[list[JournalEntry]]:
    """Yield lists of entries up to the current end of `file`."""
    here = file.again()
    follower = Follower(BufferedReader(here))
    while lines := next_entries(follower, here, file.end):
        yield lines


def sorted_by_time(pieces: Iterable[Iterable[JournalEntry]]) -> Iterator[list[AnyEvent]]:
    """Yield lists of the events in `pieces`, sorted by time within each run.

    A list may be empty, so that the caller can do other work in between. Events with equal times stay in their order.
    The events of a run are stored in an unnamed temporary file until the run ends; only their times and positions are
    in memory.
    """
    stored = _StoredEvents()
    try:
        for lines in pieces:
            for line in lines:
                if isinstance(line, Header | Ended):
                    continue
                if isinstance(line, Began):
                    yield from stored.sorted()
                    stored = _StoredEvents()
                stored.add(line)
            yield []
        yield from stored.sorted()
    finally:
        stored.close()


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

    def add(self, event: AnyEvent) -> None:
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
