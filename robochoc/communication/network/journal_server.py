"""The journal of the run, published by the master during the run to participants with the right to sniff.

A follower requests the bytes from `start` on, and receives a piece of bounded size; the remaining bytes stay in the
journal's file. So a follower may start late, be slow, or stop: nothing is stored for it, and it slows neither the
master nor the robots. The router verifies the name of the follower (`access.py`). Thread-safe.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Annotated

import msgspec

from robochoc.communication.network.control_messages import JournalAnswer, JournalRequest
from robochoc.communication.network.master_events import MasterEvents
from robochoc.journal.entries import JournalError
from robochoc.system.errors import RobochocError

SNIFF = "sniff"
"""The name of the right to read the journal."""
PIECE_BYTES = 60_000
"""The largest piece of the journal, in bytes. With its framing it fits into one batch of zenoh."""
MAX_ANSWERS_PER_S = 200
"""The maximum number of answers to a follower in one second. The follower repeats unanswered requests."""
PRESENT_S = 5.0
"""How long the end of the run waits for a follower after its last request, in seconds.

It must exceed the time after which a follower repeats a request (`sniffer/remote.py`: 2 s).
"""
LARGEST = 2**53
"""An upper bound on the bytes of any journal."""
_LARGEST_QUESTION = 200


class Question(msgspec.Struct, frozen=True, array_like=True):
    """A request for the journal of `run` from byte `start` on."""

    run: str
    start: Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]


class Piece(msgspec.Struct, frozen=True, array_like=True):
    """A piece of the journal of `run`, from byte `start` on. `over`: the journal ends after this piece."""

    run: str
    start: Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]
    content: Annotated[bytes, msgspec.Meta(max_length=PIECE_BYTES)]
    over: bool


class NotAnsweredError(RobochocError):
    """Raised if a request gets no answer. The text is the reason, for the master's observer. Empty: not reported."""


class Publication:
    """The journal of one run. It is written to the file `descriptor` (for reading and writing), and published from it.

    A publication is a sink for blocks (`write`). `fresh` is called when a follower has received the whole file; it may
    write pending blocks. The opener of the file closes the file, after `close`.
    """

    def __init__(self, descriptor: int, fresh: Callable[[], None] = lambda: None) -> None:
        self.run = ""
        """The name of the run, as used in frames; set by the master."""
        self.fresh = fresh
        self.trouble = ""
        """The reason why the journal is no longer written and published. Empty: no problem."""
        self._descriptor = descriptor
        self._size = 0
        self._over = self._closed = False
        self._asked: dict[str, list[float]] = {}
        self._behind: dict[str, float] = {}
        """The followers that have not yet received the end, with the times of their last requests."""
        self._lock = threading.Lock()

    def write(self, block: bytes) -> None:
        """Append a block. On failure the run continues, and followers receive the reason (`trouble`)."""
        done = 0
        try:
            while done < len(block) and not self.trouble:
                done += os.pwrite(self._descriptor, memoryview(block)[done:], self._size + done)
        except OSError as error:
            self.trouble = f"the journal cannot be written any more: {error.strerror}"
        else:
            self._size += done

    def end(self) -> None:
        """Record that the journal is complete."""
        self._over = True

    def close(self) -> None:
        """Stop answering requests."""
        with self._lock:
            self._closed = True

    @property
    def lagging(self) -> bool:
        """True if a follower has not yet received the end of the journal."""
        now = time.monotonic()
        with self._lock:
            return not self._closed and any(now - asked < PRESENT_S for asked in self._behind.values())

    def answer(self, name: str, content: bytes) -> bytes:
        """Return the answer to the request `content` by `name`, which has the right to sniff.

        Raises `NotAnsweredError`.
        """
        self._count(name)
        question = _question(content)
        if question.run == self.run and question.start >= self._size and not self._over:
            self.fresh()
        over = self._over  # read before the size, because nothing is written after `end`
        size = self._size
        if question.start > size:
            raise NotAnsweredError(f"the journal has {size:,} bytes, but byte {question.start:,} was requested")
        with self._lock:
            if self._closed:
                raise NotAnsweredError
            content = os.pread(self._descriptor, min(PIECE_BYTES, size - question.start), question.start)
            last = over and question.start + len(content) == size
            if last:
                self._behind.pop(name, None)
            else:
                self._behind[name] = time.monotonic()
        return msgspec.msgpack.encode(Piece(self.run, question.start, content, last))

    def _count(self, name: str) -> None:
        now = time.monotonic()
        with self._lock:
            recent = [t for t in self._asked.get(name, ()) if now - t < 1]
            if len(recent) < MAX_ANSWERS_PER_S:
                recent.append(now)
                self._asked[name] = recent
                return
        raise NotAnsweredError(f"more than {MAX_ANSWERS_PER_S} questions a second")


def question(run: str, start: int) -> bytes:
    """Return the request for the journal of `run` from byte `start` on."""
    return msgspec.msgpack.encode(Question(run, start))


def piece_in(content: bytes) -> Piece:
    """Return the piece in an answer. Raises `JournalError`."""
    try:
        return msgspec.msgpack.decode(content, type=Piece)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise JournalError(f"not a valid piece of a journal: {error}") from None


def _question(content: bytes) -> Question:
    if len(content) > _LARGEST_QUESTION:
        raise NotAnsweredError(f"the question has {len(content):,} bytes, more than {_LARGEST_QUESTION}")
    try:
        return msgspec.msgpack.decode(content, type=Question)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise NotAnsweredError(f"it is malformed: {error}") from None


class JournalServer:
    """Serves the journal of the master's `run`: a `JournalRequest` checks the right, then pieces can be requested.

    `publication` is None if the journal is not published. `may` returns whether a participant has the right now.
    """

    def __init__(self, run: str, may: Callable[[str], bool], events: MasterEvents) -> None:
        self.publication: Publication | None = None
        self._run = run
        self._may = may
        self._events = events
        self._known: set[str] = set()

    @property
    def lagging(self) -> bool:
        """True if a follower has not yet received the end of the journal."""
        return self.publication is not None and self.publication.lagging

    def welcome(self, name: str, sniff: JournalRequest) -> JournalAnswer:
        """Return the answer to a request by `name` to sniff."""
        why = self._why_not(name)
        if why:
            self._events.refuse(name, SNIFF, why)
        elif name not in self._known:
            self._known.add(name)
            self._events.granted(name, SNIFF)
        return JournalAnswer(sniff.number, self._run, why)

    def answer(self, name: str, content: bytes) -> bytes | None:
        """Return the answer to a request by `name`, verified by the router; None: no answer."""
        why = self._why_not(name)
        if not why and self.publication:
            try:
                return self.publication.answer(name, content)
            except (NotAnsweredError, OSError) as refused:
                why = str(refused)
        if why:
            self._events.refuse(name, SNIFF, why)
        return None

    def _why_not(self, name: str) -> str:
        if self.publication is None:
            return "this master does not publish its journal: start it with --sniffable"
        if not self._may(name):
            return f"it does not have the right: grant it by robochoc authority enrol {name} --may sniff"
        return self.publication.trouble
