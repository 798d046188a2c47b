"""A standby master: it follows the masters with a higher priority, and leads the robots if none of those leads.

While a master leads, it tells the standby masters whom the Authority admits. So a standby master needs an identity with
the role `master`, but not the Authority's key. It listens only while it leads.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from queue import Empty
from typing import NamedTuple, Self

import msgspec

from robochoc.authority.identity import Identity
from robochoc.authority.registry import PRIVATE
from robochoc.communication.network.control_messages import Spent, StandbyAnswer, StandbyRequest
from robochoc.communication.network.framing import MASTER, FrameRefusedError, Framing
from robochoc.communication.network.inbox import FrameArrived
from robochoc.communication.network.masters import SILENCE_S, listens
from robochoc.communication.network.standbys import CopiedAdmission
from robochoc.communication.network.transport import CannotConnectError, Transport
from robochoc.run.networked.address import Address
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically
from robochoc.system.plain_text import LONGEST_REASON, on_one_line

ADMISSION = "admission.msgpack"
"""The file of the last answer of a leading master, in the folder of the standby master's identity."""
_ASK_S = 0.5
_CONNECT_S = 3.0
_CHECK_S = 0.1
_AFTER_S = 1.0
"""The additional wait for each master with a higher priority, so that standby masters take over one by one."""


class StandbyPlan(NamedTuple):
    """The part of a master's plan that makes it a standby master.

    Attributes:
        leaders: The masters with a higher priority, in their order. Without any, this master leads at once.
        identity: The identity of the standby master.
        known: The Authority's rules, if they are known; they are not stored then.
    """

    leaders: tuple[Address, ...]
    identity: Identity
    known: StandbyAnswer | None = None


class RunOverElsewhereError(RobochocError):
    """Raised if another master has ended the run. `failed`: the run was not completed."""

    def __init__(self, place: Address, answer: StandbyAnswer) -> None:
        super().__init__(f"the master at {place} has ended the run: {on_one_line(answer.over, LONGEST_REASON)}")
        self.failed = answer.failed


class NoLeaderError(RobochocError):
    """Raised if no master has ever answered a standby master, which therefore does not know the robots."""


class _Follower:
    """Follows the master at `place` in a thread: connects, asks it for a sign of life, and stores its answers."""

    def __init__(self, place: Address, identity: Identity, note: Callable[[StandbyAnswer], None]) -> None:
        self.answered_at: float | None = None
        self._place = place
        self._identity = identity
        self._note = note
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"follow {place}", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closed.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._closed.wait(_CHECK_S):
            if listens(str(self._place)):
                with suppress(CannotConnectError):
                    link = Transport(
                        str(self._place), self._identity, watch=(), senders=[MASTER], patience_s=_CONNECT_S
                    )
                    try:
                        self._follow(link)
                    finally:
                        self._close(link)

    def _close(self, link: Transport) -> None:
        """Close the connection, and send the last answer before, unless the link may be dead."""
        if self.answered_at is not None and time.monotonic() - self.answered_at < SILENCE_S:
            link.close()
        else:
            link.abandon()

    def _follow(self, link: Transport) -> None:
        """Ask until the master does not answer any more."""
        framing = Framing(self._identity.name)
        connected_at = heard_at = time.monotonic()
        asked_at = 0.0
        while not self._closed.is_set() and time.monotonic() - max(heard_at, connected_at) < 2 * SILENCE_S:
            if time.monotonic() - asked_at >= _ASK_S:
                asked_at = time.monotonic()
                link.send(MASTER, framing.write(MASTER, StandbyRequest()))
            try:
                item = link.inbox.get(timeout=_CHECK_S)
            except Empty:
                continue
            answer = _answer_in(framing, item) if isinstance(item, FrameArrived) else None
            if answer is None:
                continue
            heard_at = time.monotonic()
            self.answered_at = None if answer.resigned else heard_at
            self._note(answer)
            if answer.resigned:
                return
            if answer.over:
                link.send(MASTER, framing.write(MASTER, StandbyRequest(over=True)))


def _answer_in(framing: Framing, item: FrameArrived) -> StandbyAnswer | None:
    with suppress(FrameRefusedError):
        message = framing.read(item.sender, item.content).message
        return message if isinstance(message, StandbyAnswer) else None
    return None


class LeaderWatch:
    """Follows all masters with a higher priority than this standby master. A context manager.

    Attributes:
        place: The master that has answered last, or None.
    """

    def __init__(self, plan: StandbyPlan) -> None:
        self.place: Address | None = None
        self._plan = plan
        self._followers: list[_Follower] = []
        self._file = plan.identity.folder / ADMISSION
        self._answer = plan.known or _stored(self._file)
        self._resigned_at: float | None = None
        self._over: RunOverElsewhereError | None = None

    def __enter__(self) -> Self:
        self._began = time.monotonic()
        self._followers = [
            _Follower(place, self._plan.identity, lambda answer, place=place: self._note(place, answer))  # type: ignore[misc]
            for place in self._plan.leaders
        ]
        return self

    def __exit__(self, *_error: object) -> None:
        for follower in self._followers:
            follower.close()

    @property
    def is_led(self) -> bool:
        """True if a master with a higher priority has answered a short time ago."""
        return bool(self._plan.leaders) and self._silent_s() < SILENCE_S

    @property
    def has_closed(self) -> bool:
        """True if the team was complete at the last answer of a leading master."""
        return self._answer is not None and self._answer.closed

    @property
    def spent(self) -> Spent:
        """The effort of the search under earlier masters, as in the last answer of a leading master."""
        return self._answer.spent if self._answer else Spent()

    @property
    def admission(self) -> CopiedAdmission:
        """The Authority's rules, as in the last answer of a leading master."""
        if self._answer is None:
            raise AssertionError
        return CopiedAdmission(self._answer)

    def wait(self, gather_s: float | None = None) -> None:
        """Wait until no master with a higher priority leads.

        A standby master that has never received an answer waits for one, since it does not know whom to admit: for
        `gather_s` seconds (None: without a limit).

        Raises:
            NoLeaderError: if there was no answer in time.
            RunOverElsewhereError: if the run is over.
        """
        while self._answer is None or self._silent_s() < self.wait_s:
            if self._over:
                raise self._over
            if self._answer is None and gather_s is not None and time.monotonic() - self._began > gather_s:
                leaders = ", ".join(map(str, self._plan.leaders))
                raise NoLeaderError(
                    f"no answer from {leaders} for {gather_s:g} s: a new standby master receives the names of the"
                    " robots from another master; start the first one, and check that this one is enrolled there"
                )
            time.sleep(_CHECK_S)

    @property
    def wait_s(self) -> float:
        """The time without an answer after which this master leads, in seconds."""
        leaders = len(self._plan.leaders)
        return SILENCE_S + _AFTER_S * (leaders - 1) if leaders else 0.0

    def _silent_s(self) -> float:
        """Return the time without an answer. A master that has resigned counts as silent for as long as necessary."""
        times = [one.answered_at for one in self._followers if one.answered_at is not None]
        began = self._began if self._resigned_at is None else self._resigned_at - SILENCE_S
        return time.monotonic() - max([began, *times])

    def _note(self, place: Address, answer: StandbyAnswer) -> None:
        """Store an answer. Called by the threads of the followers."""
        self.place = place
        self._resigned_at = time.monotonic() if answer.resigned else None
        self._over = RunOverElsewhereError(place, answer) if answer.over else None
        before = self._answer
        is_new = before is None or (answer.names, answer.sniffers) != (before.names, before.sniffers)
        if is_new and self._plan.known is None:
            with suppress(OSError):  # it is still in memory
                write_atomically(self._file, msgspec.msgpack.encode(answer), PRIVATE)
        self._answer = answer


def _stored(file: Path) -> StandbyAnswer | None:
    try:
        answer = msgspec.msgpack.decode(file.read_bytes(), type=StandbyAnswer)
    except (OSError, msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return None
    return StandbyAnswer(answer.names, answer.sniffers)


__all__ = ["LeaderWatch", "NoLeaderError", "RunOverElsewhereError", "StandbyPlan"]
