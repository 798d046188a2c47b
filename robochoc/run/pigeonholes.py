"""Finds robots that need different values of which there are too few, so that the team has no solution."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from typing import NamedTuple

from robochoc.model.problem import INFINITE, Constraint, Domain, Team
from robochoc.solver.encoding import cost_function

_TWO = 2
STARTS = 16
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
    chosen, size, values = start, 1, set(links.domain(start))
    near = links.near(start)
    others = {name for name in near if len(near & links.near(name)) >= len(values) - 1}
    if len(others) < len(values):  # in a crowd, each robot has as many such neighbours as values
        return None

    def merit(name: str) -> tuple[int, int, str]:
        return -len(values.union(links.domain(name))), len(others & links.near(name)), name

    while others := {name for name in others & links.near(chosen) if links.differ(chosen, name)}:
        chosen = max(others, key=merit)
        size += 1
        values.update(links.domain(chosen))
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
            if len(robot.variables) == 1:
                slack = len(robot.parents) + len(robot.children) - len(robot.variables[0].domain)
                if slack >= 0:
                    self.slack[name] = slack
        self._near: dict[str, set[str]] = {}
        self._examined: dict[tuple[object, ...], bool] = {}

    def domain(self, name: str) -> Domain:
        """Return the domain of the robot called `name`."""
        return self._robots[name].variables[0].domain

    def near(self, name: str) -> set[str]:
        """Return the neighbours of the robot called `name` that may be in a crowd."""
        if name not in self._near:
            robot = self._robots[name]
            names = {parent.name for parent in robot.parents}.union(child.name for child in robot.children)
            self._near[name] = names & self.slack.keys()
        return self._near[name]

    def differ(self, one: str, other: str) -> bool:
        """Return whether a constraint forbids that two neighbours have the same value."""
        pairs = ((self._robots[one], other), (self._robots[other], one))
        held = (parent.constraints for robot, name in pairs for parent in robot.parents if parent.name == name)
        scope = {self._robots[name].variables[0].name: self.domain(name) for name in (one, other)}
        return any(self._forbids_equal_values(constraint, scope) for constraints in held for constraint in constraints)

    def _forbids_equal_values(self, constraint: Constraint, scope: Mapping[str, Domain]) -> bool:
        if len(constraint.variables) != _TWO or scope.keys() != set(constraint.variables):
            return False
        domains = [scope[name] for name in constraint.variables]
        numbers = (term if isinstance(term, int) else None for term in constraint.parameters)
        same = (id(constraint.definition), constraint.cost, *numbers, *(domain.ranges for domain in domains))
        if same not in self._examined:
            price = cost_function(constraint, constraint.variables)
            both = (value for value in domains[0] if value in domains[1])
            self._examined[same] = all(price((value, value)) == INFINITE for value in both)
        return self._examined[same]
