"""Explanations of nogoods, and their invalidation by changes of the problem.

A nogood derived from constraints and domains holds as long as these are unchanged (DynABT: Omomowo, Arana and Ahriz
2008). Constraints and domains are identified by keys, which are the same for every robot.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from robochoc.model.problem import Constraint, Robot, Team


class KeyedConstraint(NamedTuple):
    """A shared constraint and its key."""

    key: str
    constraint: Constraint


class Invalidated(NamedTuple):
    """The explanations that a change has invalidated.

    Attributes:
        keys: The keys of removed constraints and of domains with new values.
        agents: The agents that have left or have other interface variables.
    """

    keys: frozenset[str]
    agents: frozenset[str]


def constraints_above(robot: Robot) -> Iterator[KeyedConstraint]:
    """Yield the constraints that `robot` shares with its parents.

    Constraints with the same name and the same parent share a key: a scenario that removes one of them removes all.
    """
    for parent in robot.parents:
        for constraint in parent.constraints:
            yield KeyedConstraint(f"{robot.name}<{parent.name}:{constraint.name}", constraint)


def parts_below(robot: Robot) -> Iterator[tuple[str, KeyedConstraint]]:
    """Yield the parts of `robot` in partially known constraints with children, each with the child's name."""
    for child in robot.children:
        for constraint in child.constraints:
            yield child.name, KeyedConstraint(f"{robot.name}>{child.name}:{constraint.name}", constraint)


def domain_key(agent: str) -> str:
    """Return the key of an agent's domain; it explains that other values are impossible."""
    return f"{agent}="


def invalidated_by(old: Team, new: Team) -> Invalidated:
    """Return the explanations in `old` that `new` invalidates: removed constraints, grown domains, removed robots."""
    keys = set()
    agents = set()
    for robot in old.robots:
        now = new.get(robot.name)
        if now is None or now.interface != robot.interface:
            agents.add(robot.name)
        if now is None or _has_grown(robot, now):
            keys.add(domain_key(robot.name))
        present = _all_held(now) if now else []
        keys.update(one.key for one in _all_held(robot) if one not in present)
    return Invalidated(frozenset(keys), frozenset(agents))


def _all_held(robot: Robot) -> list[KeyedConstraint]:
    return [*constraints_above(robot), *(part for _, part in parts_below(robot))]


def _has_grown(old: Robot, new: Robot) -> bool:
    """Return whether `new` may have a local solution that `old` did not have."""
    if [variable.name for variable in old.variables] != [variable.name for variable in new.variables]:
        return True
    if any(constraint not in new.private for constraint in old.private):
        return True
    return any(
        value not in before.domain
        for before, after in zip(old.variables, new.variables, strict=True)
        if before.domain != after.domain
        for value in after.domain
    )
