"""Bounds of what can be simulated: drones, places, paths and flights that would take minutes, or too much memory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robochoc.flight.log import SAMPLE_RATE_HZ
from robochoc.flight.quadrotor.airframe import Array

DRONES_MAX = 1_000
"""At a time: planning looks at all pairs."""
COORDINATE_MAX_M = 1e8
"""Up to there, floating point distinguishes places by a tenth of a micrometre."""
_CLOSE_M = 1_000.0
"""Homes that are no further from the origin are flown where they are."""
PATH_MAX_M = 2_000.0
"""Of a drone in a leg. Planning looks at steps of a twentieth of a second, or less."""
_SAMPLES_MAX = 3_000_000
"""Of all drones together, some 300 bytes each: 1,000 drones for 100 s, or 100 for a quarter of an hour."""


def check_homes(names: Sequence[str], homes: Array) -> None:
    """Raise `ValueError` if there are no drones, too many, or one is too far away."""
    if not names:
        raise ValueError("there are no drones to fly: the run has decided about none")
    if len(names) > DRONES_MAX:
        raise ValueError(f"{len(names):,} drones are more than can be flown at a time ({DRONES_MAX:,})")
    check_near(names, homes)


def check_near(names: Sequence[str], places: npt.ArrayLike) -> None:
    """Raise `ValueError` for the first of `places` (K, 3) that is too far away, or not finite."""
    places = np.array(places, dtype=np.float64).reshape(-1, 3)
    far = np.flatnonzero(~(np.abs(places) <= COORDINATE_MAX_M).all(axis=1))  # true of nan as well
    if len(far):
        place = ", ".join(f"{part:g}" for part in places[far[0]])
        raise ValueError(
            f"{names[far[0]]}: the place ({place}) m is over {COORDINATE_MAX_M:,.0f} m away; ask for a smaller scale"
        )


def origin_of(homes: Array) -> Array:
    """Return the origin (3,) to fly around: 0, or, where `homes` are far away, whole metres amid them."""
    return np.zeros(3) if np.abs(homes).max() <= _CLOSE_M else np.asarray(np.round(homes.mean(axis=0)))


def check_paths(names: Sequence[str], starts: Array, places: Array) -> None:
    """Raise `ValueError` if a drone has too far to fly from `starts` to `places` (N, 3)."""
    ways = np.sqrt(np.square(places - starts).sum(1))
    longest = int(ways.argmax())
    if not ways[longest] <= PATH_MAX_M:
        raise ValueError(
            f"{names[longest]} would have {ways[longest]:,.0f} m to fly, and {PATH_MAX_M:,.0f} m is the most: "
            "ask for a smaller scale"
        )


def check_length(drones: int, until_s: float) -> None:
    """Raise `ValueError` if the log of a flight up to `until_s` would be too long."""
    most_s = _SAMPLES_MAX / drones / SAMPLE_RATE_HZ
    if until_s > most_s:
        raise ValueError(f"the flight would last {until_s:,.0f} s; of {drones:,} drones {most_s:,.0f} s are the most")
