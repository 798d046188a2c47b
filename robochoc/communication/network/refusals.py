"""Reports refusals: each kind is reported, but a flood of refusals causes few reports.

A refused participant may try again without end, under new names. So each kind is reported at its 1st, 10th, 100th, ...
occurrence, with the count so far, and the numbers of kinds and participants are limited.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

from robochoc.system.plain_text import on_one_line

KINDS = 50
"""The maximum number of kinds of refusals distinguished for one member."""
WHO = 1000
"""The maximum number of refused members distinguished."""
LONGEST = 200
"""The maximum number of characters in a text. Refused data may have any length."""
_OTHERS = "others"
_ELSE = ("other requests", "see the previous refusals")


class Refusals:
    """Counts refusals, and calls `report` with who, what and why. Thread-safe."""

    def __init__(self, report: Callable[[str, str, str], None]) -> None:
        self._report = report
        self._counts: dict[str, dict[tuple[str, str], int]] = {}
        self._lock = threading.Lock()

    def note(self, who: str, what: str, why: str) -> None:
        """Count that `who` was refused `what`, for the reason `why`."""
        who, what, why = (on_one_line(word[:LONGEST]) for word in (who, what, why))
        with self._lock:
            if who not in self._counts and len(self._counts) >= WHO:
                who = _OTHERS
            kinds = self._counts.setdefault(who, {})
            if (what, why) not in kinds and len(kinds) >= KINDS:
                what, why = _ELSE
            count = kinds[what, why] = kinds.get((what, why), 0) + 1
            if str(count).rstrip("0") == "1":
                self._report(who, what, why if count == 1 else f"{why} ({count:,} times so far)")
