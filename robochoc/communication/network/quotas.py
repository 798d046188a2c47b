"""A sender's quotas at a receiver: waiting frames and bytes, and frames, bytes and events per second. Pure.

The limits are far beyond what honest robots need. The measurement is in docs/guides/security.md.
"""

from __future__ import annotations

from typing import NamedTuple

MIB = 2**20
BURST_S = 60.0
"""The time for which unused quota stays available, in seconds. It can be used at once, as after an outage."""
EVENTS_A_SECOND = 10_000
"""The long-run rate at which a robot may report events to the master, per second."""
REPORTS_A_SECOND = 10
"""The rate at which a robot may report refusals and losses of other robots to the master, per second."""
NO_LIMIT = 1e15


class Share(NamedTuple):
    """The quota of one sender: waiting frames and bytes, and frames and bytes per second in the long run."""

    frames: int
    size: int
    frames_a_second: float = NO_LIMIT
    size_a_second: float = NO_LIMIT


NEIGHBOUR_SHARE = Share(200_000, 256 * MIB)
"""For a robot's neighbours. Their rate depends on the protocol, so only waiting frames (memory) are limited."""
ROBOT_SHARE = Share(50_000, 64 * MIB, 2_000, 16 * MIB)
"""For robots at the master."""
OBSERVER_SHARE = Share(1_000, 16 * MIB, 50, MIB)
"""For observers at the master. An observer sends a request and waits for the answer."""


class Allowance:
    """A rate `a_second`. Unused amounts remain available for `BURST_S` seconds. Times are on the monotonic clock."""

    def __init__(self, a_second: float, now: float) -> None:
        self._a_second = a_second
        self._left = BURST_S * a_second
        self._since = now

    def has(self, amount: float, now: float) -> bool:
        """Return whether `amount` is available at the time `now`."""
        grown = (now - self._since) * self._a_second
        self._left, self._since = min(BURST_S * self._a_second, self._left + grown), now
        return amount <= self._left

    def use(self, amount: float) -> None:
        """Use up `amount`."""
        self._left -= amount


class Usage:
    """The current use of one sender's `share`."""

    def __init__(self, share: Share, now: float) -> None:
        self.dropped = 0
        """The number of dropped frames that have not yet been reported."""
        self._share = share
        self._framing = self._size = 0
        self._often = Allowance(share.frames_a_second, now)
        self._much = Allowance(share.size_a_second, now)

    def accept(self, size: int, now: float) -> bool:
        """Return whether a frame of `size` bytes is within the quota. If so, count the frame as waiting."""
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
        """Record that a frame of `size` bytes no longer waits."""
        self._framing -= 1
        self._size -= size


class Backlog:
    """The stored frames from each sender, within the sender's quota, regardless of its rate."""

    def __init__(self, share: Share = NEIGHBOUR_SHARE) -> None:
        self._share = share._replace(frames_a_second=NO_LIMIT, size_a_second=NO_LIMIT)
        self._usage: dict[str, Usage] = {}

    def accept(self, sender: str, size: int) -> bool:
        """Return whether `size` more bytes from `sender` may be stored. If so, count them as stored."""
        return self._usage.setdefault(sender, Usage(self._share, 0.0)).accept(size, 0.0)

    def clear(self) -> None:
        """Reset all usage."""
        self._usage.clear()
