"""The states of robots after each of their steps, computed in chunks by replaying the journal's file.

A robot is replayed with the messages that it received. Its events are read from the file on request; the events of
other robots are only read if the replay needs them.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader
from itertools import islice
from typing import NamedTuple

import msgspec

from robochoc.journal.events import AnyEvent, Began, Concluded, Decided, Given, Heard, Received, Sent, Settled
from robochoc.journal.journal import Ended, Follower, Header
from robochoc.replay import CannotReplayError
from robochoc.replay.robot_states import RobotState, states_of
from robochoc.sniffer.cache import Cache
from robochoc.sniffer.growing_file import GrowingFile
from robochoc.sniffer.live_trace import next_entries
from robochoc.sniffer.page_data import STATES, BadRequestError

MOST_EVENTS = 1_000_000
"""The maximum number of events of one robot, which need some hundred MB."""
_KEPT_BYTES = 1 << 26


class _Playing(NamedTuple):
    robot: str
    size: int
    """The length of the file at the start of the replay."""
    states: Iterator[RobotState]


class RobotStates:
    """Replays the most recently requested robot, and caches its states."""

    def __init__(self) -> None:
        self._cache = Cache(_KEPT_BYTES)
        self._playing: _Playing | None = None
        self._next = 0
        self.stopped = False

    def chunk(self, file: GrowingFile, robot: str, number: int, *, final: bool) -> bytes:
        """Return the states after the steps in chunk `number` as JSON; `[]` after the last chunk.

        The file is read up to its current end, without moving the reader `file`. States are only cached if `final`:
        during a run, messages to the robot may still be missing.

        Raises:
            BadRequestError: if the robot cannot be replayed.
        """
        kept = self._cache.get((robot, number))
        if kept is not None:
            return kept
        playing = self._playing
        if playing is None or playing.robot != robot or number < self._next or playing.size != file.end:
            playing = _Playing(robot, file.end, self._states(file, robot))
            self._playing, self._next = playing, 0
        answer = b"[]"
        while self._next <= number and not self.stopped:
            states = self._next_states(playing)
            answer = msgspec.json.encode(states)
            if len(states) < STATES:
                self._playing = None
                return answer if self._next == number else b"[]"
            if final:
                self._cache.put((robot, self._next), answer)
            self._next += 1
        return answer

    def _next_states(self, playing: _Playing) -> list[RobotState]:
        """Return the states in the next chunk. Raises `BadRequestError`."""
        try:
            return list(islice(playing.states, STATES))
        except CannotReplayError as reason:
            self._playing = None
            raise BadRequestError(str(reason)) from reason
        except BadRequestError:
            self._playing = None
            raise

    def _states(self, file: GrowingFile, robot: str) -> Iterator[RobotState]:
        return states_of(
            self._events(file, robot),
            robot,
            header=_header(file),
            everything=lambda: self._events(file),
        )

    def _events(self, file: GrowingFile, robot: str | None = None) -> Iterator[AnyEvent]:
        """Yield the events of `robot`, or of all robots, sorted by time within each run."""
        whose = f"the states of {robot}" if robot else "all robots together"
        here = file.again()
        follower = Follower(BufferedReader(here))
        run: list[AnyEvent] = []
        count = 0
        while not self.stopped and (lines := next_entries(follower, here, file.end)):
            for line in lines:
                if isinstance(line, Header | Ended) or not _concerns(line, robot):
                    continue
                count += 1
                if count > MOST_EVENTS:
                    raise BadRequestError(
                        f"{whose} have more than {MOST_EVENTS:,} events, too many for a replay in the page: use"
                        " 'robochoc replay'"
                    )
                if isinstance(line, Began):
                    yield from sorted(run, key=_time)
                    run.clear()
                run.append(line)
        yield from sorted(run, key=_time)


def _time(event: AnyEvent) -> float:
    return event.t


def _header(file: GrowingFile) -> Header | None:
    here = file.again()
    lines = next_entries(Follower(BufferedReader(here)), here, file.end)
    return lines[0] if lines and isinstance(lines[0], Header) else None


def _concerns(event: AnyEvent, robot: str | None) -> bool:
    match event:
        case Sent():
            return robot in {None, event.sender, event.receiver}
        case Received():
            return robot in {None, event.receiver}
        case Decided() | Heard() | Settled() | Concluded():
            return robot in {None, event.robot}
        case _:
            return isinstance(event, Began | Given)
