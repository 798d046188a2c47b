"""The optima of the team, combined from the optima that the robots of each tree have listed, and checked.

See `protocols/inference/list_dpop`. Each root has numbered the optima of its tree, and each robot stores its value in
each of the first optima. Different trees share no constraint, so the optima of the team are all combinations of the
trees' optima.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from robochoc.communication.search_result import SearchResult
from robochoc.protocols.findings import Findings
from robochoc.run.incumbent import optima
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import RefutedError


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
    trees = [*_trees(result.findings)]
    limit = min(number, *(one.limit for one in listings.values()))
    found = [_combined(compiled, trees, place) for place in range(min(limit, math.prod(one.listed for one in trees)))]
    if len({tuple(sorted(one.items())) for one in found}) < len(found):
        raise RefutedError(f"two of the optima listed for {compiled.team.name} are equal")
    return number, found


def _combined(compiled: CompiledTeam, trees: Sequence[_Tree], number: int) -> dict[str, int]:
    """Return the assignment number `number` among all combinations of the trees' optima."""
    assignment: dict[str, int] = {}
    left = number
    for tree in trees:
        left, at = divmod(left, tree.listed)
        for name, places in tree.places.items():
            assignment.update(compiled[name].solution(places[at]))
    return assignment


def _trees(findings: Mapping[str, Findings]) -> Iterator[_Tree]:
    """Yield the trees. Raises `RefutedError` if the robots of a tree have listed different numbers of optima."""
    trees: dict[str, dict[str, list[int]]] = {}
    for name, found in findings.items():
        if found.listing is not None:
            trees.setdefault(_root(findings, name), {})[name] = found.listing.places
    for root, places in trees.items():
        sizes = {len(own) for own in places.values()}
        if len(sizes) > 1:
            raise RefutedError(
                f"the robots below {root} have listed different numbers of optima, from {min(sizes)} to {max(sizes)}"
            )
        yield _Tree(places, *sizes)


def _root(findings: Mapping[str, Findings], name: str) -> str:
    """Return the root of a robot's tree."""
    while (place := findings[name].place) is not None and place.parent is not None:
        name = place.parent
    return name
