"""The one place for limits of time in tests: they end what hangs, and say nothing of speed.

A test waits for an event, never for a time. How long that takes says something of the machine; speed is measured in
`benchmarks/`. pytest's own limit (`timeout` in pyproject.toml) is longer than several of these.
"""

from __future__ import annotations

import time
from collections.abc import Callable

HANG_S = 120.0
"""Whatever has not come after so many seconds will not come: the longest wait for one event."""
_POLL_S = 0.001
_LONGEST_POLL_S = 0.05


def wait_until(condition: Callable[[], bool], otherwise: str | Callable[[], str], within_s: float = HANG_S) -> None:
    """Look at `condition` again and again until it holds; fail with `otherwise` when it never does."""
    deadline, pause_s = time.monotonic() + within_s, _POLL_S
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(otherwise if isinstance(otherwise, str) else otherwise())
        time.sleep(pause_s)
        pause_s = min(2 * pause_s, _LONGEST_POLL_S)
