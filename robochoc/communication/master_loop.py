"""The master's loop during a search, for every transport: pipes between processes, or the network.

The master waits until all robots are ready, orders the start, requests counters until they prove quiescence, and ends
the search. `SearchState` makes its decisions; each runtime implements the transport of control messages.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable

from robochoc.communication.control import CounterWave, GoOn, TakeSnapshot
from robochoc.communication.kill_schedule import KillSchedule
from robochoc.communication.search_result import Progress, SearchResult
from robochoc.communication.search_state import SearchState
from robochoc.communication.search_watch import SearchWatch
from robochoc.communication.session import is_past
from robochoc.system.stopping import stop_requested

TICK_S = 0.2
"""The interval between two progress reports, in seconds."""


class MasterLoop(ABC):
    """The loop of a master for the search `state`. `progress` receives the message count every `TICK_S` seconds.

    `watch` receives snapshots during the search (None: no snapshots).
    """

    state: SearchState
    watch: SearchWatch | None = None
    check_s: float = TICK_S
    """The interval between two checks for lost robots, in seconds."""

    def __init__(self, progress: Callable[[Progress], None] | None = None) -> None:
        self._progress = progress
        self._kills = KillSchedule()
        self._kill: Callable[[str], None] | None = None
        self._shown = self._checked = 0.0
        self._began = time.monotonic()

    @abstractmethod
    def _serve(self, patience_s: float, deadline: float | None) -> None:
        """Handle all messages that have arrived. Wait at most `patience_s` seconds for the first one.

        Raises:
            RobotsLostError: when a robot is lost whose loss ends the run.
            UnsupportedError: when a robot cannot participate.
        """

    @abstractmethod
    def _check_robots(self, now: float) -> None:
        """Find lost robots. Raises the same errors as `_serve`."""

    @abstractmethod
    def _order_start(self) -> None:
        """Order all robots to start."""

    @abstractmethod
    def _send_all(self, message: CounterWave | GoOn | TakeSnapshot, /) -> None:
        """Send a control message to all robots."""

    def schedule_kills(self, kills: KillSchedule, kill: Callable[[str], None]) -> None:
        """Call `kill` with the name of each robot in `kills` at its scheduled time."""
        self._kills = kills
        self._kill = kill

    def _search_until(self, deadline: float | None) -> None:
        """Search until a verdict, an abort, the deadline, or a stop request.

        Raises the same errors as `_serve`.
        """
        state = self.state
        self._serve_until(lambda: state.ready or state.broken_off or stop_requested(), deadline)
        if not state.ready or state.ended:
            return
        self._order_start()
        self._kills.start(time.monotonic())
        state.ordered = state.searching = True
        self._serve_until(lambda: state.ended or self.is_to_stop, deadline)
        state.searching = False
        self._kills.end(time.monotonic())

    @property
    def is_to_stop(self) -> bool:
        """True if a stop was requested, or the watch is satisfied."""
        return stop_requested() or (self.watch is not None and self.watch.satisfied)

    def _serve_until(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()` or the deadline, on the monotonic clock. Raises the errors of `_serve`."""
        while not done():
            now = time.monotonic()
            if is_past(deadline):
                return
            kill_s = self._kills.wait_s(now) if self.state.searching else None  # only then robots are killed
            waits = (TICK_S, None if deadline is None else deadline - now, kill_s)
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
        """Pass a complete snapshot to `watch`, and request the next snapshot when it is due."""
        snapshot = self._snapshot()
        if snapshot is not None:
            watch.receive(snapshot)
        if watch.wants_snapshot(time.monotonic()):
            number = self.state.start_snapshot()
            if number is not None:
                self._ask_for_snapshot(number)

    def _ask_for_snapshot(self, number: int) -> None:
        """Request snapshot number `number` from all robots."""
        self._send_all(TakeSnapshot(number))

    def _snapshot(self) -> SearchResult | None:
        """Return the requested snapshot, once, when it is complete; otherwise None."""
        return self.state.completed_snapshot()

    def _kill_due(self) -> None:
        if self._kill is not None:
            for name in self._kills.due(time.monotonic()):
                self._kill(name)

    def _detect_end(self, now: float) -> None:
        """Start a wave if it could prove quiescence, or if the progress report needs the message count."""
        wanted = self._progress is not None and now - self._shown >= TICK_S
        if self._progress and wanted:
            self._shown = now
            self._progress(Progress(self.state.counters.sent, time.monotonic() - self._began))
        if self.state.start_continuation():
            self._send_all(GoOn())
        wave = self.state.next_wave(wanted=wanted)
        if wave is not None:
            self._send_all(CounterWave(wave))
