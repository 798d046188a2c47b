"""Robots that are stopped (SIGSTOP): reported after a while, and lost once the patience is over.

A stopped robot neither dies nor answers, so the team would wait for it in silence. One that computes for long is not
stopped: the kernel knows the difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

REPORT_AFTER_S = 5.0
"""Seconds after which a stopped robot is reported."""
LONGEST_STEP_S = 1.0
"""No more is counted between two updates: this process may have been stopped as well, by the same Ctrl-Z."""


class StoppedRobots:
    """Counts how long robots have been stopped. A robot is lost after `patience_s` seconds (None: never)."""

    def __init__(self, patience_s: float | None = None) -> None:
        self._patience_s = patience_s
        self._updated: float | None = None
        self._stopped_s: dict[str, float] = {}
        self._reported: set[str] = set()

    def update(self, stopped: Iterable[str], now: float) -> Mapping[str, str]:
        """Note which robots are `stopped` at the time `now` (seconds), and return why robots are lost, by name.

        A robot that has been stopped for long, or continues after that, is reported by Python's `logging` as a warning.
        """
        passed = 0.0 if self._updated is None else min(now - self._updated, LONGEST_STEP_S)
        self._updated = now
        before = self._stopped_s
        self._stopped_s = {name: before[name] + passed if name in before else 0.0 for name in stopped}
        for name in self._reported - self._stopped_s.keys():
            self._reported.discard(name)
            _warn(f"{name} goes on")
        lost = {} if self._patience_s is None else {n: s for n, s in self._stopped_s.items() if s >= self._patience_s}
        for name, seconds in self._stopped_s.items():
            if seconds >= REPORT_AFTER_S and name not in self._reported and name not in lost:
                self._reported.add(name)
                _warn(f"{name} has been stopped (SIGSTOP) for {seconds:.0f} s; the others wait for it{self._hint}")
        for name in lost:
            del self._stopped_s[name]
            self._reported.discard(name)
        return {name: f"its process had been stopped (SIGSTOP) for {seconds:.0f} s" for name, seconds in lost.items()}

    @property
    def _hint(self) -> str:
        if self._patience_s is None:
            return " (kill -CONT lets it go on; --patience SECONDS gives it up)"
        return f" (kill -CONT lets it go on; after {self._patience_s:g} s it is lost)"


def _warn(text: str) -> None:
    import logging  # noqa: PLC0415 - nearly no run has anything to report

    logging.getLogger("robochoc").warning("%s", text)
