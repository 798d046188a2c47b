"""Reading journals that are complete, incomplete, or still being written."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import isfinite
from operator import attrgetter
from typing import BinaryIO, Protocol, cast

import msgspec

from robochoc.journal.blocks import MAGIC, BlockReader, JournalDamagedError, JournalTruncatedError
from robochoc.journal.columns import BlockError, entries_of
from robochoc.journal.entries import READ, Ended, Header, JournalEntry, JournalError
from robochoc.journal.events import AnyEvent, Began
from robochoc.model.outcome import Outcome
from robochoc.system.decode_errors import describe_decode_error
from robochoc.system.garbage import collection_paused
from robochoc.system.lazy_dataclass import dataclass

ENTRIES_MAX = 30_000_000
"""The maximum number of entries that `read_journal` reads: about 10 million messages with a kilobyte of memory each."""
LONGEST_LINE = 256 * 2**20
"""The longest line of the text form, in bytes."""
_PIECE = 2**20
_TEXT = b'{"event":"Journal"'


@dataclass(frozen=True)
class Journal:
    """The content of a journal. `outcome` is None if the run was interrupted.

    `damage` is the reason and the position of a premature end, after a crash or in an altered file; None if the journal
    is complete. The events are those before the damage. `truncated`: only the end is missing, for example after a
    crash.
    """

    header: Header
    events: tuple[AnyEvent, ...]
    outcome: Outcome | None
    damage: str | None = None
    truncated: bool = False


def is_journal(content: bytes) -> bool:
    """Return whether `content` begins like one of the two forms of journals."""
    return content.startswith((MAGIC, _TEXT))


def read_journal(content: bytes) -> Journal:
    """Read the output of `JournalRecorder`, or the lines of `lines_of`.

    Within a run, from one `Began` to the next, events are sorted by their times. Events with equal times stay in the
    recorded order, which preserves each robot's order (`Improved` events, recorded last, follow all of their time).

    Raises:
        JournalError: if the header cannot be read.
    """
    with collection_paused():
        follower = Follower(io.BytesIO(content))
        lines = follower.read(ENTRIES_MAX)
        damage = follower.damage
        truncated = False
        if len(lines) > ENTRIES_MAX:
            damage = f"it has more than {ENTRIES_MAX:,} entries; only the first ones are read"
            truncated = True
            del lines[ENTRIES_MAX:]
        elif damage is None:
            rest, damage = follower.finish()
            truncated = follower.truncated
            lines += rest
        first, last = lines[0], lines[-1]
        if not isinstance(first, Header):  # checked by the follower
            raise JournalError("it has no header")
        outcome = last.complete_outcome if isinstance(last, Ended) else None
        events = cast("list[AnyEvent]", lines[1:-1] if outcome is not None else lines[1:])  # checked as well
        return Journal(first, tuple(sorted_by_time(events)), outcome, damage, truncated)


def sorted_by_time(events: Iterable[AnyEvent]) -> Iterator[AnyEvent]:
    """Yield the events in a journal, sorted by time within each run. A run begins with its `Began`."""
    events = list(events)
    begun = [place for place, event in enumerate(events) if type(event) is Began]
    by_time = attrgetter("t")
    yield from sorted(events[: begun[0] if begun else None], key=by_time)
    for start, end in pairwise([*begun, len(events)]):
        yield events[start]
        yield from sorted(events[start + 1 : end], key=by_time)


def lines_of(journal: Journal) -> Iterator[bytes]:
    """Yield the text form of a journal: one JSON object per line."""
    return text_lines(journal.header, journal.events, journal.outcome)


def text_lines(header: Header, events: Iterable[AnyEvent], outcome: Outcome | None) -> Iterator[bytes]:
    """Yield the text form of a journal with these entries."""
    encode = msgspec.json.Encoder(decimal_format="number").encode
    yield encode(header) + b"\n"
    for event in events:
        yield encode(event) + b"\n"
    if outcome is not None:
        yield encode(Ended.from_outcome(outcome)) + b"\n"


class Follower:
    """Reads a journal, of either form, while it is written.

    `file` is not closed. If possible, it is read at a separate offset (`os.pread`), so that another process can append
    to it through the same descriptor.
    """

    damage: str | None = None
    """The first damage and its position, or None if no damage was found so far."""
    truncated: bool = False
    """True if the only damage is that the end of the journal is missing."""

    def __init__(self, file: BinaryIO) -> None:
        self._source = _source(file)
        self._format: _Format | None = None
        self._has_header = self._is_over = False

    def read(self, most: int | None = None) -> list[JournalEntry]:
        """Return the entries completed since the last call, in file order. The first entry is the `Header`.

        Bytes appended during the call are left to the next call, because the writer may be faster than this reader.
        Reading stops after the block in which the number of entries exceeds `most`.

        Raises:
            JournalError: if the file is not a journal.
        """
        lines: list[JournalEntry] = []
        self._source.update_end()
        while self.damage is None and (most is None or len(lines) <= most):
            found = self._next()
            if found is None:
                break
            lines += found
        return lines

    def finish(self) -> tuple[list[JournalEntry], str | None]:
        """Return the remaining entries in a file that is no longer written, and the damage, if any.

        Raises `JournalError`.
        """
        if self._format is None:
            raise JournalError("it is empty")
        lines: list[JournalEntry] = []
        if self.damage is None:
            try:
                lines += self._checked(self._format.rest())
            except JournalDamagedError as damaged:
                self._stop_at(damaged)
        if not self._has_header:
            raise JournalError("it ends before its header")
        return lines, self.damage

    @property
    def is_over(self) -> bool:
        """True if the journal is complete, that is, contains the outcome of the run."""
        return self._is_over

    def _next(self) -> Sequence[JournalEntry] | None:
        """Return the next entries, or None if there are no entries yet."""
        while True:
            try:
                if self._format and (lines := self._format.next()) is not None:
                    return self._checked(lines)
            except JournalDamagedError as damaged:
                self._stop_at(damaged)
                return None
            piece = self._source.piece()
            if not piece:
                return None
            if self._format is None:
                self._format = _Blocks() if piece[:1] == MAGIC[:1] else _Text()
            self._format.feed(piece)

    def _stop_at(self, damaged: JournalDamagedError) -> None:
        if not self._has_header:
            raise JournalError(str(damaged)) from damaged
        self.damage = f"{self._place}: there are entries after the end" if self._is_over else str(damaged)
        self.truncated = isinstance(damaged, JournalTruncatedError) and not self._is_over

    @property
    def _place(self) -> str:
        return self._format.place if self._format else ""

    def _checked(self, lines: Sequence[JournalEntry]) -> Sequence[JournalEntry]:
        """Return `lines` after a check of their order: a header, events, an end.

        Raises `JournalError`, `JournalDamagedError`.
        """
        if self._has_header and not self._is_over and {*map(type, lines)}.isdisjoint((Header, Ended)):
            return lines  # the usual case, for up to millions of lines
        has_header, is_over = self._has_header, self._is_over
        for line in lines:
            if is_over:
                raise JournalDamagedError(f"{self._place}: there are entries after the end")
            if isinstance(line, Header) == has_header:
                if has_header:
                    raise JournalDamagedError(f"{self._place}: there is a second header")
                raise JournalError(f"{self._place}: expected the header of a journal")
            if isinstance(line, Header) and line.version not in READ:
                known = " and ".join(map(str, READ))
                raise JournalError(f"its entries have the version {line.version}, but this robochoc reads {known}")
            has_header, is_over = True, isinstance(line, Ended)
        self._has_header, self._is_over = has_header, is_over
        return lines


class _Stream:
    """Reads `file`, a pipe or bytes in memory, piece by piece."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def update_end(self) -> None:
        """Do nothing: the length is unknown."""

    def piece(self) -> bytes:
        """Return the next piece; empty if there is no piece yet."""
        return self._file.read(_PIECE)


class _Stored:
    """Reads a file of known length piece by piece, up to its end at the last `update_end`."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._place = self._end = 0

    def update_end(self) -> None:
        """Include the bytes that were appended so far."""
        self._end = os.fstat(self._descriptor).st_size

    def piece(self) -> bytes:
        """Return the next piece; empty at the end."""
        piece = os.pread(self._descriptor, max(0, min(_PIECE, self._end - self._place)), self._place)
        self._place += len(piece)
        return piece


def _source(file: BinaryIO) -> _Stream | _Stored:
    try:
        descriptor = file.fileno()
        os.pread(descriptor, 0, 0)
    except (OSError, AttributeError):  # in memory, or a pipe
        return _Stream(file)
    return _Stored(descriptor)


class _Format(Protocol):
    """A reader of one of the two forms of journals."""

    def feed(self, piece: bytes) -> None:
        """Append the next bytes."""

    def next(self) -> Sequence[JournalEntry] | None:
        """Return the next entries, or None if they are incomplete. Raises `JournalError`, `JournalDamagedError`."""

    def rest(self) -> Sequence[JournalEntry]:
        """Return the entries that are complete without further bytes. Raises `JournalError`, `JournalDamagedError`."""

    @property
    def place(self) -> str:
        """The position of the last entries."""


class _Blocks:
    """The binary form."""

    def __init__(self) -> None:
        self._unframer = BlockReader()
        self.feed = self._unframer.feed
        self.place = ""

    def next(self) -> Sequence[JournalEntry] | None:
        self.place = self._unframer.place
        content = self._unframer.next()
        if content is None:
            return None
        try:
            return entries_of(content)
        except BlockError as bad:
            raise JournalDamagedError(f"{self.place}: a block has no valid entries: {bad}") from bad

    def rest(self) -> Sequence[JournalEntry]:
        if self._unframer.rest:
            raise JournalTruncatedError(self._unframer.rest)
        return ()


class _Text:
    """The text form: one JSON object per line."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._searched = self._lines = 0
        self._decode = msgspec.json.Decoder(JournalEntry).decode

    @property
    def place(self) -> str:
        return f"line {self._lines}"

    def feed(self, piece: bytes) -> None:
        self._buffer += piece

    def next(self) -> Sequence[JournalEntry] | None:
        end = self._buffer.find(b"\n", self._searched)
        if end < 0:
            self._searched = len(self._buffer)
            if self._searched > LONGEST_LINE:
                raise JournalDamagedError(f"line {self._lines + 1}: it is longer than {LONGEST_LINE:,} bytes")
            return None
        line = self._buffer[:end]
        del self._buffer[: end + 1]
        self._searched = 0
        return self._decoded(line)

    def rest(self) -> Sequence[JournalEntry]:
        try:
            return self._decoded(self._buffer) if self._buffer else ()
        except JournalDamagedError as cut:
            raise JournalTruncatedError(str(cut)) from cut

    def _decoded(self, line: bytearray) -> Sequence[JournalEntry]:
        self._lines += 1
        try:
            entry = self._decode(line)
        except UnicodeDecodeError as error:
            raise JournalDamagedError(f"{self.place}: it is not UTF-8") from error
        except msgspec.MsgspecError as error:
            raise JournalDamagedError(f"{self.place}: {describe_decode_error(error, None)}") from error
        except RecursionError as error:
            raise JournalDamagedError(f"{self.place}: it is nested too deeply") from error
        if not isfinite(entry.t):
            raise JournalDamagedError(f"{self.place}: its time is not a number")
        return (entry,)
