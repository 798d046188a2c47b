"""How a team changes: the paper's function delta (Section 3.1), which takes a DisCSP to the next one.

Pure: a team and a change go in, another team comes out. Where changes come from (a scenario, a robot that was lost)
is for others.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import assert_never

from robochoc.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Child,
    Constraint,
    Domain,
    Parent,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
)


class BadChange(ValueError):  # noqa: N818 - named for what was asked
    """A change that the team as it stands cannot take: what is wrong, and what was expected."""

    def __init__(self, message: str, hint: str) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


def changed(team: Team, changes: Iterable[Change]) -> Team:
    """`team` after `changes`, one after the other. Raises `BadChange`."""
    for change in changes:
        match change:
            case RemoveAgent(name):
                team = without(team, [_robot(team, name).name])
            case AddAgent(robot):
                team = _with_robot(team, robot)
            case RemoveValue(variable, value):
                team = _with_domain(team, variable, _less(team, variable, value))
            case AddValue(variable, value):
                team = _with_domain(team, variable, _more(team, variable, value))
            case AddConstraint(agent, parent, constraint):
                team = _with_constraint(team, agent, parent, constraint)
            case RemoveConstraint(agent, parent, name):
                team = _without_constraint(team, agent, parent, name)
            case never:
                assert_never(never)
    return team


def changed_by(team: Team, events: int) -> Team:
    """`team` after so many events of its scenario; changes that it cannot take, of robots that are lost, are left out.

    It has no scenario any more.
    """
    now = replace(team, scenario=()) if team.scenario else team
    for event in team.scenario[:events]:
        for change in event.changes:
            with suppress(BadChange):
                now = changed(now, [change])
    return now


def without(team: Team, names: Iterable[str]) -> Team:
    """`team` without the robots `names`, their variables, and every constraint that they share."""
    gone = set(names)
    lost = {variable.name for name in gone for variable in team[name].variables}

    def kept(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in constraints if lost.isdisjoint(constraint.variables))

    robots = []
    for robot in team.robots:
        if robot.name not in gone:
            parents = [replace(one, constraints=kept(one.constraints)) for one in robot.parents if one.name not in gone]
            below = [replace(one, constraints=kept(one.constraints)) for one in robot.children if one.name not in gone]
            robots.append(replace(robot, parents=tuple(parents), children=tuple(below)))
    return _shown(replace(team, robots=tuple(robots)))


def _shown(team: Team) -> Team:
    """`team`, in which robots still show what their parents' parts of partially known constraints look at."""
    for robot in team.robots:
        for child in robot.children:
            needed = {name for part in child.constraints for name in part.variables if team.owner[name] == child.name}
            hidden = needed.difference(team[child.name].interface) if needed else ()
            if hidden:
                below = team[child.name]
                team = _with(team, replace(below, shown=(*below.shown, *sorted(hidden))))
    return team


def rejoined(team: Team, robot: Robot) -> Team:
    """`team` with `robot` in the place of its namesake, as far as its neighbours are there. Raises `BadChange`."""
    known = {*team.owner, *(variable.name for variable in robot.variables)}

    def kept(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in constraints if known.issuperset(constraint.variables))

    parents = [replace(one, constraints=kept(one.constraints)) for one in robot.parents if one.name in team]
    below = [replace(one, constraints=kept(one.constraints)) for one in robot.children if one.name in team]
    then = team[robot.name]
    before = {one.name for one in then.parents} | {one.name for one in then.children}
    strangers = [name for name in ([one.name for one in parents] + [one.name for one in below]) if name not in before]
    if strangers:
        message = f"'{robot.name}' names '{strangers[0]}', which does not know it"
        raise BadChange(message, "name the neighbours that it had")
    team = _with(team, replace(robot, parents=tuple(parents), children=tuple(below)))
    gone = [name for constraint in team.constraints() for name in constraint.variables if name not in team.owner]
    if gone:
        raise BadChange(f"the variable '{gone[0]}' is gone, and others need it", "keep the robot's variables")
    return team


def _with_robot(team: Team, robot: Robot) -> Team:
    if robot.name in team:
        raise BadChange(f"the robot '{robot.name}' is there already", "a robot can come again once it has left")
    if team.robots and robot.kind is not team.kind:
        raise BadChange(f"'{robot.name}' is a {robot.kind} in a team of {team.kind}", "write the same type in both")
    if robot.children:
        hint = "it takes the lowest priority, so its file names parents only"
        raise BadChange(f"'{robot.name}' has the child '{robot.children[0].name}'", hint)
    taken = [variable.name for variable in robot.variables if variable.name in team.variables]
    if taken:
        raise BadChange(f"the variable '{taken[0]}' belongs to '{team.owner[taken[0]]}'", "rename one of them")
    for parent in robot.parents:
        _robot(team, parent.name)
    held = [(parent.name, constraint) for parent in robot.parents for constraint in parent.constraints]
    team = replace(team, robots=(*team.robots, replace(robot, parents=())))
    for parent in robot.parents:
        team = _linked(team, robot.name, parent.name, ())
    for name, constraint in held:
        team = _with_constraint(team, robot.name, name, constraint)
    return team


def _with_constraint(team: Team, agent: str, parent: str, constraint: Constraint) -> Team:
    rank = {name: place for place, name in enumerate(team.order)}
    names = {_robot(team, agent).name, _robot(team, parent).name}
    for name in constraint.variables:
        if name not in team.owner:
            raise BadChange(f"no robot has the variable '{name}'", "name a variable of the robots that are there")
        names.add(team.owner[name])
    owners = {team.owner[name] for name in constraint.variables}
    *_, above, lowest = sorted(names, key=rank.__getitem__) if len(names) > 1 else ("", agent, agent)
    if agent not in owners or parent not in owners or agent == parent:
        raise BadChange(
            f"the scope of '{constraint.name}' is not of '{agent}' and '{parent}'", "name variables of both"
        )
    if (above, lowest) != (parent, agent):
        hint = f'write agent="{lowest}" parent="{above}": it stands with the lowest of its scope, under the next'
        raise BadChange(f"'{constraint.name}' stands with '{agent}' under '{parent}'", hint)
    for owner in sorted(owners - {agent}, key=rank.__getitem__):
        told = tuple(name for name in constraint.variables if team.owner[name] == owner)
        team = _linked(team, agent, owner, told)
    holder = team[agent]
    parents = (
        replace(one, constraints=(*one.constraints, constraint)) if one.name == parent else one
        for one in holder.parents
    )
    return _with(team, replace(holder, parents=tuple(parents)))


def _linked(team: Team, child: str, parent: str, told: tuple[str, ...]) -> Team:
    """`team`, in which `parent` tells `child` the variables `told`, besides what it told already."""
    below, above = team[child], team[parent]
    if not any(one.name == parent for one in below.parents):
        team = _with(team, replace(below, parents=(*below.parents, Parent(parent))))
        above = replace(above, children=(*above.children, Child(child)))
    children = (
        replace(one, variables=tuple(dict.fromkeys((*one.variables, *told)))) if one.name == child else one
        for one in above.children
    )
    return _with(team, replace(above, children=tuple(children)))


def _without_constraint(team: Team, agent: str, parent: str, name: str) -> Team:
    holder = _robot(team, agent)
    here = [one for one in holder.parents if one.name == _robot(team, parent).name]
    if not any(constraint.name == name for one in here for constraint in one.constraints):
        raise BadChange(f"'{agent}' shares no constraint '{name}' with a parent '{parent}'", "name one that is there")
    parents = (
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == parent else one
        for one in holder.parents
    )
    above = team[parent]
    children = (  # the parent's part of a partially known constraint goes with the child's
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == agent else one
        for one in above.children
    )
    team = _with(_with(team, replace(holder, parents=tuple(parents))), replace(above, children=tuple(children)))
    return _shown(team)


def _less(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value not in domain:
        raise BadChange(f"'{variable}' has no value {value}", f"its domain has {len(domain)} values, but not this one")
    parts: list[range] = []
    for part in domain.ranges:
        pieces = (range(part.start, value), range(value + 1, part.stop)) if value in part else (part,)
        parts += [piece for piece in pieces if piece]
    return Domain(domain.name, tuple(parts))


def _more(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value in domain:
        raise BadChange(f"'{variable}' has the value {value} already", "add one that it does not have")
    ranges = sorted((*domain.ranges, range(value, value + 1)), key=lambda part: part.start)
    return Domain(domain.name, tuple(ranges))


def _domain(team: Team, variable: str) -> Domain:
    if variable not in team.variables:
        raise BadChange(f"no robot has the variable '{variable}'", "name a variable of the robots that are there")
    return team.variables[variable].domain


def _with_domain(team: Team, variable: str, domain: Domain) -> Team:
    robot = team[team.owner[variable]]
    own = (replace(one, domain=domain) if one.name == variable else one for one in robot.variables)
    return _with(team, replace(robot, variables=tuple(own)))


def _with(team: Team, robot: Robot) -> Team:
    """`team` with `robot` in the place of its namesake."""
    return replace(team, robots=tuple(robot if one.name == robot.name else one for one in team.robots))


def _robot(team: Team, name: str) -> Robot:
    if name not in team:
        raise BadChange(f"there is no robot '{name}'", "name a robot that is there at that time")
    return team[name]
