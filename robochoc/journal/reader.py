"""Reading journals: those that are whole, those that broke off, and those that are still being written."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
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

MOST_ENTRIES = 30_000_000
"""`read_journal` keeps no more: about 10 million messages, of which each takes a kilobyte of memory."""
LONGEST_LINE = 256 * 2**20
"""No line of the text form is longer, in bytes."""
_PIECE = 2**20
_TEXT = b'{"event":"Journal"'


@dataclass(frozen=True)
class Journal:
    """A journal that has been read. `outcome` is None when the run broke off.

    `damage` says why it ends early, and where: after a crash, or in a file that was altered. None: it is whole. The
    events are those before the damage. `truncated`: only the end is missing, as after a crash; nothing was altered.
    """

    header: Header
    events: tuple[AnyEvent, ...]
    outcome: Outcome | None
    damage: str | None = None
    truncated: bool = False


def is_journal(content: bytes) -> bool:
    """Return whether `content` begins as a journal does, in either form."""
    return content.startswith((MAGIC, _TEXT))


def read_journal(content: bytes) -> Journal:
    """Read what `Recorder` has written, or the lines that `lines_of` gives.

    Within a run, from one `Began` to the next, events are put in the order of their times; those of equal times stay
    in the order in which they came, which is each robot's own (`Improved` were written last, and so come after all of
    their time).

    Raises:
        JournalError: where not even the header can be read.
    """
    with collection_paused():
        follower = Follower(io.BytesIO(content))
        lines = follower.read(MOST_ENTRIES)
        damage = follower.damage
        truncated = False
        if len(lines) > MOST_ENTRIES:
            damage = f"it has more than {MOST_ENTRIES:,} entries, of which the first are read"
            truncated = True
            del lines[MOST_ENTRIES:]
        elif damage is None:
            rest, damage = follower.finish()
            truncated = follower.truncated
            lines += rest
        first, last = lines[0], lines[-1]
        if not isinstance(first, Header):  # the follower has seen to it
            raise JournalError("it has no header")
        outcome = last.whole if isinstance(last, Ended) else None
        events = cast("list[AnyEvent]", lines[1:-1] if outcome is not None else lines[1:])  # so has it here
        return Journal(first, tuple(sorted_by_time(events)), outcome, damage, truncated)


def sorted_by_time(events: Iterable[AnyEvent]) -> Iterator[AnyEvent]:
    """Yield events of a journal, as they were written; each run's come in the order of their times, `Began` first."""
    events = list(events)
    begun = [place for place, event in enumerate(events) if type(event) is Began]
    by_time = attrgetter("t")
    yield from sorted(events[: begun[0] if begun else None], key=by_time)
    for start, end in pairwise([*begun, len(events)]):
        yield events[start]
        yield from sorted(events[start + 1 : end], key=by_time)


def lines_of(journal: Journal) -> Iterator[bytes]:
    """Yield the text form of a journal: one JSON object a line."""
    encode = msgspec.json.Encoder(decimal_format="number").encode
    yield encode(journal.header) + b"\n"
    for event in journal.events:
        yield encode(event) + b"\n"
    if journal.outcome is not None:
        yield encode(Ended.from_outcome(journal.outcome)) + b"\n"


class Follower:
    """Reads a journal, of either form, while it is written.

    `file` is not closed. Where it can be, it is read at an offset of the follower's own (`os.pread`), so it may be one
    that another process appends to through the same descriptor.
    """

    damage: str | None = None
    """The first damage that was found, with its place. None: no damage so far."""
    truncated: bool = False
    """True if the only damage is that the end of the journal is missing."""

    def __init__(self, file: BinaryIO) -> None:
        self._source = _source(file)
        self._form: _Form | None = None
        self._began = self._over = False

    def read(self, most: int | None = None) -> list[JournalEntry]:
        """Return the entries that are complete since the last call, in the file's order. The first is the `Header`.

        What is appended to a file from now on is left to the next call: its writer may be faster than this reader.
        Stops after the block with which there are more than `most`.

        Raises:
            JournalError: if the file is not a journal.
        """
        lines: list[JournalEntry] = []
        self._source.look()
        while self.damage is None and (most is None or len(lines) <= most):
            found = self._next()
            if found is None:
                break
            lines += found
        return lines

    def finish(self) -> tuple[list[JournalEntry], str | None]:
        """Return the remaining entries, and the damage if there is any.

        Nothing more is written. Raises `JournalError`.
        """
        if self._form is None:
            raise JournalError("it is empty")
        lines: list[JournalEntry] = []
        if self.damage is None:
            try:
                lines += self._fitting(self._form.rest())
            except JournalDamagedError as damaged:
                self._break_off(damaged)
        if not self._began:
            raise JournalError("it ends before its header")
        return lines, self.damage

    @property
    def is_over(self) -> bool:
        """Return whether the journal is complete: it holds the outcome of the run."""
        return self._over

    def _next(self) -> Sequence[JournalEntry] | None:
        """Return the next entries; None: there are none yet."""
        while True:
            try:
                if self._form and (lines := self._form.next()) is not None:
                    return self._fitting(lines)
            except JournalDamagedError as damaged:
                self._break_off(damaged)
                return None
            piece = self._source.piece()
            if not piece:
                return None
            if self._form is None:
                self._form = _Blocks() if piece[:1] == MAGIC[:1] else _Text()
            self._form.feed(piece)

    def _break_off(self, damaged: JournalDamagedError) -> None:
        if not self._began:
            raise JournalError(str(damaged)) from damaged
        self.damage = f"{self._place}: more follows the end" if self._over else str(damaged)
        self.truncated = isinstance(damaged, JournalTruncatedError) and not self._over

    @property
    def _place(self) -> str:
        return self._form.place if self._form else ""

    def _fitting(self, lines: Sequence[JournalEntry]) -> Sequence[JournalEntry]:
        """Return `lines`, if they may follow those before: a header, events, an end.

        Raises `JournalError`, `JournalDamagedError`.
        """
        if self._began and not self._over and {*map(type, lines)}.isdisjoint((Header, Ended)):
            return lines  # nearly always, and there may be millions
        began, over = self._began, self._over
        for line in lines:
            if over:
                raise JournalDamagedError(f"{self._place}: more follows the end")
            if isinstance(line, Header) == began:
                if began:
                    raise JournalDamagedError(f"{self._place}: a second header")
                raise JournalError(f"{self._place}: expected the header of a journal")
            if isinstance(line, Header) and line.version not in READ:
                known = " and ".join(map(str, READ))
                raise JournalError(f"its entries are of version {line.version}, and this robochoc reads {known}")
            began, over = True, isinstance(line, Ended)
        self._began, self._over = began, over
        return lines


class _Stream:
    """Reads `file`, which is in memory, or a pipe, piece by piece."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def look(self) -> None:
        """Nobody knows how long it is."""

    def piece(self) -> bytes:
        """Return the next piece; an empty one: there is none yet."""
        return self._file.read(_PIECE)


class _Stored:
    """Reads a file that has a length, piece by piece, up to the end that it had at the last look."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._place = self._end = 0

    def look(self) -> None:
        """Take notice of what has been appended."""
        self._end = os.fstat(self._descriptor).st_size

    def piece(self) -> bytes:
        """Return the next piece; an empty one: there was no more."""
        piece = os.pread(self._descriptor, max(0, min(_PIECE, self._end - self._place)), self._place)
        self._place += len(piece)
        return piece


def _source(file: BinaryIO) -> _Stream | _Stored:
    try:
        descriptor = file.fileno()
        os.pread(descriptor, 0, 0)
    except (OSError, AttributeError):  # it is in memory, or a pipe
        return _Stream(file)
    return _Stored(descriptor)


class _Form(Protocol):
    """One of the two forms of journals."""

    def feed(self, piece: bytes) -> None:
        """Append the next bytes."""

    def next(self) -> Sequence[JournalEntry] | None:
        """Return the next entries; None: they are not whole yet. Raises `JournalError`, `JournalDamagedError`."""

    def rest(self) -> Sequence[JournalEntry]:
        """Return the entries that are complete without further bytes. Raises `JournalError`, `JournalDamagedError`."""

    @property
    def place(self) -> str:
        """Return where the last entries stood."""


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
            raise JournalDamagedError(f"{self.place}: a block holds no entries: {bad}") from bad

    def rest(self) -> Sequence[JournalEntry]:
        if self._unframer.rest:
            raise JournalTruncatedError(self._unframer.rest)
        return ()


class _Text:
    """The text form: one JSON object a line."""

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
            raise JournalDamagedError(f"{self.place}: it is nested too deep") from error
        if not isfinite(entry.t):
            raise JournalDamagedError(f"{self.place}: its time is not a number")
        return (entry,)
