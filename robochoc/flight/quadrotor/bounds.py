"""What is too much to fly: drones, places, ways and flights that would take minutes, or more memory than there is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from robochoc.flight.log import SAMPLE_RATE_HZ
from robochoc.flight.quadrotor.airframe import Array

MOST_DRONES = 1_000
"""At a time: planning looks at all pairs."""
FARTHEST_M = 1e8
"""From the origin: there, places are still told apart to the tenth part of a micrometre."""
_NEAR_M = 1_000.0
"""Homes that are no further from the origin are flown where they are."""
LONGEST_WAY_M = 2_000.0
"""Of a drone in a leg. Planning looks at steps of a twentieth of a second, or less."""
_MOST_SAMPLES = 3_000_000
"""Of all drones together, some 300 bytes each: 1,000 drones for 100 s, or 100 for a quarter of an hour."""


def check_homes(names: Sequence[str], homes: Array) -> None:
    """That there is somebody to fly, not too many, and nobody too far away. Raises `ValueError`."""
    if not names:
        raise ValueError("there are no drones to fly: the run has decided about none")
    if len(names) > MOST_DRONES:
        raise ValueError(f"{len(names):,} drones are more than can be flown at a time ({MOST_DRONES:,})")
    check_near(names, homes)


def check_near(names: Sequence[str], places: npt.ArrayLike) -> None:
    """That all `places` (K, 3), of what is called so, can be reckoned with. Raises `ValueError`."""
    places = np.array(places, dtype=np.float64).reshape(-1, 3)
    far = np.flatnonzero(~(np.abs(places) <= FARTHEST_M).all(axis=1))  # true of nan as well
    if len(far):
        place = ", ".join(f"{part:g}" for part in places[far[0]])
        raise ValueError(
            f"{names[far[0]]}: the place ({place}) m is more than {FARTHEST_M:,.0f} m away; ask for a smaller scale"
        )


def origin_of(homes: Array) -> Array:
    """(3,): where drones with such `homes` are flown around: 0, or whole metres amid them where that is far away."""
    return np.zeros(3) if np.abs(homes).max() <= _NEAR_M else np.asarray(np.round(homes.mean(axis=0)))


def check_ways(names: Sequence[str], starts: Array, places: Array) -> None:
    """That nobody has too far to go from `starts` to `places` (N, 3). Raises `ValueError`."""
    ways = np.sqrt(np.square(places - starts).sum(1))
    longest = int(ways.argmax())
    if not ways[longest] <= LONGEST_WAY_M:
        raise ValueError(
            f"{names[longest]} would have {ways[longest]:,.0f} m to fly, and {LONGEST_WAY_M:,.0f} m is the most: "
            "ask for a smaller scale"
        )


def check_length(drones: int, until_s: float) -> None:
    """That what is noted of a flight up to `until_s` can be kept. Raises `ValueError`."""
    most_s = _MOST_SAMPLES / drones / SAMPLE_RATE_HZ
    if until_s > most_s:
        raise ValueError(f"the flight would last {until_s:,.0f} s; of {drones:,} drones {most_s:,.0f} s are the most")
