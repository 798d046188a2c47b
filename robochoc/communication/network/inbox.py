"""The inbox: a queue of arrived items, with a bound for each sender, so that no flood can fill the memory.

Frames beyond a sender's quota (`quotas.py`) are dropped unread and counted: a `FramesLost` replaces the first of these
frames in the queue. The loss affects only this sender. Thread-safe.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from queue import Empty
from typing import NamedTuple

from robochoc.communication.network.quotas import NEIGHBOUR_SHARE, Share, Usage


class FrameArrived(NamedTuple):
    """A frame from `sender`."""

    sender: str
    content: bytes


class FramesLost(NamedTuple):
    """A number of `frames` from `sender` were permanently lost. A hostile sender can fake losses by its frame numbers.

    `dropped`: the frames exceeded the sender's quota, and were dropped by this inbox.
    """

    sender: str
    frames: int
    dropped: bool = False


class PresenceChanged(NamedTuple):
    """A report by the router that `name` has become present or absent."""

    name: str
    there: bool


class WakeUp(NamedTuple):
    """A wake-up by this process."""


Item = FrameArrived | FramesLost | PresenceChanged | WakeUp


class Inbox:
    """A FIFO queue of items. `share_of` returns a sender's quota, and is called once for each sender."""

    def __init__(
        self,
        share_of: Callable[[str], Share] = lambda _sender: NEIGHBOUR_SHARE,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._share_of = share_of
        self._clock = clock
        self._items: deque[Item] = deque()
        self._usage: dict[str, Usage] = {}
        self._changed = threading.Condition()

    def put(self, item: Item) -> None:
        """Append `item`. Drop a frame, or a report of a gap, that exceeds its sender's quota."""
        with self._changed:
            if isinstance(item, FrameArrived | FramesLost):
                usage = self._usage_of(item.sender)
                if not usage.accept(_size(item), self._clock()):
                    usage.dropped += 1
                    if usage.dropped > 1:
                        return
                    item = FramesLost(item.sender, 1, dropped=True)
            self._items.append(item)
            self._changed.notify()

    def get(self, timeout: float | None = None) -> Item:
        """Return the oldest item. Raises `Empty` if there is none within `timeout` seconds."""
        with self._changed:
            if not self._changed.wait_for(lambda: self._items, timeout):
                raise Empty
            return self._taken()

    def get_nowait(self) -> Item:
        """Return the oldest item. Raises `Empty`."""
        with self._changed:
            if not self._items:
                raise Empty
            return self._taken()

    def empty(self) -> bool:
        """Return whether there are no items."""
        return not self._items

    def _usage_of(self, sender: str) -> Usage:
        usage = self._usage.get(sender)
        if usage is None:
            usage = self._usage[sender] = Usage(self._share_of(sender), self._clock())
        return usage

    def _taken(self) -> Item:
        item = self._items.popleft()
        match item:
            case FramesLost(sender, dropped=True):
                usage = self._usage[sender]
                frames, usage.dropped = usage.dropped, 0
                return item._replace(frames=frames)
            case FrameArrived() | FramesLost():
                self._usage[item.sender].release(_size(item))
            case _:
                pass
        return item


def _size(item: FrameArrived | FramesLost) -> int:
    """Return the size of an item in bytes. A report of lost frames counts as an empty frame, since it can be forged."""
    return len(item.content) if isinstance(item, FrameArrived) else 0
