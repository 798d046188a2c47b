"""Sets of integers as ranges."""

from __future__ import annotations

from collections.abc import Iterable


def merge_ranges(ranges: tuple[range, ...]) -> tuple[range, ...]:
    """Return `ranges`, in which those that follow one another without a gap are one. Nothing else is changed.

    What is no set (ranges that overlap, are empty or have a step) stays as it is, for whoever checks it.
    """
    together: list[range] = []
    for part in ranges:
        before = together[-1] if together else range(0)
        if before and part and before.step == part.step == 1 and before.stop == part.start:
            together[-1] = range(before.start, part.stop)
        else:
            together.append(part)
    return ranges if len(together) == len(ranges) else tuple(together)


def united_ranges(ranges: Iterable[range]) -> tuple[range, ...]:
    """Return the ranges of all integers in `ranges`, which have no step and may overlap: disjoint and ascending."""
    together: list[range] = []
    for part in sorted(filter(None, ranges), key=lambda one: one.start):
        if together and part.start <= together[-1].stop:
            together[-1] = range(together[-1].start, max(together[-1].stop, part.stop))
        else:
            together.append(part)
    return tuple(together)
