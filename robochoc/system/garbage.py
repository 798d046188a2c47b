"""Settings for Python's cyclic garbage collector while many long-lived objects are created."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

RARE_THRESHOLD = 100_000
"""The number of new objects minus deleted ones that starts a collection of the youngest. Python's default is 700."""
BLOCKS_BEFORE_COLLECTION = 64
"""The number of `collection_paused` blocks after which a full collection may be due."""
_GROWTH = 1.25
"""A full collection is due when this many times as many objects exist as after the last one, as in Python itself."""
_active_freezes: list[None] = []
"""One item for each active `garbage_frozen` block."""
_active_pauses: list[None] = []
"""One item for each active `collection_paused` block that has disabled the collector."""
_usual_thresholds: list[tuple[int, int, int]] = []
"""For each active `collection_seldom` block, the thresholds before the first one. Threads may end in any order."""
_thresholds_lock = Lock()


class _FullCollections:
    """Decides when a full collection is due.

    Counting objects as old resets Python's own counters, so a process with many searches would never have one.
    """

    def __init__(self) -> None:
        self._blocks = 0
        self._objects = 0

    def is_due(self) -> bool:
        """Return whether a full collection is due. All objects must be frozen."""
        self._blocks += 1
        if self._blocks < BLOCKS_BEFORE_COLLECTION:
            return False
        self._blocks = 0
        return gc.get_freeze_count() > _GROWTH * self._objects

    def collect(self) -> None:
        """Free all cyclic garbage, and count the objects that stay."""
        gc.collect()
        gc.freeze()
        self._objects = gc.get_freeze_count()
        gc.unfreeze()


_full_collections = _FullCollections()


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause the cyclic garbage collector, which would visit millions of new objects repeatedly without freeing any."""
    if not gc.isenabled():
        yield
        return
    _active_pauses.append(None)
    gc.disable()
    try:
        yield
    finally:
        count_as_old()
        gc.enable()
        _active_pauses.pop()


@contextmanager
def collection_seldom() -> Iterator[None]:
    """Collect cyclic garbage rarely.

    This is meant for a search in one thread: it has many more pending messages than Python expects young objects, and
    each collection would visit all of them.
    """
    with _thresholds_lock:
        before = _usual_thresholds[0] if _usual_thresholds else gc.get_threshold()
        _usual_thresholds.append(before)
        gc.set_threshold(max(RARE_THRESHOLD, before[0]) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        with _thresholds_lock:
            _usual_thresholds.pop()
            if not _usual_thresholds:
                gc.set_threshold(*before)


@contextmanager
def garbage_frozen() -> Iterator[None]:
    """Exclude existing objects from garbage collection in processes forked inside the block.

    A collection writes to each object and thus copies every inherited page. Without this function, 256 robots take
    twice as long to start.
    """
    gc.freeze()
    _active_freezes.append(None)
    try:
        yield
    finally:
        _active_freezes.pop()
        gc.unfreeze()


def resume_in_child() -> None:
    """Undo, in a forked process, the blocks of threads that only the parent has."""
    if _active_pauses:
        gc.enable()
    if _usual_thresholds:
        gc.set_threshold(*_usual_thresholds[0])


def count_as_old() -> None:
    """Make the collector treat all present objects as old, without visiting them, because most of them stay.

    After many calls, cyclic garbage among them is freed. If objects are frozen, this has no effect, because it would
    unfreeze them. `gc.get_freeze_count` visits each frozen object, so it is not called inside `garbage_frozen`.
    """
    if _active_freezes or gc.get_freeze_count():
        return
    gc.freeze()
    is_due = _full_collections.is_due()
    gc.unfreeze()
    if is_due:
        _full_collections.collect()
