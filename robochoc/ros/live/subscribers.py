"""The wait for subscribers: what is published before they are there, they do not hear."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

SETTLE_S = 0.3
"""No new subscriber has come for so many seconds: then all are there."""


def await_subscribers(counts: Callable[[], Sequence[int]], wait_s: float) -> None:
    """Wait until each topic has a subscriber and no more come.

    Args:
        counts: Returns the number of subscribers of each topic.
        wait_s: The longest wait, in seconds.
    """
    until = time.monotonic() + wait_s
    before, since, pause_s = 0, time.monotonic(), 0.01
    while time.monotonic() < until:
        found = counts()
        now = time.monotonic()
        if sum(found) != before:
            before, since = sum(found), now
        if all(found) and now - since >= SETTLE_S:
            return
        time.sleep(pause_s)
        pause_s = min(2 * pause_s, 0.1)
