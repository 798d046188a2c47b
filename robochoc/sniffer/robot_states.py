"""The states of robots after each of their steps, computed in chunks by replaying the journal's file.

A robot is replayed with the messages that it received. Its events are read from the file on request, and kept until
another robot is requested; the events of other robots are only read if the replay needs them.

Steps before a requested chunk are replayed without a look at the robot's state, which takes longer than the replay.
Several replays of the robot, at different steps, are kept. Each continues to later steps; no replay can go back,
because protocols cannot be copied.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from io import BufferedReader
from itertools import islice
from operator import attrgetter

import msgspec

from robochoc.journal.events import AnyEvent, Began, Concluded, Decided, Given, Heard, Received, Sent, Settled
from robochoc.journal.journal import Ended, Follower, Header, JournalEntry, sorted_by_time
from robochoc.replay import CannotReplayError, RobotState, states_of
from robochoc.replay.rebuild import RecordedTeams
from robochoc.sniffer.cache import Cache
from robochoc.sniffer.growing_file import GrowingFile
from robochoc.sniffer.live_trace import entries_of, next_entries
from robochoc.sniffer.page_data import STATES, BadRequestError

MOST_EVENTS = 1_000_000
"""The maximum number of events of one robot, which need some hundred MB."""
_KEPT_BYTES = 1 << 26
_MOST_PLAYING = 4
"""The maximum number of replays of one robot that are kept."""
_BEFORE, _SHARE_BEFORE = 4, 8
"""States before a requested chunk are cached as well: of 4 chunks, or of an eighth of the chunks before, if more."""


class _Playing:
    """A replay of a robot in `events`. `chunk`: the chunk of its next state, which can be increased to skip states."""

    def __init__(self, events: _RobotEvents) -> None:
        self.chunk = 0
        self._states = states_of(
            events.events,
            events.robot,
            header=events.header,
            since=lambda: self.chunk * STATES,
            everything=events.of_all_robots,
            teams=events.teams,
        )

    def next_states(self) -> list[RobotState]:
        """Return the states in the next chunk. Raises `BadRequestError`."""
        try:
            states = list(islice(self._states, STATES))
        except CannotReplayError as reason:
            raise BadRequestError(str(reason)) from reason
        self.chunk += 1
        return states


class _RobotEvents:
    """The events of `robot` in `file`, with the robots' problems. In a growing file, only new entries are read."""

    def __init__(self, file: GrowingFile, robot: str, is_stopped: Callable[[], bool]) -> None:
        self.robot = robot
        self.size = 0
        self._is_stopped = is_stopped
        self._here = file.again()
        self._follower = Follower(BufferedReader(self._here))
        self._read: list[AnyEvent] = []
        self.header: Header | None = None
        self.teams = RecordedTeams(None)
        self.events: Sequence[AnyEvent] = ()
        self._of_all_robots: Sequence[AnyEvent] = ()

    def read_to(self, end: int) -> None:
        """Read up to the position `end`. Raises `BadRequestError`."""
        while not self._is_stopped():
            _check_number(len(self._read), f"the states of {self.robot}")
            if not (lines := next_entries(self._follower, self._here, end)):
                break
            if self.header is None and isinstance(lines[0], Header):
                self.header = lines[0]
                self.teams = RecordedTeams(self.header)
            self._read += _events_of(lines, self.robot)
        self.events = tuple(sorted_by_time(self._read))
        self._of_all_robots = ()
        self.size = end

    def of_all_robots(self) -> Sequence[AnyEvent]:
        """Return the events of all robots, which are read on the first call. Raises `BadRequestError`."""
        if not self._of_all_robots:
            read: list[AnyEvent] = []
            for lines in entries_of(self._here):
                if self._is_stopped():
                    break
                read += (line for line in lines if not isinstance(line, Header | Ended))
                _check_number(len(read), "all robots together")
            self._of_all_robots = tuple(sorted_by_time(read))
        return self._of_all_robots


class RobotStates:
    """Replays the most recently requested robot, and caches its states."""

    def __init__(self) -> None:
        self._cache = Cache(_KEPT_BYTES)
        self._events: _RobotEvents | None = None
        self._playing: list[_Playing] = []
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
        playing = self._playing_before(file, robot, number)
        playing.chunk = max(playing.chunk, number - (max(_BEFORE, number // _SHARE_BEFORE) if final else 0))
        answer = b"[]"
        while playing.chunk <= number and not self.stopped:
            chunk = playing.chunk
            states = playing.next_states()
            answer = msgspec.json.encode(states)
            if final:
                self._cache.put((robot, chunk), answer)
            if len(states) < STATES:
                return answer if chunk == number else b"[]"
        self._playing.append(playing)
        return answer

    def _playing_before(self, file: GrowingFile, robot: str, number: int) -> _Playing:
        """Remove and return the last replay that has not passed chunk `number`, or return a new one."""
        events = self._events
        if events is None or events.robot != robot or events.size > file.end:
            events = self._events = _RobotEvents(file, robot, lambda: self.stopped)
        if events.size != file.end:
            self._playing.clear()
            events.read_to(file.end)
        suitable = [playing for playing in self._playing if playing.chunk <= number]
        if suitable:
            playing = max(suitable, key=attrgetter("chunk"))
            self._playing.remove(playing)
            return playing
        del self._playing[: -_MOST_PLAYING + 1]
        return _Playing(events)


def _check_number(events: int, whose: str) -> None:
    if events > MOST_EVENTS:
        raise BadRequestError(
            f"{whose} have more than {MOST_EVENTS:,} events, too many for a replay in the page: use 'robochoc replay'"
        )


def _events_of(lines: Sequence[JournalEntry], robot: str) -> Iterator[AnyEvent]:
    """Yield the events in `lines` that the replay of `robot` needs."""
    for line in lines:
        if isinstance(line, Sent):
            if robot in (line.receiver, line.sender):
                yield line
        elif isinstance(line, Received):
            if line.receiver == robot:
                yield line
        elif isinstance(line, Settled | Decided | Heard | Concluded):
            if line.robot == robot:
                yield line
        elif isinstance(line, Began | Given):
            yield line
