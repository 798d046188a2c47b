"""Lists all solutions of a network in few searches.

The first searches have growing limits, so that the first solutions arrive early. A network with more solutions than the
last limit is divided by the values of one variable, again and again, until every part has few enough solutions.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace

from robochoc.solver.ace import SolverAnswer
from robochoc.solver.encoding import Codes, Network
from robochoc.solver.propagation import propagate

BATCHES = (10, 300, 10_000)
"""The limits of the first searches. The last one is also the maximum number of solutions of an undivided part."""

Search = Callable[[Network, int], SolverAnswer]
"""Returns the solutions of a network up to a limit."""


def listed_solutions(network: Network, search: Search, limit: int | None = None) -> Iterator[Codes]:
    """Yield each solution of `network` once; with a `limit`, at least that many if there are more."""
    network = propagate(network)
    known: dict[Codes, None] = {}
    for size in BATCHES:
        answer = search(network, size if limit is None else min(size, limit))
        for codes in answer.solutions:
            if codes not in known:
                known[codes] = None
                yield codes
        if answer.complete or (limit is not None and len(known) >= limit):
            return
    yield from _divided(network, search, known)


def _divided(network: Network, search: Search, known: Collection[Codes]) -> Iterator[Codes]:
    """Yield the solutions of `network` that are not `known`, value by value of a variable."""
    place = next((place for place, domain in enumerate(network.domains) if len(domain) > 1), None)
    if place is None:
        return
    for code in network.domains[place]:
        domains = (*network.domains[:place], (code,), *network.domains[place + 1 :])
        part = propagate(replace(network, domains=domains))
        if part.impossible:
            continue
        answer = search(part, BATCHES[-1])
        if answer.complete:
            yield from (codes for codes in answer.solutions if codes not in known)
        else:
            yield from _divided(part, search, known)


class Replayable:
    """The items of an iterator, which can be iterated several times. Items are requested when they are needed."""

    def __init__(self, items: Iterable[Sequence[int]]) -> None:
        self._source = iter(items)
        self._items: list[Sequence[int]] = []

    def __iter__(self) -> Iterator[Sequence[int]]:
        """Iterate over all items, from the first one."""
        number = 0
        while True:
            if number == len(self._items):
                item = next(self._source, None)
                if item is None:
                    return
                self._items.append(item)
            yield self._items[number]
            number += 1


def combinations(lists: Sequence[Iterable[Sequence[int]]]) -> Iterator[tuple[Sequence[int], ...]]:
    """Yield all combinations of items, one of each list. The first list is iterated once, the others repeatedly."""
    if not lists:
        yield ()
        return
    for first in lists[0]:
        for others in combinations(lists[1:]):
            yield first, *others
