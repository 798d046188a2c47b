"""Runs without an end: a way into a strongly connected part of the state graph, and a fair closed walk in it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cache, partial
from typing import NamedTuple

from robochoc.exploration.components import strong_components
from robochoc.exploration.team_state import Channel, Delivery


class Edge(NamedTuple):
    """A step to the state with the number `after`. `channels`: the channels that deliver a message."""

    after: int
    delivery: Delivery
    channels: frozenset[Channel]


class EndlessRun(NamedTuple):
    """A run from the start: the steps to a state, and steps from this state back to it."""

    path: list[Delivery]
    cycle: list[Delivery]


Edges = Callable[[int], Iterable[Edge]]
Waiting = Callable[[int], set[Channel]]


def endless_run(after: Callable[[int], Iterable[int]], edges: Edges, waiting: Waiting) -> EndlessRun | None:
    """Return a run that can go on forever although each message arrives, or None if there is none.

    There is one in a set of states, each reachable from each other, if every channel that is never empty in them
    delivers a message. The path is one of the shortest to the set; the cycle need not be.

    Args:
        after: Returns the states after a state whose steps were explored. The first state has the number 0.
        edges: Returns all steps from a state to explored states, also steps that were not explored.
        waiting: Returns the channels that are not empty in a state.
    """
    for component in strong_components(0, after):
        inside = partial(_inside, component, edges)
        if not _never_served(component, [edge for number in component for edge in inside(number)], waiting):
            path = [] if 0 in component else _way(0, edges, lambda edge: edge.after in component)  # noqa: B023 - used at once
            cycle = _fair_walk(path[-1].after if path else 0, cache(inside), waiting)
            return EndlessRun([edge.delivery for edge in path], [edge.delivery for edge in cycle])
    return None


def _inside(component: set[int], edges: Edges, number: int) -> list[Edge]:
    return [edge for edge in edges(number) if edge.after in component]


def _never_served(numbers: Iterable[int], edges: Iterable[Edge], waiting: Waiting) -> set[Channel]:
    """Return the channels that are never empty in the states `numbers` and deliver nothing on `edges`."""
    return set.intersection(*map(waiting, numbers)).difference(*(edge.channels for edge in edges))


def _fair_walk(start: int, edges: Edges, waiting: Waiting) -> list[Edge]:
    """Return a closed walk from `start` on which every channel delivers a message or is empty in a state."""
    walk = _way(start, edges, lambda edge: edge.after == start)
    while unserved := _never_served({edge.after for edge in walk}, walk, waiting):
        walk += _way(start, edges, partial(_serves, min(unserved), waiting))
        if walk[-1].after != start:
            walk += _way(walk[-1].after, edges, lambda edge: edge.after == start)
    return walk


def _serves(channel: Channel, waiting: Waiting, edge: Edge) -> bool:
    return channel in edge.channels or channel not in waiting(edge.after)


def _way(start: int, edges: Edges, is_last: Callable[[Edge], bool]) -> list[Edge]:
    """Return a shortest sequence of steps from `start` to a step with the property `is_last`, which must exist."""
    before: dict[int, tuple[int, Edge]] = {}

    def back(number: int, last: Edge) -> Iterator[Edge]:
        yield last
        while number != start:
            number, edge = before[number]
            yield edge

    level = [start]
    while level:
        following = []
        for number in level:
            for edge in edges(number):
                if is_last(edge):
                    return [*back(number, edge)][::-1]
                if edge.after != start and edge.after not in before:
                    before[edge.after] = number, edge
                    following.append(edge.after)
        level = following
    raise ValueError(f"no such step can be reached from state {start}")
