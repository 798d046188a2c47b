"""Robots whose processes are killed at set times, to demonstrate the loss of robots."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple


class Kill(NamedTuple):
    """Sends SIGKILL to the process of `robot`, `after_s` seconds after the start of the search."""

    robot: str
    after_s: float


class KillSchedule:
    """The pending kills in a run. All times are in seconds, on the monotonic clock."""

    def __init__(self, kills: Iterable[Kill] = ()) -> None:
        self._pending = sorted(kills, key=lambda kill: kill.after_s)
        self._began: float | None = None
        self._took_s = 0.0

    def start(self, now: float) -> None:
        """Record the start of the run's first search. Later searches have no effect."""
        self._began = now if self._began is None else self._began

    def end(self, now: float) -> None:
        """Record the end of a search."""
        if self._began is not None:
            self._took_s = now - self._began

    def wait_s(self, now: float) -> float | None:
        """Return the seconds until the next kill, or None if no kill is pending."""
        if self._began is None or not self._pending:
            return None
        return max(0.0, self._began + self._pending[0].after_s - now)

    def due(self, now: float) -> list[str]:
        """Return the robots to be killed now, and remove them from the schedule."""
        names = []
        while self.wait_s(now) == 0:
            names.append(self._pending.pop(0).robot)
        return names

    def warn_of_pending(self) -> None:
        """Log a warning about robots that were not killed because the search ended earlier."""
        if not self._pending:
            return
        import logging  # noqa: PLC0415 - nearly no run has anything to report

        for robot, after_s in self._pending:
            text = f"{robot} was to be killed after {after_s:g} s; the search took {self._took_s:.1f} s"
            logging.getLogger("robochoc").warning("%s", text)
