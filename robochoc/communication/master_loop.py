"""The master's loop during a search, for every transport: pipes between processes, or the network.

The master waits until all robots are ready, orders the start, requests counters until they prove quiescence, and ends
the search. `SearchState` makes its decisions; each runtime implements the transport of control messages.

All waits are in this module, and every wait ends. `_serve_until` requires a deadline. Only the waits of a search have
none, since computations may last for any time: they end if all robots wait for data that are lost (`is_stalled`).
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
TRANSIT_S = 3600.0
"""The longest transit of a message between processes, in seconds, also if the machine is busy."""


class MasterLoop(ABC):
    """The loop of a master for the search `state`. `progress` receives the message count every `TICK_S` seconds.

    `watch` receives snapshots during the search (None: no snapshots).
    """

    state: SearchState
    watch: SearchWatch | None = None
    check_s: float = TICK_S
    """The interval between two checks for lost robots, in seconds."""
    longest_turn_s: float = 1.0
    """The longest turn of the loop that counts as waiting, in seconds: the clock of a suspended machine jumps."""
    wave_s: float = 0.0
    """The least interval between two waves, in seconds."""

    def __init__(self, progress: Callable[[Progress], None] | None = None) -> None:
        self._progress = progress
        self._kills = KillSchedule()
        self._kill: Callable[[str], None] | None = None
        self._shown = self._checked = self._waved = 0.0
        self._turned = self._waited_s = 0.0
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
        self._serve_search(lambda: state.ready or state.broken_off or stop_requested(), deadline)
        if not state.ready or state.ended:
            return
        self._order_start()
        self._kills.start(time.monotonic())
        state.start()
        self._serve_search(lambda: state.ended or self.is_to_stop, deadline)
        state.searching = False
        self._kills.end(time.monotonic())

    @property
    def is_to_stop(self) -> bool:
        """True if a stop was requested, or the watch is satisfied."""
        return stop_requested() or (self.watch is not None and self.watch.satisfied)

    def _serve_until(self, done: Callable[[], bool], deadline: float) -> None:
        """Serve the robots until `done()` or the deadline, on the monotonic clock. Raises the errors of `_serve`."""
        while not done() and not is_past(deadline):
            self._serve_once(time.monotonic(), deadline)

    def _serve_search(self, done: Callable[[], bool], deadline: float | None) -> None:
        """Serve the robots until `done()` or the deadline. The state ends a search that can never continue."""
        while not done() and not is_past(deadline):
            now, is_searching = time.monotonic(), self.state.searching
            self._waited_s += min(now - self._turned, self.longest_turn_s)
            self._turned = now
            watch = self.watch if is_searching else None
            kill_s = self._kills.wait_s(now) if is_searching else None  # only then robots are killed
            self._serve_once(
                now, deadline, kill_s, self._wave_wait_s(now), None if watch is None else watch.wait_s(now)
            )
            self._detect_end(now, is_limited=deadline is not None)
            if is_searching:
                self._kill_due()
            if watch is not None:
                self._take_snapshots(watch)

    def _wave_wait_s(self, now: float) -> float | None:
        """Return the seconds until a wave that is due may start, or None if no wave waits for its time."""
        left_s = self._waved + self.wave_s - now
        return left_s if left_s > 0 and self.state.wave_due else None

    def _serve_once(self, now: float, deadline: float | None, *waits_s: float | None) -> None:
        """Serve the robots once, after a wait of at most `TICK_S` and these seconds. Then check for lost robots."""
        waits_s = (TICK_S, None if deadline is None else deadline - now, *waits_s)
        self._serve(min(wait for wait in waits_s if wait is not None), deadline)
        if now - self._checked >= self.check_s:
            self._checked = now
            self._check_robots(now)

    def _take_snapshots(self, watch: SearchWatch) -> None:
        """Pass a complete snapshot to `watch`, and request the next snapshot when it is due."""
        snapshot = self._snapshot()
        if snapshot is not None:
            watch.receive(snapshot)
        if watch.wants_snapshot(time.monotonic()):
            number = self.state.start_snapshot()
            if number is not None:
                self._ask_for_snapshot(number)

    @property
    def _transit_s(self) -> float:
        """The longest transit of a message, in seconds."""
        return TRANSIT_S

    def _end_stalled(self) -> None:
        """End a search that can never continue."""
        self.state.stuck = self.state.describe_stall()

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

    def _detect_end(self, now: float, *, is_limited: bool = False) -> None:
        """Start a wave if it could prove quiescence, or if a progress report or a limit needs the message count.

        A search that can never continue ends. `is_limited`: the search has a deadline.
        """
        state = self.state
        if state.is_stalled(self._waited_s, self._transit_s):
            self._end_stalled()
            return
        wanted = now - self._shown >= TICK_S and (self._progress is not None or state.max_messages is not None)
        if wanted:
            self._shown = now
        if self._progress and wanted:
            stage = self._overdue_in_words(is_limited=is_limited)
            self._progress(Progress(state.counters.sent, time.monotonic() - self._began, stage))
        if state.start_continuation():
            self._send_all(GoOn())
        if now - self._waved < self.wave_s and not state.counters.quiescent:
            return
        wave = state.next_wave(wanted=wanted and state.searching)
        if wave is not None:
            self._waved = now
            self._send_all(CounterWave(wave))

    def _overdue_in_words(self, *, is_limited: bool) -> str:
        """Return which robots have not answered for long; empty if there are none."""
        names, silent_s = self.state.overdue(self._waited_s)
        if not names:
            return ""
        return f"no answer from {names} for {silent_s:.0f} s{'' if is_limited else ' (--timeout limits the search)'}"
