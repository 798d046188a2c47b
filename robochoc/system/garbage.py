"""The cyclic garbage collector of Python, while much is built that stays."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = 100_000
"""Objects that are made, less those that are gone, before the youngest are looked through: Python's is 700."""
_active_freezes: list[None] = []
"""One for each `garbage_frozen` block that is active."""


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause the cyclic garbage collector: it would visit millions of new objects again and again, and free none."""
    if not gc.isenabled():
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        count_as_old()
        gc.enable()


@contextmanager
def collection_seldom() -> Iterator[None]:
    """Look for cyclic garbage seldom.

    For a search in one thread: what is under way is many times what Python expects of young objects, and stays until
    it arrives. Each look goes through all of it.
    """
    before = gc.get_threshold()
    gc.set_threshold(max(SELDOM, before[0]) if before[0] else 0, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def garbage_frozen() -> Iterator[None]:
    """Processes forked meanwhile do not look through what they inherit for garbage.

    To look is to write, and so to copy every page: without this 256 robots take twice as long to start.
    """
    gc.freeze()
    _active_freezes.append(None)
    try:
        yield
    finally:
        _active_freezes.pop()
        gc.unfreeze()


def count_as_old() -> None:
    """Let the collector take all that there is for old, without a look at it: most of it stays.

    Nothing is done where objects are frozen, as they would not be afterwards. `gc.get_freeze_count` visits each frozen
    object: inside `garbage_frozen` that would take long, and the answer is known.
    """
    if not _active_freezes and not gc.get_freeze_count():
        gc.freeze()
        gc.unfreeze()
