"""The run's journal, which the master offers while it grows to participants with the right to sniff.

A follower asks for the bytes from `start` on, and gets a piece of bounded size; the rest waits in the journal's file.
So a follower may come late, be slow, or stop: nothing is kept for it, nothing waits for it, and neither the master nor
a robot is slowed. The router proves who asks (`access.py`). Threads may share it.
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

SNIFF = "sniff"
"""The right that is granted or refused."""
PIECE_BYTES = 60_000
"""The largest piece of the journal: with its framing it fits into one batch of zenoh."""
MAX_ANSWERS_PER_S = 200
"""The largest number of answers to one follower in a second. It repeats questions without an answer."""
PRESENT_S = 5.0
"""Seconds after its last request for which a follower is waited for at the end of the run.

It must be more than what a follower takes to ask again when a request or answer was lost (`sniffer/remote.py`: 2 s)."""
LARGEST = 2**53
"""Bytes: no journal is as long."""
_LARGEST_QUESTION = 200


class Question(msgspec.Struct, frozen=True, array_like=True):
    """The journal of `run` from byte `start` on, please."""

    run: str
    start: Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]


class Piece(msgspec.Struct, frozen=True, array_like=True):
    """A piece of the journal of `run`, from byte `start` on. `over`: the journal ends there for good."""

    run: str
    start: Annotated[int, msgspec.Meta(ge=0, le=LARGEST)]
    content: Annotated[bytes, msgspec.Meta(max_length=PIECE_BYTES)]
    over: bool


class NotAnsweredError(Exception):
    """A question without an answer. The message is the reason, for the master's observer. Empty: not reported."""


class Publication:
    """The journal of one run, written to the file `descriptor` (for reading and writing), and given out from it.

    It is a sink for blocks (`write`). `fresh` is called when somebody has asked for all that there is: it may write
    what has not been written yet. Whoever opens the file closes it, after `close`.
    """

    def __init__(self, descriptor: int, fresh: Callable[[], None] = lambda: None) -> None:
        self.run = ""
        """The run whose journal it is, as frames name it; the master sets it."""
        self.fresh = fresh
        self.trouble = ""
        """The reason why the journal is no longer written and published. Empty: there is none."""
        self._descriptor = descriptor
        self._size = 0
        self._over = self._closed = False
        self._asked: dict[str, list[float]] = {}
        self._behind: dict[str, float] = {}
        """The followers that have not received the end yet, with the times of their last requests."""
        self._lock = threading.Lock()

    def write(self, block: bytes) -> None:
        """Append a block. Where that fails, the run goes on, and followers learn of it (`trouble`)."""
        done = 0
        try:
            while done < len(block) and not self.trouble:
                done += os.pwrite(self._descriptor, memoryview(block)[done:], self._size + done)
        except OSError as error:
            self.trouble = f"the journal cannot be kept any more: {error.strerror}"
        else:
            self._size += done

    def end(self) -> None:
        """Note that all has been written."""
        self._over = True

    def close(self) -> None:
        """Answer no questions any more."""
        with self._lock:
            self._closed = True

    @property
    def lagging(self) -> bool:
        """Return whether a follower of the run has not received its end yet."""
        now = time.monotonic()
        with self._lock:
            return not self._closed and any(now - asked < PRESENT_S for asked in self._behind.values())

    def answer(self, name: str, content: bytes) -> bytes:
        """Return the answer to the question `content` of `name`, who has the right to ask.

        Raises `NotAnsweredError`.
        """
        self._count(name)
        question = _question(content)
        if question.run == self.run and question.start >= self._size and not self._over:
            self.fresh()
        over = self._over  # before the size is looked at: nothing is written after it
        size = self._size
        if question.start > size:
            raise NotAnsweredError(f"the journal has {size:,} bytes, and byte {question.start:,} was asked for")
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
    """Return the question for the journal of `run` from byte `start` on."""
    return msgspec.msgpack.encode(Question(run, start))


def piece_in(content: bytes) -> Piece:
    """Return the piece in an answer. Raises `JournalError`."""
    try:
        return msgspec.msgpack.decode(content, type=Piece)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise JournalError(f"no piece of one: {error}") from None


def _question(content: bytes) -> Question:
    if len(content) > _LARGEST_QUESTION:
        raise NotAnsweredError(f"a question of {len(content):,} bytes")
    try:
        return msgspec.msgpack.decode(content, type=Question)
    except (msgspec.MsgspecError, RecursionError, UnicodeDecodeError) as error:
        raise NotAnsweredError(f"it is malformed: {error}") from None


class JournalServer:
    """The master's server for the journal of its `run`. A frame checks the right to it; then pieces are requested.

    `publication` is None where it gives none out. `may` says who has the right now.
    """

    def __init__(self, run: str, may: Callable[[str], bool], events: MasterEvents) -> None:
        self.publication: Publication | None = None
        self._run = run
        self._may = may
        self._events = events
        self._known: set[str] = set()

    @property
    def lagging(self) -> bool:
        """Return whether a follower has not received the end of the journal yet."""
        return self.publication is not None and self.publication.lagging

    def welcome(self, name: str, sniff: JournalRequest) -> JournalAnswer:
        """Return the answer to `name`, which wants to sniff."""
        why = self._why_not(name)
        if why:
            self._events.refuse(name, SNIFF, why)
        elif name not in self._known:
            self._known.add(name)
            self._events.granted(name, SNIFF)
        return JournalAnswer(sniff.number, self._run, why)

    def answer(self, name: str, content: bytes) -> bytes | None:
        """Return the answer to a question of `name`, as the router says it is; None: there is none."""
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
            return "this master gives its journal to nobody; it needs --sniffable"
        if not self._may(name):
            return f"it has no right to; say: robochoc authority enrol {name} --may sniff"
        return self.publication.trouble
