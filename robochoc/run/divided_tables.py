"""The size of DPOP's tables on a pseudo-tree if robots have several variables (`protocols/inference/dpop_groups.py`).

The estimate follows DPOP's rules on the declared problem: a table contains only the variables that constraints name,
and variables of a robot are independent unless private constraints connect them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from robochoc.model.problem import Team

Axes = Mapping[str, frozenset[str]]
"""The axes of a table: for each robot, its variables."""


def divided_tables(
    team: Team, above: dict[str, tuple[str, ...]], sizes: Mapping[str, int], enough: float
) -> tuple[int, float]:
    """Return the induced width of a pseudo-tree, and the number of entries of the largest join.

    Args:
        team: The team.
        above: Each robot's neighbours above it in the tree, roots first.
        sizes: The number of values of each robot.
        enough: The analysis stops at the first join with more entries than this.
    """
    place = {name: number for number, name in enumerate(above)}
    domains = {one.name: len(one.domain) for robot in team.robots for one in robot.variables}
    parts = {robot.name: _parts([one.variables for one in robot.private]) for robot in team.robots}
    waiting: dict[str, list[Axes]] = {name: [] for name in above}
    for axes in _scopes(team):
        waiting[max(axes, key=place.__getitem__)].append(axes)
    separators = {name: {*others} for name, others in above.items()}
    width, largest = 0, 1.0

    def cells(axes: Axes) -> int:
        return math.prod([min(sizes[name], math.prod([domains[one] for one in seen])) for name, seen in axes.items()])

    for name in reversed(above):
        separator = separators.pop(name)
        width = max(width, len(separator))
        parent = max(separator, key=place.__getitem__, default="")
        for axes in _groups(name, waiting.pop(name), parts[name]):
            largest = max(largest, float(min(cells(axes), 10**300)))
            left = {one: seen for one, seen in axes.items() if one != name}
            if left:
                waiting[parent].append(left)
        if largest > enough:
            break
        if separator:
            separators[parent] |= separator - {parent}
    return width, largest


def _scopes(team: Team) -> list[Axes]:
    """Return the axes of the table of each shared constraint."""
    owner = team.owner
    found = {frozenset(one.variables) for robot in team.robots for one in robot.shared}
    scopes: list[Axes] = []
    for scope in sorted(found, key=sorted):
        axes: dict[str, set[str]] = {}
        for variable in scope:
            axes.setdefault(owner[variable], set()).add(variable)
        scopes.append({name: frozenset(seen) for name, seen in axes.items()})
    return scopes


def _parts(scopes: Iterable[Iterable[str]]) -> list[frozenset[str]]:
    """Return the sets of a robot's variables that private constraints connect."""
    parts: list[frozenset[str]] = []
    for scope in scopes:
        linked = [part for part in parts if not part.isdisjoint(scope)]
        parts = [*(part for part in parts if part not in linked), frozenset(scope).union(*linked)]
    return parts


def _groups(name: str, tables: Sequence[Axes], parts: Sequence[frozenset[str]]) -> list[Axes]:
    """Return the axes of the joins of the robot called `name`."""
    drafts: list[tuple[frozenset[str], Axes]] = []
    free: list[Axes] = []
    for axes in tables:
        own = axes.get(name, frozenset())
        if not own:
            free.append(axes)
            continue
        here = own.union(*(part for part in parts if not part.isdisjoint(own)))
        linked = [draft for draft in drafts if not here.isdisjoint(draft[0])]
        drafts = [draft for draft in drafts if draft not in linked]
        drafts.append((here.union(*(draft[0] for draft in linked)), _joined([axes, *(draft[1] for draft in linked)])))
    found = [axes for _, axes in drafts]
    for axes in sorted(free, key=lambda axes: -sum(map(len, axes.values()))):
        if not any(all(seen <= onto.get(one, frozenset()) for one, seen in axes.items()) for onto in found):
            found.append(axes)
    return found


def _joined(tables: Iterable[Axes]) -> Axes:
    """Return the axes of the join of `tables`."""
    found: dict[str, frozenset[str]] = {}
    for axes in tables:
        for name, seen in axes.items():
            found[name] = found.get(name, frozenset()) | seen
    return found
