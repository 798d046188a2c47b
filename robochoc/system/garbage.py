"""The cyclic garbage collector of Python, while much is built that stays."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = 100_000
"""Objects that are made, less those that are gone, before the youngest are looked through: Python's is 700."""


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


def count_as_old() -> None:
    """Let the collector take all that there is for old, without a look at it: most of it stays.

    Nothing is done where objects are frozen, as they would not be afterwards.
    """
    if not gc.get_freeze_count():
        gc.freeze()
        gc.unfreeze()
