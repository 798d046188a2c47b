"""Quotas of a sender at a receiver: waiting frames and bytes, and frames, bytes and events a second. Pure.

The limits are far beyond what honest robots need: docs/guides/security.md has the measurement.
"""

from __future__ import annotations

from typing import NamedTuple

MIB = 2**20
BURST_S = 60.0
"""Seconds for which unused quota is available. It can be used at once: after an outage, messages arrive together."""
EVENTS_A_SECOND = 10_000
"""The long-run rate at which a robot may report events to the master."""
REPORTS_A_SECOND = 10
"""The rate at which a robot may report refusals and losses of other robots to the master."""
NO_LIMIT = 1e15


class Share(NamedTuple):
    """The quota of one sender: waiting frames and bytes, and frames and bytes a second in the long run."""

    frames: int
    size: int
    frames_a_second: float = NO_LIMIT
    size_a_second: float = NO_LIMIT


NEIGHBOUR_SHARE = Share(200_000, 256 * MIB)
"""At a robot: the rate of neighbours depends on the protocol, but waiting frames use memory."""
ROBOT_SHARE = Share(50_000, 64 * MIB, 2_000, 16 * MIB)
"""At the master."""
OBSERVER_SHARE = Share(1_000, 16 * MIB, 50, MIB)
"""At the master: an observer sends a request, and waits for the answer."""


class Allowance:
    """A rate `a_second`. Unused amounts of the last `BURST_S` seconds remain available. Times are monotonic."""

    def __init__(self, a_second: float, now: float) -> None:
        self._a_second = a_second
        self._left = BURST_S * a_second
        self._since = now

    def has(self, amount: float, now: float) -> bool:
        """Return whether `amount` is left at the time `now`."""
        grown = (now - self._since) * self._a_second
        self._left, self._since = min(BURST_S * self._a_second, self._left + grown), now
        return amount <= self._left

    def use(self, amount: float) -> None:
        """Use up `amount`."""
        self._left -= amount


class Usage:
    """The present usage of one sender's `share`."""

    def __init__(self, share: Share, now: float) -> None:
        self.dropped = 0
        """Dropped frames that were not reported yet."""
        self._share = share
        self._framing = self._size = 0
        self._often = Allowance(share.frames_a_second, now)
        self._much = Allowance(share.size_a_second, now)

    def accept(self, size: int, now: float) -> bool:
        """Return whether a frame of `size` bytes is within the quota; if so, count it as waiting."""
        if self._framing >= self._share.frames or self._size + size > self._share.size:
            return False
        if not (self._often.has(1, now) and self._much.has(size, now)):
            return False
        self._often.use(1)
        self._much.use(size)
        self._framing += 1
        self._size += size
        return True

    def release(self, size: int) -> None:
        """Note that a frame of `size` bytes no longer waits."""
        self._framing -= 1
        self._size -= size


class Backlog:
    """The stored frames of each sender, within its quota, regardless of its rate."""

    def __init__(self, share: Share = NEIGHBOUR_SHARE) -> None:
        self._share = share._replace(frames_a_second=NO_LIMIT, size_a_second=NO_LIMIT)
        self._usage: dict[str, Usage] = {}

    def accept(self, sender: str, size: int) -> bool:
        """Return whether `size` more bytes of `sender` may be stored; if so, count them as stored."""
        return self._usage.setdefault(sender, Usage(self._share, 0.0)).accept(size, 0.0)

    def clear(self) -> None:
        """Reset all usage."""
        self._usage.clear()
