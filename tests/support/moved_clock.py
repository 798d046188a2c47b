"""A clock that a test moves, in place of a module's `time`."""

from __future__ import annotations

import math


class MovedClock:
    """Stands still until the test ends the time that programs have, whatever they have."""

    def __init__(self) -> None:
        self._now = 0.0

    def monotonic(self) -> float:
        """Return the seconds since the clock was made: none, or more than anybody waits."""
        return self._now

    def end(self) -> None:
        """Let all time be over."""
        self._now = math.inf
