"""Sets of integers as ranges."""

from __future__ import annotations


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
