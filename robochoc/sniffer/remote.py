"""Follows the run of a remote master: receives its journal block by block, from the first block."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from queue import Empty
from typing import NamedTuple

from robochoc.authority.identity import Identity
from robochoc.communication.network.access import journal_key
from robochoc.communication.network.control_messages import JournalAnswer, JournalRequest
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.journal_server import piece_in, question
from robochoc.communication.network.refusals import LONGEST
from robochoc.communication.network.transport import Transport
from robochoc.journal.blocks import BlockReader, JournalDamagedError
from robochoc.journal.entries import JournalError
from robochoc.run.networked.address import Address
from robochoc.run.networked.directory_query import ANSWER_S, ASK_AGAIN_S, NoAnswerError

LOOK_S = 0.1
"""The interval between requests for new blocks."""
PIECE_S = 1.0
"""The time limit for an answer, after which the request is repeated."""
_NUMBER_BITS = 32


class WholeBlocks(BlockReader):
    """Collects the bytes of a journal and returns complete blocks. Each block must continue the previous one."""

    def __init__(self) -> None:
        super().__init__()
        self._pending = bytearray()
        self._passed = 0

    def add(self, content: bytes) -> bytes:
        """Add `content` and return the completed blocks. Raises `JournalError` and `JournalDamagedError`."""
        self._pending += content
        self.feed(content)
        while self.next() is not None:
            pass
        size = self._place - self._passed
        whole = bytes(self._pending[:size])
        del self._pending[:size]
        self._passed = self._place
        return whole


class FollowResult(NamedTuple):
    """How following a journal ended. `over`: the run has ended, and the journal is complete; `why`: the reason."""

    over: bool
    why: str


STOPPED = FollowResult(over=False, why="stopped")


def receive(
    place: Address,
    identity: Identity,
    sink: Callable[[bytes], object],
    *,
    patience_s: float = 10.0,
    stopped: Callable[[], bool] = lambda: False,
    granted: Callable[[], None] = lambda: None,
) -> FollowResult:
    """Pass the run's journal to `sink` in complete blocks until the run or the master ends.

    Each block's checksum covers the previous block's checksum, and is verified before the block is passed to `sink`.

    Args:
        place: The master's address.
        identity: The key pair for the connection.
        sink: Receives the blocks.
        patience_s: The maximum time to wait for an answer, in seconds.
        stopped: Called regularly. If it returns True, the function returns.
        granted: Called when the master has accepted the connection.

    Raises:
        CannotConnectError: if the connection fails.
        NoAnswerError: if the master does not accept the connection.
    """
    with Transport(str(place), identity, watch=(), patience_s=patience_s) as transport:
        sniffer = _MasterClient(place, transport)
        run = sniffer.admitted(max(ANSWER_S, patience_s), stopped)
        if run is None:
            return STOPPED
        granted()
        return sniffer.follow(IncomingJournal(place, run, sink), patience_s, stopped)


class IncomingJournal:
    """The received part of the journal of `run` from the master at `place`. Valid blocks are passed to `sink`."""

    def __init__(self, place: Address, run: str, sink: Callable[[bytes], object]) -> None:
        self._place = place
        self._run = run
        self._blocks = WholeBlocks()
        self._sink = sink
        self._start = 0
        self.idle = False
        """True if the last answer contained nothing new."""

    @property
    def question(self) -> bytes:
        """The next request."""
        return question(self._run, self._start)

    def receive(self, content: bytes) -> FollowResult | None:
        """Process an answer. If it is the last, return how following ended."""
        try:
            piece = piece_in(content)
            if piece.run != self._run:
                return FollowResult(over=False, why=f"the master at {self._place} was restarted")
            if piece.start != self._start:  # an answer to an earlier request
                return None
            whole = self._blocks.add(piece.content)
        except (JournalError, JournalDamagedError) as bad:
            return FollowResult(over=False, why=f"the master at {self._place} sent an invalid journal: {bad}")
        if whole:
            self._sink(whole)
        self._start += len(piece.content)
        self.idle = not piece.content
        if not piece.over:
            return None
        missing = self._blocks.rest
        rest = f", but its journal is incomplete: {missing}" if missing else ""
        return FollowResult(not missing, f"the run is over{rest}")


class _MasterClient:
    """A client of the master at `place`, connected by `transport`."""

    def __init__(self, place: Address, transport: Transport) -> None:
        self._place = place
        self._name = transport.name
        self._transport = transport
        self._framing = Framing(transport.name)
        self._number = secrets.randbits(_NUMBER_BITS)

    def admitted(self, patience_s: float, stopped: Callable[[], bool]) -> str | None:
        """Return the run to follow, or None if stopped. Raises `NoAnswerError` if there is a refusal or no answer."""
        until, last_request = time.monotonic() + patience_s, 0.0
        while time.monotonic() < until and not stopped():
            if time.monotonic() - last_request > ASK_AGAIN_S:
                last_request = time.monotonic()
                self._request()
            answer = self._answer(LOOK_S)
            if answer and answer.why:
                raise NoAnswerError(
                    f"the master at {self._place} does not allow {self._name} to sniff: {answer.why[:LONGEST]}"
                )
            if answer:
                return answer.run
        if stopped():
            return None
        raise NoAnswerError(
            f"the master at {self._place} does not answer {self._name}: check that it is enrolled with the Authority"
        )

    def follow(self, journal: IncomingJournal, patience_s: float, stopped: Callable[[], bool]) -> FollowResult:
        """Request the journal piece by piece until it ends."""
        last_answer = time.monotonic()
        while not stopped():
            content = self._transport.ask(journal_key(self._name), journal.question, PIECE_S)
            if content is not None:
                last_answer = time.monotonic()
                ending = journal.receive(content)
                if journal.idle and not ending:
                    time.sleep(LOOK_S)
            elif time.monotonic() - last_answer > patience_s:
                return FollowResult(
                    over=False,
                    why=f"the master at {self._place} has ended, or does not allow {self._name} to sniff any more",
                )
            else:
                ending = self._refused()
            if ending:
                return ending
        return STOPPED

    def _request(self) -> None:
        self._transport.send(MASTER, self._framing.write(MASTER, JournalRequest(self._number)))

    def _refused(self) -> FollowResult | None:
        """Ask why an answer is missing. Return None if there is no reason or no answer."""
        self._request()
        answer = self._answer(PIECE_S)
        if answer is None or not answer.why:
            return None
        return FollowResult(
            over=False,
            why=f"the master at {self._place} does not allow {self._name} to sniff any more: {answer.why[:LONGEST]}",
        )

    def _answer(self, patience_s: float) -> JournalAnswer | None:
        """Return the master's next answer, or None if there is no answer within `patience_s`."""
        until = time.monotonic() + patience_s
        while (left := until - time.monotonic()) > 0:
            try:
                item = self._transport.inbox.get(timeout=left)
            except Empty:
                break
            if isinstance(item, FrameArrived) and item.sender == MASTER:
                answer = self._read(item)
                if answer and answer.number == self._number:
                    return answer
        return None

    def _read(self, item: FrameArrived) -> JournalAnswer | None:
        try:
            word = self._framing.read(item.sender, item.content).message
        except FrameRefusedError:
            return None
        return word if isinstance(word, JournalAnswer) else None
