"""Key frames: the samples of a motion between which a player interpolates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

Samples = npt.NDArray[np.float64]
"""Times: (T,). Positions: (T, 3). Attitudes: (T, 4), unit quaternions x, y, z, w."""
Keys = npt.NDArray[np.int64]
"""The indices of the chosen samples, in ascending order, including the first and the last."""

_NEARLY_ONE = 1 - 1e-9
"""Quaternions with a larger scalar product count as equal."""


def position_keys(times: Samples, positions: Samples, tolerance: float) -> Keys:
    """Return key samples between which linear interpolation deviates from the motion by at most `tolerance`."""

    def error(first: int, last: int, between: Samples) -> Samples:
        start, end = positions[first], positions[last]
        line = start + between[:, None] * (end - start)
        return _lengths(positions[first + 1 : last] - line)

    return _key_samples(times, error, tolerance)


def attitude_keys(times: Samples, attitudes: Samples, tolerance: float) -> Keys:
    """Return key samples of attitudes, with uniform rotations in between (slerp). `tolerance` is in radians."""

    def error(first: int, last: int, between: Samples) -> Samples:
        turned = slerp(attitudes[first], attitudes[last], between)
        return angle(turned, attitudes[first + 1 : last])

    return _key_samples(times, error, tolerance)


def slerp(start: Samples, end: Samples, between: Samples) -> Samples:
    """Return attitudes on the shortest rotation from `start` to `end`, at the fractions `between` (T,)."""
    cosine = float(start @ end)
    if cosine < 0:
        end, cosine = -end, -cosine
    if cosine > _NEARLY_ONE:
        turned = start + between[:, None] * (end - start)
        return np.asarray(turned / _lengths(turned)[:, None])
    total = np.arccos(cosine)
    parts = np.sin(np.outer(total, np.stack([1 - between, between]))) / np.sin(total)
    first, last = parts.reshape(2, -1, 1)
    return np.asarray(first * start + last * end)


def angle(one: Samples, other: Samples) -> Samples:
    """Return the angles between the attitudes in `one` and `other`, in radians."""
    # The sine is used, since the cosine of any small angle is 1 in floating point.
    apart = np.minimum(_lengths(one - other), _lengths(one + other))
    return np.asarray(4 * np.arcsin(np.clip(apart / 2, 0, 1)))


def _lengths(rows: Samples) -> Samples:
    return np.asarray(np.sqrt(np.einsum("...c,...c->...", rows, rows)))


def _key_samples(times: Samples, error: Callable[[int, int, Samples], Samples], tolerance: float) -> Keys:
    """Return the key samples by the Douglas-Peucker algorithm: the furthest sample between two keys becomes a key.

    D. Douglas, T. Peucker: Algorithms for the reduction of the number of points required to represent a digitized
    line. Cartographica 10(2), 1973.
    """
    keep = {0, len(times) - 1}
    spans = [(0, len(times) - 1)] if len(keep) > 1 else []
    while spans:
        first, last = spans.pop()
        if last == first + 1:
            continue
        between = (times[first + 1 : last] - times[first]) / (times[last] - times[first])
        errors = error(first, last, between)
        worst = int(errors.argmax())
        if errors[worst] > tolerance:
            middle = first + 1 + worst
            keep.add(middle)
            spans += [(first, middle), (middle, last)]
    return np.array(sorted(keep))
