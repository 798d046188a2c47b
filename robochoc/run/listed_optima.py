"""The optima, or the Pareto front, of the team, combined from the lists of the robots of each tree.

See `protocols/inference/list_dpop`. Each root has numbered the optima of its tree, and each robot stores its value in
each of the first optima. Different trees share no constraint, so the optima of the team are all combinations of the
trees' optima.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.model.objectives import non_dominated
from robochoc.protocols.findings import Findings
from robochoc.run.incumbent import optima
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.errors import TooLargeError
from robochoc.verification.checker import RefutedError

MOST_POINTS = 100_000
"""The maximum number of points of a team's Pareto front."""
MOST_SUMS = 20 * MOST_POINTS
"""The maximum number of sums of two points of unconnected parts of a team."""


class _Tree(NamedTuple):
    """The robots of a tree, with the index of their value in each listed optimum."""

    places: dict[str, list[int]]
    listed: int


def combined_optima(compiled: CompiledTeam, result: SearchResult) -> tuple[int, list[dict[str, int]]] | None:
    """Return the number of optima and the listed assignments; None if the robots have not listed optima.

    Raises:
        RefutedError: if the robots of a tree have listed different numbers of optima, or two optima are equal.
    """
    listings = {name: found.listing for name, found in result.findings.items() if found.listing is not None}
    number = optima(result.findings)
    if number is None or len(listings) < len(compiled.team.robots):
        return None
    trees = [*_trees(result.findings, {name: one.places for name, one in listings.items()})]
    limit = min(number, *(one.limit for one in listings.values()))
    found = [_combined(compiled, trees, place) for place in range(min(limit, math.prod(one.listed for one in trees)))]
    if len({tuple(sorted(one.items())) for one in found}) < len(found):
        raise RefutedError(f"two of the optima listed for {compiled.team.name} are equal")
    return number, found


def combined_front(
    compiled: CompiledTeam, result: SearchResult, bases: Sequence[int]
) -> list[tuple[int, dict[str, int]]] | None:
    """Return the points of the Pareto front: their packed costs, ascending, each with an assignment.

    None: the robots have not listed points. `bases`: the number system of packed costs (`model/objectives.py`).

    Raises:
        RefutedError: if the robots of a tree have listed different numbers of points.
        TooLargeError: if the fronts of several trees have too many sums, or add up to too many points.
    """
    points = {name: found.points for name, found in result.findings.items() if found.points is not None}
    if len(points) < len(compiled.team.robots):
        return None
    total: dict[int, tuple[int, ...]] = {0: ()}
    trees = [*_trees(result.findings, {name: one.places for name, one in points.items()})]
    for tree in trees:
        packed = points[_root(result.findings, next(iter(tree.places)))].packed
        if len(packed) != tree.listed:
            raise RefutedError(f"a root of {compiled.team.name} has listed {len(packed)} costs of {tree.listed} points")
        if len(total) * len(packed) > MOST_SUMS:
            raise TooLargeError(
                f"the Pareto fronts of unconnected parts of {compiled.team.name} have {len(total):,} and"
                f" {len(packed):,} points, and at most {MOST_SUMS:,} sums of two points are compared"
            )
        sums = {
            one + other: (*before, place)
            for place, other in reversed([*enumerate(packed)])
            for one, before in reversed(total.items())
        }
        total = {one: sums[one] for one in non_dominated(sums, bases)}
        if len(total) > MOST_POINTS:
            raise TooLargeError(f"the Pareto front of {compiled.team.name} has more than {MOST_POINTS:,} points")
    return [(one, _assignment(compiled, trees, places)) for one, places in total.items()]


def _assignment(compiled: CompiledTeam, trees: Sequence[_Tree], numbers: Sequence[int]) -> dict[str, int]:
    """Return the assignment with these listed assignments of the trees."""
    assignment: dict[str, int] = {}
    for tree, number in zip(trees, numbers, strict=True):
        for name, places in tree.places.items():
            assignment.update(compiled[name].solution(places[number]))
    return assignment


def _combined(compiled: CompiledTeam, trees: Sequence[_Tree], number: int) -> dict[str, int]:
    """Return the assignment number `number` among all combinations of the trees' optima."""
    numbers = []
    for tree in trees:
        number, at = divmod(number, tree.listed)
        numbers.append(at)
    return _assignment(compiled, trees, numbers)


def _trees(findings: Mapping[str, Findings], listed: Mapping[str, list[int]]) -> Iterator[_Tree]:
    """Yield the trees, for the indices that each robot has `listed`.

    Raises:
        RefutedError: if the robots of a tree have listed different numbers of assignments.
    """
    trees: dict[str, dict[str, list[int]]] = {}
    for name, own in listed.items():
        trees.setdefault(_root(findings, name), {})[name] = own
    for root, places in trees.items():
        sizes = {len(own) for own in places.values()}
        if len(sizes) > 1:
            raise RefutedError(
                f"the robots below {root} list different numbers of assignments, from {min(sizes)} to {max(sizes)}"
            )
        yield _Tree(places, *sizes)


def _root(findings: Mapping[str, Findings], name: str) -> str:
    """Return the root of a robot's tree."""
    while (place := findings[name].place) is not None and place.parent is not None:
        name = place.parent
    return name
