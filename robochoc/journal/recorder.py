"""Writing journals block by block during the run."""

from __future__ import annotations

import errno
import io
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from operator import attrgetter
from pathlib import Path
from threading import Lock

import msgspec
from msgspec import UNSET

from robochoc.journal.blocks import BEGINNING, MAX_BLOCK_BYTES, PREAMBLE, frame_block
from robochoc.journal.columns import columns_of
from robochoc.journal.entries import Ended, Header, JournalEntry
from robochoc.journal.events import AnyEvent, Began, Decided, Given, Heard, Improved, Refused, Sent, actor
from robochoc.journal.team_events import GivenProblemError, TeamReader
from robochoc.model.outcome import Outcome
from robochoc.model.priorities import natural_key
from robochoc.model.problem import INFINITE
from robochoc.system.files import AppendableFile, errors_naming
from robochoc.verification.objective import Objective

ENTRIES_PER_BLOCK_MAX = 8192
"""With four times as many entries, ABT's messages are 5 to 12 % shorter, but a crash loses more entries."""
SPAN_S = 0.25
"""Seconds after which the next event closes a block. A killed run loses at most the events of this time."""

BlockSink = Callable[[bytes], object]
"""A function that receives complete blocks, the first with the beginning of the file. It may raise `OSError`."""


_COST_EVENTS = {Began, Given, Decided, Heard}
"""The kinds of events on which improvements depend."""


class JournalRecorder:
    """An observer that writes a journal of the events to all `sinks` during the run.

    It may be called by several threads. Without sinks the journal is stored in memory, see `content`. With an
    `objective`, `Improved` events are recorded at the end of each run that minimises. A sink that raises `OSError` is
    not used again; the run continues, and the error is in `failures`.
    """

    outcome: Outcome | None = None
    """The outcome of the run, to be set before `close`; None if the run has not ended or was interrupted."""

    def __init__(
        self, header: Header, objective: Callable[[], Objective] | None = None, sinks: Sequence[BlockSink] = ()
    ) -> None:
        self._memory = io.BytesIO()
        self._sinks = [_SinkState(sink) for sink in sinks or (self._memory.write,)]
        self._objective = objective
        self._exact = header.runtime == "simulator"
        self._lock = Lock()
        self._closed = False
        self._pending: list[JournalEntry] = [_encodable(header)]
        self._cost_events: list[AnyEvent] | None = None
        self._given: list[Given] = []
        self._digest = BEGINNING
        self._beginning = PREAMBLE
        self._staged: list[bytes] = []
        self._number = 0
        self._due = 0.0  # the header and the first event are written at once

    def __call__(self, event: AnyEvent) -> None:
        """Record an event. `Began` starts a run; times can be compared only within a run."""
        with self._lock:
            self._pending.append(event)
            if len(self._pending) >= ENTRIES_PER_BLOCK_MAX or time.monotonic() >= self._due:
                self._close_block()

    def flush_if_due(self) -> None:
        """Close the block if it has been open for `SPAN_S`. Must be called at intervals while no events occur."""
        if self._pending and time.monotonic() >= self._due:
            self.flush()

    def flush(self) -> None:
        """Close the block now, unless it is empty."""
        with self._lock:
            self._close_block()

    def close(self) -> None:
        """Write the remaining events and the `outcome`. Later events are not written."""
        with self._lock:
            if self._closed:
                return
            self._close_block()  # also writes blocks that were staged before an interrupt
            if self._cost_events:
                self._pending, self._cost_events = [*self._improvements(self._cost_events, self._given)], None
            if self.outcome is not None:
                self._pending.append(Ended.from_outcome(self.outcome))
            self._close_block()
            self._closed = True

    @property
    def is_empty(self) -> bool:
        """True if no event was recorded. Then no file is written, and an existing file is kept."""
        return self._number == 0 and len(self._pending) <= 1

    def content(self) -> bytes:
        """Close the recorder, and return the journal if it was stored in memory."""
        self.close()
        return self._memory.getvalue()

    @property
    def failures(self) -> list[OSError]:
        """The errors of sinks that are no longer used."""
        return [sink.failure for sink in self._sinks if sink.failure]

    def _close_block(self) -> None:
        """Create blocks from the pending entries, and write the blocks to the sinks.

        The exception of a signal may occur between any two calls. So each change of state is a single statement
        without calls, and unfinished work is completed the next time.
        """
        self._pass_on()
        if not self._pending or self._closed:
            return
        if all(sink.failure for sink in self._sinks):
            self._pending = []
            return
        lines, cost_events, given = self._with_improvements(self._pending)
        blocks, digest = self._packed(lines)
        due = time.monotonic() + SPAN_S
        self._pending, self._cost_events, self._given, self._digest, self._staged, self._due = (
            [], cost_events, given, digest, blocks, due,
        )  # fmt: skip
        self._pass_on()

    def _pass_on(self) -> None:
        for sink in self._sinks:
            sink.write(self._staged, self._number)
        number = self._number + len(self._staged)
        self._staged, self._number = [], number

    def _with_improvements(
        self, pending: list[JournalEntry]
    ) -> tuple[Sequence[JournalEntry], list[AnyEvent] | None, list[Given]]:
        """Return `pending` with the improvements of completed runs, the cost events of the open run, and all `Given`.

        Improvements depend on the order of events, which is known when a run is complete.
        """
        if self._objective is None:
            return pending, None, []
        cost_events = None if self._cost_events is None else [*self._cost_events]
        given = [*self._given]
        rare = [entry for entry in pending if type(entry) in _COST_EVENTS]
        if not any(isinstance(entry, Began) for entry in rare):  # the usual case
            given += (entry for entry in rare if isinstance(entry, Given))
            if cost_events is not None:
                cost_events += (entry for entry in rare if isinstance(entry, Decided | Heard))
            return pending, cost_events, given
        lines: list[JournalEntry] = []
        for entry in pending:
            match entry:
                case Began():
                    lines += self._improvements(cost_events or (), given)
                    start = [entry] if entry.upper_bound is not UNSET else []
                    cost_events = [*start] if entry.minimises is True else None
                case Given():
                    given.append(entry)
                case Decided() | Heard() if cost_events is not None:
                    cost_events.append(entry)
                case _:
                    pass
            lines.append(entry)
        return lines, cost_events, given

    def _improvements(self, cost_events: Sequence[AnyEvent], given: Sequence[Given]) -> Iterator[Improved]:
        if self._objective is None or not cost_events:
            return
        has_incumbents = any(isinstance(event, Heard) for event in cost_events)
        events = [*(given if has_incumbents else ()), *sorted(cost_events, key=attrgetter("t"))]
        yield from (event for event in improvements(events, self._objective()) if isinstance(event, Improved))

    def _packed(self, lines: Sequence[JournalEntry]) -> tuple[list[bytes], bytes]:
        """Return blocks of `lines`, and the checksum of the last block."""
        blocks, digest = [], self._digest
        for content in _contents(lines, exact=self._exact):
            block, digest = frame_block(content, digest)
            blocks.append(block)
        if self._digest is BEGINNING:
            blocks[0] = PREAMBLE + blocks[0]
        return blocks, digest


class JournalFile:
    """A file used as a sink. The first block replaces an existing file; further blocks are appended.

    Devices, pipes, and standard streams are written directly, as by `write_atomically`. Errors contain the file's name.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: AppendableFile | None = None
        self._closed = False

    def write(self, block: bytes) -> None:
        """Write the next block. Raises `OSError`."""
        if self._closed:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF), str(self._path))
        with errors_naming(self._path):
            if self._file is None:
                self._file = AppendableFile(self._path, block)
            else:
                self._file.append(block)

    def close(self) -> None:
        """Close the file. Raises `OSError` if the file is a pipe and its reader did not read all of it."""
        file, self._file, self._closed = self._file, None, True
        if file:
            with errors_naming(self._path):
                file.close()


@contextmanager
def recorded(
    path: Path | None,
    header: Header,
    objective: Callable[[], Objective] | None = None,
    sinks: Sequence[BlockSink] = (),
    on_error: Callable[[JournalRecorder], None] | None = None,
) -> Iterator[JournalRecorder]:
    """Provide a recorder that writes to a file and to other sinks during the block, and is closed at its end.

    If a sink cannot be written, the run continues; the errors are in `failures` of the recorder. A block that fails
    before any event, such as a rejected run, does not overwrite an older file.

    Args:
        path: The file, if there is one.
        header: The header of the journal.
        objective: See `JournalRecorder`.
        sinks: Other sinks.
        on_error: Called with the closed recorder if the block raises an exception.

    Raises:
        OSError: at the end, if the file is a pipe and its reader did not read all of it.
    """
    file = JournalFile(path) if path else None
    recorder = JournalRecorder(header, objective, [file.write, *sinks] if file else sinks)
    try:
        yield recorder
    except BaseException:
        if not recorder.is_empty:
            recorder.close()
        if on_error:
            on_error(recorder)
        if file:
            with suppress(OSError):  # the error that ended the block is more important
                file.close()
        raise
    try:
        recorder.close()
    finally:
        if file:
            file.close()


class _SinkState:
    """A sink, and the number of blocks written to it."""

    failure: OSError | None = None

    def __init__(self, sink: BlockSink) -> None:
        self._sink = sink
        self._written = 0

    def write(self, blocks: Sequence[bytes], number: int) -> None:
        """Write those of `blocks` that the sink has not received. The first one has this `number` in the journal."""
        while not self.failure and self._written < number + len(blocks):
            try:
                self._sink(blocks[self._written - number])
                self._written += 1
            except OSError as error:
                self.failure = error


def improvements(events: Iterable[AnyEvent], objective: Objective) -> Iterator[AnyEvent]:  # noqa: C901 - a case for each event
    """Yield `events`, with an `Improved` after each event that makes the assignment cheaper than all earlier ones.

    A `Began` with a start whose cost is known counts as such an event.

    `objective` may be the one of the team's files: `Given` events define the variables that robots show.
    """
    best = INFINITE
    reader = TeamReader()
    now: Mapping[str, Mapping[str, int]] | None
    decided: dict[str, dict[str, int]] = {}
    current: dict[str, int] | None = None  # the values in `decided`; None: to be computed
    names: list[str] = []
    several = list(events)
    for event, following in zip(several, [*several[1:], None], strict=True):
        yield event
        match event:
            case Decided():
                if current is not None and [*decided.get(event.robot, ())] == [*event.assignment]:
                    current.update(event.assignment)
                else:
                    current = None
                decided[event.robot] = event.assignment
                objective.change({event.robot: event.assignment})
                if objective.in_step and isinstance(following, Decided) and following.t == event.t:
                    continue
                cost, now = objective.cost, decided
            case Heard():
                cost, now = event.cost, objective.shown(event.values)
            case Given():
                objective.interfaces = interfaces_given(reader, event)
                continue
            case Began(start=dict() as start, upper_bound=int() | float() as cost) if cost < best:
                best = cost
                known = {name: value for name, value in start.items() if value is not None}
                yield Improved(t=event.t, cost=objective.in_user_units(best), assignment=known)
                continue
            case _:
                continue
        if cost < best and now is not None:
            best = cost
            values = current if now is decided else None
            if values is None:
                if now.keys() != set(names):
                    names = sorted(now, key=natural_key)
                values = {name: value for robot in names for name, value in now[robot].items()}
                current = values if now is decided else current
            yield Improved(t=event.t, cost=objective.in_user_units(best), assignment=values.copy())


def interfaces_given(reader: TeamReader, given: Given) -> dict[str, tuple[str, ...]]:
    """Return the variables that the robots in `given` show; empty if `given` cannot be read."""
    try:
        return {robot.name: robot.interface for robot in reader.team(given).robots}
    except GivenProblemError:
        return {}


def _encodable(header: Header) -> Header:
    """Return `header` with a team name that can be encoded: the name of a folder may be invalid text."""
    return msgspec.structs.replace(header, team=header.team.encode(errors="replace").decode())


def _contents(lines: Sequence[JournalEntry], *, exact: bool) -> Iterator[bytes]:
    """Yield the contents of one or more blocks with `lines`."""
    try:
        content = columns_of(lines, exact=exact)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        why = str(error)
    else:
        if len(content) <= MAX_BLOCK_BYTES:
            yield content
            return
        why = f"it has {len(content):,} bytes, more than {MAX_BLOCK_BYTES:,}"
    if len(lines) == 1:
        with suppress(TypeError, ValueError, OverflowError, RecursionError):
            yield columns_of([_replacement(lines[0], why)], exact=exact)
        return
    middle = len(lines) // 2
    yield from _contents(lines[:middle], exact=exact)
    yield from _contents(lines[middle:], exact=exact)


def _replacement(line: JournalEntry, why: str) -> JournalEntry:
    """Return a replacement for an entry that cannot be encoded. Raises `ValueError` if no replacement is possible."""
    match line:
        case Sent():
            return msgspec.structs.replace(line, content={"left out": why})
        case Given():
            return msgspec.structs.replace(line, robots={}, why=why)
        case Header() | Ended():
            raise ValueError(why)
        case _:
            robot = actor(line)
    if robot is None:
        raise ValueError(why)
    return Refused(t=line.t, who=robot, what=f"have {type(line).__name__} written down", why=why)
