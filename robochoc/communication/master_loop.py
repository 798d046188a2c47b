"""The master's loop of one search, for every transport: processes' pipes, or the network.

The master waits until all robots are ready, orders the start, asks for counters until they show quiescence, and ends
the search. What it decides is in `SearchState`; how it reads and sends control messages is the runtime's.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from robochoc.communication.control import GoOn, TakeSnapshot, Wave
from robochoc.communication.kill_schedule import KillSchedule
from robochoc.communication.run_result import Progress, RunResult
from robochoc.communication.search_state import SearchState
from robochoc.communication.search_watch import SearchWatch
from robochoc.communication.session import over
from robochoc.system.stopping import stop_requested

TICK_S = 0.2
"""Seconds between two reports of progress."""


class MasterLoop(ABC):
    """The loop of a master whose search is in `state`. `progress` receives the count of messages now and then.

    `watch` gets snapshots of the search while it goes on (None: nobody watches).
    """

    state: SearchState
    watch: SearchWatch | None = None
    check_s: float = TICK_S
    """Seconds between two checks of which robots are still there."""

    def __init__(self, progress: Callable[[Progress], None] | None = None) -> None:
        self._progress = progress
        self._kills = KillSchedule()
        self._kill: Callable[[str], None] | None = None
        self._shown = self._checked = 0.0
        self._began = time.monotonic()

    @abstractmethod
    def _serve(self, patience_s: float, deadline: float | None) -> None:
        """Handle arrived messages, after a wait of at most `patience_s` seconds.

        Raises:
            RobotsLostError: when a robot is lost whose loss ends the run.
            UnsupportedError: when a robot cannot take part.
        """

    @abstractmethod
    def _check_robots(self, now: float) -> None:
        """Find out which robots are gone. Raises as `_serve`."""

    @abstractmethod
    def _order_start(self) -> None:
        """Tell all robots to begin."""

    @abstractmethod
    def _send_all(self, message: Wave | GoOn | TakeSnapshot, /) -> None:
        """Send a control message to all robots."""

    def schedule_kills(self, kills: KillSchedule, kill: Callable[[str], None]) -> None:
        """Have `kill` end robots' processes as `kills` says."""
        self._kills = kills
        self._kill = kill

    def _search_until(self, deadline: float | None) -> None:
        """Search until there is a verdict, it has to be broken off, the deadline comes, or somebody asks to stop.

        Raises as `_serve`.
        """
        state = self.state
        self._serve_until(lambda: state.ready or state.broken_off or stop_requested(), deadline)
        if not state.ready or state.ended:
            return
        self._order_start()
        self._kills.begin(time.monotonic())
        state.ordered = state.searching = True
        self._serve_until(lambda: state.ended or self.is_to_stop, deadline)
        state.searching = False
        self._kills.end(time.monotonic())

    @property
    def is_to_stop(self) -> bool:
        """Return whether somebody has asked to stop, or the search need not go on."""
        return stop_requested() or (self.watch is not None and self.watch.satisfied)

    def _serve_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()`, or until the deadline on the monotonic clock. Raises as `_serve`."""
        while not done():
            now = time.monotonic()
            if over(deadline):
                return
            waits = (TICK_S, None if deadline is None else deadline - now, self._kills.wait_s(now))
            watch = self.watch if self.state.searching else None
            soon = TICK_S if watch is None else watch.wait_s(now)
            self._serve(min(soon, *(wait for wait in waits if wait is not None)), deadline)
            if now - self._checked >= self.check_s:
                self._checked = now
                self._check_robots(now)
            if self.state.searching:
                self._detect_end(now)
                self._kill_due()
            if watch is not None:
                self._take_snapshots(watch)

    def _take_snapshots(self, watch: SearchWatch) -> None:
        """Give `watch` the snapshot that all robots have answered, and ask for the next one when it is wanted."""
        snapshot = self._snapshot()
        if snapshot is not None:
            watch.take(snapshot)
        if watch.wants_snapshot(time.monotonic()):
            number = self.state.begin_snapshot()
            if number is not None:
                self._ask_for_snapshot(number)

    def _ask_for_snapshot(self, number: int) -> None:
        """Ask all robots for the snapshot `number`."""
        self._send_all(TakeSnapshot(number))

    def _snapshot(self) -> RunResult | None:
        """Return the snapshot that was asked for, once it is complete; None before, and afterwards."""
        return self.state.end_snapshot()

    def _kill_due(self) -> None:
        if self._kill is not None:
            for name in self._kills.due(time.monotonic()):
                self._kill(name)

    def _detect_end(self, now: float) -> None:
        """Begin a wave when it could show quiescence, or when the count of messages is wanted."""
        wanted = self._progress is not None and now - self._shown >= TICK_S
        if self._progress and wanted:
            self._shown = now
            self._progress(Progress(self.state.counters.sent, time.monotonic() - self._began))
        if self.state.begin_going_on():
            self._send_all(GoOn())
        wave = self.state.next_wave(wanted=wanted)
        if wave is not None:
            self._send_all(Wave(wave))
