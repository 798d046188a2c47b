"""A robot's votes for masters, stored in a file before they are sent. See `leadership.py`."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import msgspec

from robochoc.authority.registry import locked
from robochoc.communication.network.control_messages import (
    Accepted,
    AcceptedDecision,
    Lead,
    Promised,
    Propose,
    Standing,
    TeamDecision,
)
from robochoc.communication.network.leadership import Acceptance, Term, Votes
from robochoc.system.errors import RobochocError
from robochoc.system.files import write_atomically

KEPT_S = 7 * 24 * 3600.0
"""The time for which votes are stored, in seconds. A mission ends earlier, since certificates expire."""
MOST_RUNS = 16
"""The maximum number of runs of a mission whose values a robot stores."""
LOCKED_S = 5.0
"""The longest wait for another process of the same robot that stores its votes, in seconds."""
_PRIVATE = 0o600


class VotesError(RobochocError):
    """Raised if the file of a robot's votes cannot be used."""


class _Record(msgspec.Struct, frozen=True):
    """The stored votes in a mission, with the robot's values by run, and the Unix time of the last change."""

    team: tuple[str, ...]
    promised: Term
    accepted: AcceptedDecision | None
    values: dict[str, dict[str, int]]
    changed: float


class _Content(msgspec.Struct, frozen=True):
    missions: dict[str, _Record] = {}


class RobotVotes:
    """The votes of one robot.

    Attributes:
        mission: The mission in which this process of the robot takes part; empty before its first promise.
        several: True if the robot knows several masters.

    Args:
        file: Stores the votes (None: they are stored only in memory, which suffices for robots that do not restart).
        several: True if the robot knows several masters.
    """

    def __init__(self, file: Path | None = None, *, several: bool = False) -> None:
        self.mission = ""
        self.several = several
        self._file = file
        self._team: tuple[str, ...] = ()
        self._votes = Votes[TeamDecision]()
        self._values: dict[str, dict[str, int]] = {}
        """The robot's last values in each run, the latest run last."""

    @property
    def standing(self) -> Standing | None:
        """The part of the votes for the registration, or None if the robot knows only one master."""
        return Standing(self.mission, self._team, self._votes.promised) if self.several else None

    def decided(self, name: str) -> dict[str, int] | None:
        """Return the values of the robot `name` in the decision that it has accepted, or None if there is none."""
        if self._votes.accepted is None:
            return None
        decision = self._votes.accepted.decision
        return self._values.get(decision.run, {}) if name in decision.robots else {}

    def remember(self, run: str, values: Mapping[str, int]) -> None:
        """Store the robot's values in the run `run`, unless there are none."""
        if values:
            self._values.pop(run, None)
            self._values[run] = dict(values)
            if len(self._values) > MOST_RUNS:
                del self._values[next(iter(self._values))]

    def promise(self, order: Lead, *, private: bool) -> Promised:
        """Answer the request of a master to lead. Raises `VotesError`."""
        if order.mission != self.mission:
            self.mission, self._team, self._votes = order.mission, order.team, Votes()
        self._vote(lambda votes: votes.promise(order.term))
        return Promised(order.term, self._votes.promised, self._accepted, {} if private else dict(self._values))

    def accept(self, order: Propose) -> Accepted:
        """Answer a proposal. Raises `VotesError`."""
        self._vote(lambda votes: votes.accept(order.term, order.decision))
        return Accepted(order.term, self._votes.promised)

    @property
    def _accepted(self) -> AcceptedDecision | None:
        accepted = self._votes.accepted
        return None if accepted is None else AcceptedDecision(accepted.term, accepted.decision)

    def _vote(self, change: Callable[[Votes[TeamDecision]], Votes[TeamDecision] | None]) -> None:
        """Store the votes after `change`, unless it returns None.

        The stored votes count, since another process of this robot may have voted for another master in the meantime.
        """
        with self._locked():
            known = self._read().missions.get(self.mission)
            if known is not None:
                accepted = None if known.accepted is None else Acceptance(*known.accepted)
                self._team, self._votes = known.team, Votes(known.promised, accepted)
                self._values = known.values | self._values
            votes = change(self._votes)
            if votes is not None:
                self._store(votes)

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Lock the file against other processes of this robot. Raises `VotesError` if it stays locked."""
        if self._file is None:
            yield
            return
        try:
            with locked(self._file.parent, LOCKED_S):
                yield
        except TimeoutError:
            why = f"another process of this robot has locked it for {LOCKED_S:g} s: end that process"
            raise VotesError(f"{self._file}: {why}") from None

    def _store(self, votes: Votes[TeamDecision]) -> None:
        self._votes = votes
        if self._file is None:
            return
        now = time.time()
        recent = {name: one for name, one in self._read().missions.items() if abs(now - one.changed) < KEPT_S}
        recent[self.mission] = _Record(self._team, votes.promised, self._accepted, self._values, now)
        try:
            write_atomically(self._file, msgspec.json.encode(_Content(recent)), _PRIVATE)
            _sync(self._file)
            _sync(self._file.parent)
        except OSError as error:
            raise VotesError(f"{self._file}: the robot's votes cannot be stored: {error.strerror or error}") from error

    def _read(self) -> _Content:
        if self._file is None:
            return _Content()
        try:
            return msgspec.json.decode(self._file.read_bytes(), type=_Content)
        except FileNotFoundError:
            return _Content()
        except OSError as error:
            raise VotesError(f"{self._file} cannot be read: {error.strerror or error}") from error
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise VotesError(f"{self._file} is damaged: {error}; enrol this robot again under another name") from error


def _sync(path: Path) -> None:
    """Write a file or folder to the disk, so that votes outlast a power failure."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
