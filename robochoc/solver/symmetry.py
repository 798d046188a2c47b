"""Symmetries of a network: guessed from the variables' names, verified on its tables, and broken.

A symmetry permutes variables, and may reverse the order of the values, such that every table becomes a table of the
network. It is enough to find the lexicographically first solution in each orbit (lex-leader; Crawford, Ginsberg, Luks
and Roy, KR 1996). Wrong guesses are dropped. Only the guesses depend on names: `V3.1` is row 3, column 1 of a board
that may be mirrored or rotated.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from robochoc.solver.encoding import Codes, CodeTable, Component, Network

LARGEST_GROUP = 96
_NUMBER = re.compile(r"[0-9]+")


class Symmetry(NamedTuple):
    """Maps the value of variable i to variable `image[i]`, in reverse order of values if `reflects`."""

    image: Codes
    reflects: bool

    def then(self, other: Symmetry) -> Symmetry:
        """Return the composition: first this symmetry, then `other`."""
        return Symmetry(tuple([other.image[place] for place in self.image]), self.reflects != other.reflects)

    def applied(self, solution: Codes, highest: int) -> Codes:
        """Return the image of `solution`; `highest` is the largest code of the network."""
        moved = [0] * len(solution)
        for place, code in zip(self.image, solution, strict=True):
            moved[place] = highest - code if self.reflects else code
        return tuple(moved)


def symmetries(part: Component) -> tuple[Symmetry, ...]:
    """Return a group of symmetries of the network of `part`, without the identity; empty if none were found."""
    network = part.network
    if network.formulas:
        return ()
    identity = Symmetry(tuple(range(len(part.names))), reflects=False)
    is_symmetry = _verifier(network)
    generators = [guess for guess in _guesses(part.names) if guess != identity and is_symmetry(guess)]
    group = {identity}
    frontier = [identity]
    while frontier and len(group) <= LARGEST_GROUP:
        frontier = [new for old in frontier for generator in generators if (new := old.then(generator)) not in group]
        group.update(frontier)
    if frontier:
        return ()
    return tuple(sorted(group - {identity}))


def break_symmetries(network: Network, group: Sequence[Symmetry]) -> Network:
    """Return `network` without most of the solutions that are not the first in their orbit.

    x is the first if x <= g(x) for every g. For each g, this is required only at the first position that g may change:
    all positions before it are equal for every x.
    """
    highest = _highest(network)
    demanded: dict[Hashable, CodeTable] = {}
    for symmetry in group:
        source = {target: place for place, target in enumerate(symmetry.image)}
        place = next(place for place in range(len(source)) if source[place] != place or symmetry.reflects)
        other = source[place]
        left, right = network.domains[place], network.domains[other]
        rows = {(a, b) for a in left for b in right if a <= (highest - b if symmetry.reflects else b)}
        if place == other:
            demanded[place, symmetry.reflects] = CodeTable(
                (place,), allowed=True, rows=tuple((a,) for a, b in rows if a == b)
            )
        else:
            scope = tuple(sorted((place, other)))
            turned = rows if place < other else {(b, a) for a, b in rows}
            demanded[scope, symmetry.reflects, place] = CodeTable(scope, allowed=True, rows=tuple(sorted(turned)))
    return replace(network, tables=(*network.tables, *demanded.values()))


def orbits(solutions: Sequence[Codes], group: Sequence[Symmetry], network: Network) -> set[Codes]:
    """Return `solutions` and all their images under `group`."""
    highest = _highest(network)
    return {image for one in solutions for image in (one, *(g.applied(one, highest) for g in group))}


def _highest(network: Network) -> int:
    return max(code for domain in network.domains for code in domain)


def _guesses(names: Sequence[str]) -> Iterator[Symmetry]:
    """Yield possible symmetries of a problem whose variables are called `names`."""
    yield Symmetry(tuple(range(len(names))), reflects=True)
    coordinates = [tuple(map(int, _NUMBER.findall(name)[:3])) for name in names]
    place = {coordinate: index for index, coordinate in enumerate(coordinates)}
    if len(place) < len(names) or len({len(coordinate) for coordinate in coordinates}) > 1:
        return
    for moved in _moves(coordinates):
        if set(moved) == set(place):
            yield Symmetry(tuple([place[coordinate] for coordinate in moved]), reflects=False)


def _moves(coordinates: Sequence[tuple[int, ...]]) -> Iterator[list[tuple[int, ...]]]:
    """Yield the coordinates with each axis reversed, and with each pair of axes exchanged."""
    axes = range(len(coordinates[0]))
    for axis in axes:
        seen = {coordinate[axis] for coordinate in coordinates}
        ends = min(seen) + max(seen)
        yield [(*c[:axis], ends - c[axis], *c[axis + 1 :]) for c in coordinates]
    for one, other in itertools.combinations(axes, 2):
        order = [other if axis == one else one if axis == other else axis for axis in axes]
        yield [tuple([coordinate[axis] for axis in order]) for coordinate in coordinates]


def _verifier(network: Network) -> Callable[[Symmetry], bool]:
    """Return a test whether a guessed symmetry maps `network` to itself."""
    highest = _highest(network)
    content: dict[Hashable, frozenset[Codes]] = {}

    def rows(table: CodeTable, order: Codes, *, reflects: bool) -> frozenset[Codes]:
        alike = id(table.rows), order, reflects
        if alike not in content:
            turned = (tuple([row[index] for index in order]) for row in table.rows)
            content[alike] = frozenset(tuple([highest - code for code in row]) if reflects else row for row in turned)
        return content[alike]

    def moved(symmetry: Symmetry) -> Iterator[tuple[Codes, bool, frozenset[Codes]]]:
        for table in network.tables:
            scope = [symmetry.image[place] for place in table.scope]
            order = tuple(sorted(range(len(scope)), key=scope.__getitem__))
            yield tuple(sorted(scope)), table.allowed, rows(table, order, reflects=symmetry.reflects)

    present = set(moved(Symmetry(tuple(range(len(network.domains))), reflects=False)))

    def is_symmetry(symmetry: Symmetry) -> bool:
        for place, domain in enumerate(network.domains):
            image = {highest - code for code in domain} if symmetry.reflects else set(domain)
            if set(network.domains[symmetry.image[place]]) != image:
                return False
        return all(table in present for table in moved(symmetry))

    return is_symmetry
