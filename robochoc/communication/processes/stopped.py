"""Robots that are stopped (SIGSTOP): told after a while, and given up once patience is over.

A stopped robot neither dies nor answers, so the team would wait for it without a word. One that computes for long is
not stopped: the kernel knows the difference.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

TOLD_S = 5.0
"""So long a robot is stopped before that is told."""
_LONGEST_LOOK_S = 1.0
"""No more is counted between two looks: whoever looks may have been stopped as well, by the same Ctrl-Z."""


class Stopped:
    """Keeps count of how long robots have been stopped. `patience_s`: then one is lost (None: never)."""

    def __init__(self, patience_s: float | None = None) -> None:
        self._patience_s = patience_s
        self._looked: float | None = None
        self._since_s: dict[str, float] = {}
        self._told: set[str] = set()

    def look(self, stopped: Iterable[str], now: float) -> Mapping[str, str]:
        """Robots are `stopped` at the time `now` (seconds); return those for which patience is over, and why.

        Whoever has been stopped for long, or goes on after that, is told of by Python's `logging`, as a warning.
        """
        passed = 0.0 if self._looked is None else min(now - self._looked, _LONGEST_LOOK_S)
        self._looked = now
        before, self._since_s = self._since_s, {}
        for name in stopped:
            self._since_s[name] = before[name] + passed if name in before else 0.0
        for name in self._told - self._since_s.keys():
            self._told.discard(name)
            _tell(f"{name} goes on")
        lost = {name: s for name, s in self._since_s.items() if self._patience_s is not None and s >= self._patience_s}
        for name, seconds in self._since_s.items():
            if seconds >= TOLD_S and name not in self._told and name not in lost:
                self._told.add(name)
                _tell(f"{name} has been stopped (SIGSTOP) for {seconds:.0f} s; the others wait for it{self._hint}")
        for name in lost:
            del self._since_s[name]
            self._told.discard(name)
        return {name: f"its process had been stopped (SIGSTOP) for {seconds:.0f} s" for name, seconds in lost.items()}

    @property
    def _hint(self) -> str:
        if self._patience_s is None:
            return " (kill -CONT lets it go on; --patience SECONDS gives it up)"
        return f" (kill -CONT lets it go on; after {self._patience_s:g} s it is lost)"


def _tell(what: str) -> None:
    import logging  # noqa: PLC0415 - nearly no run has anything to tell

    logging.getLogger("robochoc").warning("%s", what)
