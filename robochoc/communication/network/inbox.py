"""The inbox: items that have come and wait to be read, bounded for each sender, so that no flood fills the memory.

Frames beyond a sender's share (`quotas.py`) are dropped before anybody looks at them, and counted: `FramesLost` stands
in the queue where the first of them was. That is a loss of that sender's, and of nobody else. Threads may share it.
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
    """The number of `frames` of `sender` that are lost for good. A hostile sender can fake losses by its numbers.

    `dropped`: they were more than its share, and were dropped here.
    """

    sender: str
    frames: int
    dropped: bool = False


class PresenceChanged(NamedTuple):
    """`name` is there, or is not any more as far as the router knows."""

    name: str
    there: bool


class WakeUp(NamedTuple):
    """A wake-up from this process: there is something new."""


Item = FrameArrived | FramesLost | PresenceChanged | WakeUp


class Inbox:
    """A queue of items, first in, first out. `share_of` says what a sender may have; it is asked once for each."""

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
        """Append `item`, or drop a frame, or news of a gap, that is beyond its sender's share."""
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
        """Return the oldest item, as soon as there is one.

        Raises `Empty` when there is none within `timeout` seconds.
        """
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
        """Return whether nothing waits."""
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
    """Bytes. A report of missing frames counts as an empty frame, as a hostile sender may cause any number of them."""
    return len(item.content) if isinstance(item, FrameArrived) else 0
