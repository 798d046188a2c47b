"""Writing journals: block after block, while the run goes on."""

from __future__ import annotations

import errno
import io
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from operator import attrgetter
from pathlib import Path
from threading import Lock

import msgspec

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

MOST_IN_A_BLOCK = 8192
"""Entries; with four times as many ABT's messages are packed 5 to 12 % better, but a crash takes more with it."""
SPAN_S = 0.25
"""Seconds after which the next event closes a block. A killed run loses at most the events of this time."""

BlockSink = Callable[[bytes], object]
"""Takes one whole block after the other; the first time the beginning of the file, too. It may raise `OSError`."""


class JournalRecorder:
    """An observer that writes a journal of the events, while they come, to all `sinks`.

    It may be called by several threads. Without sinks the journal is kept in memory: `content`. With an `objective`,
    it notes, at the end of each run that minimises, when what the robots had decided was the cheapest so far. A sink
    that raises `OSError` is asked no more; the run goes on, and the error stands in `failures`.
    """

    outcome: Outcome | None = None
    """The outcome of the run. Set it before `close`. None: the run is not over, or it broke off."""

    def __init__(
        self, header: Header, objective: Callable[[], Objective] | None = None, sinks: Sequence[BlockSink] = ()
    ) -> None:
        self._memory = io.BytesIO()
        self._outlets = [_Outlet(sink) for sink in sinks or (self._memory.write,)]
        self._objective = objective
        self._exact = header.runtime == "simulator"
        self._lock = Lock()
        self._closed = False
        self._pending: list[JournalEntry] = [_readable(header)]
        self._weighed: list[AnyEvent] | None = None
        self._given: list[Given] = []
        self._digest = BEGINNING
        self._beginning = PREAMBLE
        self._staged: list[bytes] = []
        self._number = 0
        self._due = 0.0  # so the first event is written at once, and the header with it

    def __call__(self, event: AnyEvent) -> None:
        """Take in one event. `Began` opens a run; times are compared within a run only."""
        with self._lock:
            self._pending.append(event)
            if len(self._pending) >= MOST_IN_A_BLOCK or time.monotonic() >= self._due:
                self._close_block()

    def flush_if_due(self) -> None:
        """Close the block if it has been open for long. Call this from time to time while no event occurs."""
        if self._pending and time.monotonic() >= self._due:
            self.flush()

    def flush(self) -> None:
        """Close the block now, if there is anything in it."""
        with self._lock:
            self._close_block()

    def close(self) -> None:
        """Write what is left, and the `outcome`. Later events are not written."""
        with self._lock:
            if self._closed:
                return
            self._close_block()  # also what was staged when an interrupt came
            if self._weighed:
                self._pending, self._weighed = [*self._improved(self._weighed, self._given)], None
            if self.outcome is not None:
                self._pending.append(Ended.from_outcome(self.outcome))
            self._close_block()
            self._closed = True

    @property
    def is_empty(self) -> bool:
        """Return whether no event was recorded. Then no file is written, and an old file stays."""
        return self._number == 0 and len(self._pending) <= 1

    def content(self) -> bytes:
        """Close, and return the journal, where it was kept in memory."""
        self.close()
        return self._memory.getvalue()

    @property
    def failures(self) -> list[OSError]:
        """Return why sinks are asked no more."""
        return [outlet.failure for outlet in self._outlets if outlet.failure]

    def _close_block(self) -> None:
        """Make blocks of what is pending, and pass them on.

        An exception of a signal's may come between any two calls. So each change of state is a single statement that
        calls nothing, and what was begun is ended the next time.
        """
        self._pass_on()
        if not self._pending or self._closed:
            return
        if all(outlet.failure for outlet in self._outlets):
            self._pending = []
            return
        lines, weighed, given = self._told(self._pending)
        blocks, digest = self._packed(lines)
        due = time.monotonic() + SPAN_S
        self._pending, self._weighed, self._given, self._digest, self._staged, self._due = (
            [], weighed, given, digest, blocks, due,
        )  # fmt: skip
        self._pass_on()

    def _pass_on(self) -> None:
        for outlet in self._outlets:
            outlet.take(self._staged, self._number)
        number = self._number + len(self._staged)
        self._staged, self._number = [], number

    def _told(self, pending: list[JournalEntry]) -> tuple[Sequence[JournalEntry], list[AnyEvent] | None, list[Given]]:
        """Return `pending` with improvements where a run ends, and the events and problems of the open run.

        The third is all that robots have been given.

        Improvements follow from the order of events, which is known once all of a run have come.
        """
        if self._objective is None:
            return pending, None, []
        weighed = None if self._weighed is None else [*self._weighed]
        given = [*self._given]
        lines: list[JournalEntry] = []
        for entry in pending:
            match entry:
                case Began():
                    lines += self._improved(weighed or (), given)
                    weighed = [] if entry.minimises is True else None
                case Given():
                    given.append(entry)
                case Decided() | Heard() if weighed is not None:
                    weighed.append(entry)
                case _:
                    pass
            lines.append(entry)
        return lines, weighed, given

    def _improved(self, weighed: Sequence[AnyEvent], given: Sequence[Given]) -> Iterator[Improved]:
        if self._objective is None or not weighed:
            return
        heard = any(isinstance(event, Heard) for event in weighed)
        events = [*(given if heard else ()), *sorted(weighed, key=attrgetter("t"))]
        yield from (event for event in improvements(events, self._objective()) if isinstance(event, Improved))

    def _packed(self, lines: Sequence[JournalEntry]) -> tuple[list[bytes], bytes]:
        """Return blocks of `lines`, and the checksum of the last."""
        blocks, digest = [], self._digest
        for content in _contents(lines, exact=self._exact):
            block, digest = frame_block(content, digest)
            blocks.append(block)
        if self._digest is BEGINNING:
            blocks[0] = PREAMBLE + blocks[0]
        return blocks, digest


class JournalFile:
    """A sink that is a file. With the first block it takes the place of what was there; then it grows.

    Devices, pipes, and standard streams are written to as they are, as `write_atomically` does. Errors say which
    file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: AppendableFile | None = None
        self._closed = False

    def write(self, block: bytes) -> None:
        """Take in the next block. Raises `OSError`."""
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


class _Outlet:
    """A sink, and how many blocks it has had."""

    failure: OSError | None = None

    def __init__(self, sink: BlockSink) -> None:
        self._sink = sink
        self._had = 0

    def take(self, blocks: Sequence[bytes], number: int) -> None:
        """Pass on those of `blocks`, the first of which is the journal's `number`-th, that it has not had."""
        while not self.failure and self._had < number + len(blocks):
            try:
                self._sink(blocks[self._had - number])
                self._had += 1
            except OSError as error:
                self.failure = error


def improvements(events: Iterable[AnyEvent], objective: Objective) -> Iterator[AnyEvent]:
    """Yield `events`, and an `Improved` after each that makes the assignment cheaper than ever.

    What robots were given says which variables they show: `objective` may be of the team as the files have it.
    """
    best = INFINITE
    reader = TeamReader()
    now: Mapping[str, Mapping[str, int]] | None
    own: dict[str, dict[str, int]] = {}
    several = list(events)
    for event, following in zip(several, [*several[1:], None], strict=True):
        yield event
        match event:
            case Decided():
                own[event.robot] = event.assignment
                objective.change({event.robot: event.assignment})
                if objective.in_step and isinstance(following, Decided) and following.t == event.t:
                    continue
                cost, now = objective.cost, own
            case Heard():
                cost, now = event.cost, objective.shown(event.values)
            case Given():
                objective.interfaces = interfaces_given(reader, event)
                continue
            case _:
                continue
        if cost < best and now is not None:
            best = cost
            values = {name: value for robot in sorted(now, key=natural_key) for name, value in now[robot].items()}
            yield Improved(t=event.t, cost=objective.told(best), assignment=values)


def interfaces_given(reader: TeamReader, given: Given) -> dict[str, tuple[str, ...]]:
    """Return the variables that the robots in `given` show; of none, if it cannot be read."""
    try:
        return {robot.name: robot.interface for robot in reader.team(given).robots}
    except GivenProblemError:
        return {}


def _readable(header: Header) -> Header:
    """Return `header`, with the team's name made encodable: the folder's name may not be valid text."""
    return msgspec.structs.replace(header, team=header.team.encode(errors="replace").decode())


def _contents(lines: Sequence[JournalEntry], *, exact: bool) -> Iterator[bytes]:
    """Yield what the blocks of `lines` hold: one, or as many as it takes."""
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
            yield columns_of([_instead(lines[0], why)], exact=exact)
        return
    middle = len(lines) // 2
    yield from _contents(lines[:middle], exact=exact)
    yield from _contents(lines[middle:], exact=exact)


def _instead(line: JournalEntry, why: str) -> JournalEntry:
    """Return a replacement for an entry that cannot be encoded.

    Raises `ValueError` where there is nothing.
    """
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
