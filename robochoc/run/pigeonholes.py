"""Finds robots that need different values of which there are too few, so that the team has no solution."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from typing import NamedTuple

from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.solver.encoding import cost_function

_TWO = 2
STARTS = 8
"""The number of robots from which a group is grown: those with the most neighbours for their number of values."""


class Crowd(NamedTuple):
    """A group of robots that need different values: the number of robots, and the smaller number of their values."""

    robots: int
    values: int


def find_crowd(team: Team) -> Crowd | None:
    """Return a group of robots that need different values of which there are too few; None if no group is found.

    Groups grow greedily, so a group may be missed. Robots with several variables are not examined.
    """
    links = _Links(team)
    for start in heapq.nlargest(STARTS, links.slack, key=links.slack.__getitem__):
        found = _grown(start, links)
        if found:
            return found
    return None


def _grown(start: str, links: _Links) -> Crowd | None:
    """Return a crowd that contains `start`, or None."""
    chosen, size, values = start, 1, links.domain(start)
    others, left = links.near(start), 0
    while len(others) != left:  # in a crowd, a robot other than `start` has as many neighbours as `start` has values
        left, least = len(others), len(values) - 1
        others = {name for name in others if len(others & links.near(name)) >= least}

    def merit(name: str) -> tuple[int, int, str]:
        return -len(links.domain(name) - values), len(others & links.near(name)), name

    while size + len(others) > len(values):
        others = {name for name in others & links.near(chosen) if links.differ(chosen, name)}
        if size + len(others) <= len(values):
            break
        chosen = max(others, key=merit)
        size += 1
        values |= links.domain(chosen)
        others.discard(chosen)
        if size > len(values):
            return Crowd(size, len(values))
    return None


class _Links:
    """The links between robots that may be in a crowd: those with one variable, and as many neighbours as values.

    Attributes:
        slack: For each robot that may be in a crowd, the number of its neighbours less the number of its values.
    """

    def __init__(self, team: Team) -> None:
        self._robots = {robot.name: robot for robot in team.robots}
        self.slack: dict[str, int] = {}
        for name, robot in self._robots.items():
            if len(robot.variables) == 1 and len(robot.variables[0].domain):
                slack = len(robot.parents) + len(robot.children) - len(robot.variables[0].domain)
                if slack >= 0:
                    self.slack[name] = slack
        self._domains: dict[str, frozenset[int]] = {}
        self._held: dict[str, dict[str, tuple[Constraint, ...]]] = {}
        self._near: dict[str, set[str]] = {}
        self._differing: dict[frozenset[str], bool] = {}
        self._examined: dict[tuple[object, ...], bool] = {}

    def domain(self, name: str) -> frozenset[int]:
        """Return the values of the robot called `name`."""
        if name not in self._domains:
            self._domains[name] = frozenset(self._robots[name].variables[0].domain)
        return self._domains[name]

    def near(self, name: str) -> set[str]:
        """Return the neighbours of the robot called `name` that may be in a crowd."""
        if name not in self._near:
            robot = self._robots[name]
            names = {parent.name for parent in robot.parents}.union(child.name for child in robot.children)
            self._near[name] = names & self.slack.keys()
        return self._near[name]

    def differ(self, one: str, other: str) -> bool:
        """Return whether a constraint forbids that two neighbours have the same value."""
        pair = frozenset((one, other))
        if pair not in self._differing:
            shared = (*self._constraints(one).get(other, ()), *self._constraints(other).get(one, ()))
            self._differing[pair] = any(self._forbids_equal_values(constraint, one, other) for constraint in shared)
        return self._differing[pair]

    def _constraints(self, name: str) -> Mapping[str, tuple[Constraint, ...]]:
        """Return the constraints that the robot called `name` holds, by parent."""
        if name not in self._held:
            self._held[name] = {parent.name: parent.constraints for parent in self._robots[name].parents}
        return self._held[name]

    def _forbids_equal_values(self, constraint: Constraint, one: str, other: str) -> bool:
        scope = {self._robots[name].variables[0].name for name in (one, other)}
        if len(constraint.variables) != _TWO or scope != set(constraint.variables):
            return False
        both = self.domain(one) & self.domain(other)
        definition = constraint.definition
        if isinstance(definition, Relation) and definition.arity == _TWO and definition.semantics != Semantics.SOFT:
            forbidden = definition.semantics == Semantics.CONFLICTS
            return all(((value, value) in definition.tuples) is forbidden for value in both)
        numbers = (term if isinstance(term, int) else None for term in constraint.parameters)
        same = (id(definition), constraint.cost, both, *numbers)
        if same not in self._examined:
            price = cost_function(constraint, constraint.variables)
            self._examined[same] = all(price((value, value)) == INFINITE for value in both)
        return self._examined[same]
