"""Flights of a swarm on straight lines: all drones at the same time, or one after the other, at a distance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from graphlib import CycleError, TopologicalSorter
from itertools import combinations

from robochoc.flight.layout import Point
from robochoc.system.errors import RobochocError

_SLACK_M = 1e-6


class TooCloseError(RobochocError):
    """Drones would come too close to each other. The message names two of them."""


def flights(places: Mapping[str, Point], targets: Mapping[str, Point], distance_m: float) -> list[dict[str, Point]]:
    """Return groups of targets, which are flown one after the other.

    The drones of a group fly on straight lines in equal times, so that their distance has one minimum.

    Args:
        places: The places of all drones in the air, by name.
        targets: The new places of some of them.
        distance_m: The least distance between two drones.

    Raises:
        TooCloseError: Two targets are too close, or no order of single flights keeps the distance.
    """
    left = {name: at for name, at in targets.items() if at != places[name]}
    for first, second in _close_pairs({**places, **targets}, {}, distance_m):
        raise TooCloseError(f"the places of {first} and {second} are less than {distance_m:g} m apart")
    if not left:
        return []
    if not any(_close_pairs(places, left, distance_m)):
        return [left]
    try:
        order = [*TopologicalSorter(_predecessors(places, left, distance_m)).static_order()]
    except CycleError as error:
        names = " and ".join(sorted({*error.args[1]}))
        raise TooCloseError(f"no order of straight flights keeps {distance_m:g} m between {names}") from None
    return [{name: left[name]} for name in order]


def _predecessors(places: Mapping[str, Point], targets: Mapping[str, Point], distance_m: float) -> dict[str, list[str]]:
    """Return for each drone with a target those that must fly before it. Raises `TooCloseError`."""
    before: dict[str, list[str]] = {name: [] for name in targets}
    for name, at in targets.items():
        line = (places[name], at)
        for other, place in places.items():
            if other == name:
                continue
            if _least_distance(line, (place, place)) < distance_m - _SLACK_M:
                if other not in targets:
                    raise TooCloseError(f"the straight flight of {name} passes {other}, which stays in place")
                before[name].append(other)
            if other in targets and _least_distance(line, (targets[other],) * 2) < distance_m - _SLACK_M:
                before[other].append(name)
    return before


def longest_m(places: Mapping[str, Point], targets: Mapping[str, Point]) -> float:
    """Return the length of the longest flight, in metres."""
    return max((math.dist(places[name], at) for name, at in targets.items()), default=0.0)


def _close_pairs(
    places: Mapping[str, Point], targets: Mapping[str, Point], distance_m: float
) -> Iterator[tuple[str, str]]:
    """Yield the pairs of drones that come closer than `distance_m`; drones without a target stay in place."""
    for first, second in combinations(places, 2):
        lines = [(places[name], targets.get(name, places[name])) for name in (first, second)]
        if _least_distance(*lines) < distance_m - _SLACK_M:
            yield first, second


def _least_distance(first: tuple[Point, Point], second: tuple[Point, Point]) -> float:
    """Return the least distance of two points that move along their lines in equal times."""
    start = [b - a for a, b in zip(first[0], second[0], strict=True)]
    end = [b - a for a, b in zip(first[1], second[1], strict=True)]
    change = [b - a for a, b in zip(start, end, strict=True)]
    square = sum(one * one for one in change)
    share = 0.0 if square == 0 else -sum(a * b for a, b in zip(start, change, strict=True)) / square
    share = min(max(share, 0.0), 1.0)
    return math.hypot(*(a + share * b for a, b in zip(start, change, strict=True)))
