"""How a team changes: the paper's function delta (Section 3.1), which takes a DisCSP to the next one.

Pure: a team and a change go in, another team comes out. Where changes come from (a scenario, a robot that was lost)
is for others.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import assert_never

from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
)

LONGEST = 60
"""So many characters of a name, or of a list, stand in a message."""


class ChangeError(ValueError):
    """A change that the team as it stands cannot take: what is wrong, and what was expected.

    `missing` is the name that nobody has, if that is what is wrong. `line` is where an added robot's file says what
    cannot be (0: it is not one line that is to blame).
    """

    def __init__(self, message: str, hint: str, *, missing: str = "", line: int = 0) -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint
        self.missing = missing
        self.line = line


def apply_changes(team: Team, changes: Iterable[Change]) -> Team:
    """`team` after `changes`, one after the other. Raises `ChangeError`."""
    for change in changes:
        match change:
            case RemoveAgent(name):
                team = without_robots(team, [_robot(team, name).name])
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


def team_after_events(team: Team, events: int) -> Team:
    """`team` after so many events of its scenario; changes that it cannot take, of robots that are lost, are left out.

    It has no scenario any more.
    """
    now = replace(team, scenario=()) if team.scenario else team
    for event in team.scenario[:events]:
        now, _ = apply_possible_changes(now, event.changes)
    return now


def apply_possible_changes(team: Team, changes: Iterable[Change]) -> tuple[Team, list[Change]]:
    """`team` after those of `changes` that it can take, one after the other, and which these are."""
    taken = []
    for change in changes:
        with suppress(ChangeError):
            team = apply_changes(team, [change])
            taken.append(change)
    return team, taken


def describe_change(change: Change) -> str:
    """`change` in a few words."""
    match change:
        case RemoveAgent(name):
            return f"-{name}"
        case AddAgent(robot):
            return f"+{robot.name}"
        case RemoveValue(variable, value):
            return f"{variable} without {value}"
        case AddValue(variable, value):
            return f"{variable} with {value}"
        case AddConstraint(agent, parent, constraint):
            return f"+{constraint.name} ({parent}, {agent})"
        case RemoveConstraint(agent, parent, name):
            return f"-{name} ({parent}, {agent})"
        case never:
            assert_never(never)


def affected_robots(team: Team, change: Change) -> set[str]:
    """The robots of `team` that `change` is about."""
    match change:
        case RemoveAgent(name):
            return {name}
        case AddAgent():
            return set()
        case RemoveValue(variable, _) | AddValue(variable, _):
            return {team.owner[variable]} if variable in team.owner else set()
        case AddConstraint(agent, parent, _) | RemoveConstraint(agent, parent, _):
            return {agent, parent}
        case never:
            assert_never(never)


def without_robots(team: Team, names: Iterable[str]) -> Team:
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
    return _still_showing(replace(team, robots=tuple(robots)))


def keep_interfaces(team: Team, before: Team) -> Team:
    """Return `team`, what is left of `before`: its robots still show all that they showed there, to nobody."""
    return replace(team, robots=tuple(replace(robot, shown=before[robot.name].interface) for robot in team.robots))


def _still_showing(team: Team) -> Team:
    """`team`, in which robots still show what their parents' parts of partially known constraints look at."""
    for robot in team.robots:
        for child in robot.children:
            needed = {name for part in child.constraints for name in part.variables if team.owner[name] == child.name}
            hidden = needed.difference(team[child.name].interface) if needed else ()
            if hidden:
                below = team[child.name]
                team = _with(team, replace(below, shown=(*below.shown, *sorted(hidden))))
    return team


def rejoin(team: Team, robot: Robot) -> Team:
    """`team` with `robot` in the place of its namesake, as far as its neighbours are there. Raises `ChangeError`.

    Links that its neighbours have with it stay, and it tells them what their constraints need, whether its file says
    so or leaves that to follow from the constraints.
    """
    known = {*team.owner, *(variable.name for variable in robot.variables)}

    def kept(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in constraints if known.issuperset(constraint.variables))

    parents = [replace(one, constraints=kept(one.constraints)) for one in robot.parents if one.name in team]
    below = [replace(one, constraints=kept(one.constraints)) for one in robot.children if one.name in team]
    then = team[robot.name]
    strangers = {one.name for one in parents} - {one.name for one in then.parents}
    strangers |= {one.name for one in below} - {one.name for one in then.children}
    for name in strangers:
        message = f"{_quoted(robot.name)} names {_quoted(name)}, which does not know it as such"
        raise ChangeError(message, "name the neighbours that it had")
    _check_taken(team, robot)
    if robot.kind is not team.kind:
        raise ChangeError(f"{_quoted(robot.name)} is a {robot.kind} in a team of {team.kind}", "write the same type")
    private = [
        one.name
        for one in (*robot.shared, *(c for child in robot.children for c in child.constraints))
        if one.model is ConstraintModel.PKC
    ]
    if private:
        raise ChangeError(
            f"{_quoted(private[0])} is partially known (PKC)", "a robot that comes back turns its links: use TKC"
        )
    team = _with(team, replace(robot, parents=tuple(parents), children=tuple(below)))
    gone = [name for constraint in team.constraints() for name in constraint.variables if name not in team.owner]
    if gone:
        raise ChangeError(f"the variable {_quoted(gone[0])} is gone, and others need it", "keep the robot's variables")
    return _told(team, robot.name)


def _told(team: Team, name: str) -> Team:
    """`team`, in which `name` and its neighbours list each other, and tell each other what their constraints need."""
    own = {variable.name for variable in team[name].variables}
    for parent in team[name].parents:
        for constraint in parent.constraints:
            _check_holder(team, name, parent.name, constraint)
            for owner in {team.owner[term] for term in constraint.variables} - {name}:
                team = _linked(team, name, owner, tuple(t for t in constraint.variables if team.owner[t] == owner))
    for other in team.robots:
        if any(child.name == name for child in other.children):
            team = _linked(team, name, other.name, ())
        if any(parent.name == name for parent in other.parents):
            needed = dict.fromkeys(term for constraint in other.shared for term in constraint.variables if term in own)
            team = _linked(team, other.name, name, tuple(needed))
    return team


def _with_robot(team: Team, robot: Robot) -> Team:
    _check_newcomer(team, robot)
    team = replace(team, robots=(*team.robots, replace(robot, parents=())))
    for parent in robot.parents:
        team = _linked(team, robot.name, parent.name, ())
    for parent in robot.parents:
        for constraint in parent.constraints:
            try:
                _check_parents(team, robot, constraint)
                team = _with_constraint(team, robot.name, parent.name, constraint)
            except ChangeError as bad:
                bad.line = constraint.line
                raise
    return team


def _check_newcomer(team: Team, robot: Robot) -> None:
    """What can be said before its constraints are looked at."""
    own = _quoted(robot.name)
    if robot.name in team:
        raise ChangeError(f"the robot {own} is there already", "a robot can come again once it has left")
    if team.robots and robot.kind is not team.kind:
        raise ChangeError(f"{own} is a {robot.kind} in a team of {team.kind}", "write the same type in both")
    _check_taken(team, robot)
    for child in robot.children:
        hint = "it takes the lowest priority, so its file names parents only"
        raise ChangeError(f"{own} has the child {_quoted(child.name)}", hint, line=child.line)
    for parent in robot.parents:
        if parent.name not in team:
            raise _no_robot(parent.name, parent.line)


def _check_taken(team: Team, robot: Robot) -> None:
    for variable in robot.variables:
        owner = team.owner.get(variable.name, robot.name)
        if owner != robot.name:
            raise ChangeError(
                f"the variable {_quoted(variable.name)} belongs to {_quoted(owner)}", "rename one of them"
            )


def _check_parents(team: Team, robot: Robot, constraint: Constraint) -> None:
    """As in any robot's file, everybody else in the scope is one of the file's parents."""
    parents = {parent.name for parent in robot.parents}
    for name in constraint.variables:
        owner = team.owner.get(name, robot.name)
        if owner not in parents and owner != robot.name:
            message = f"{_quoted(name)} belongs to {_quoted(owner)}, which is no parent of {_quoted(robot.name)}"
            raise ChangeError(message, "list it under agents_parent as well")


def _with_constraint(team: Team, agent: str, parent: str, constraint: Constraint) -> Team:
    _check_holder(team, agent, parent, constraint)
    rank = {name: place for place, name in enumerate(team.order)}
    owners = {team.owner[name] for name in constraint.variables}
    for owner in sorted(owners - {agent}, key=rank.__getitem__):
        told = tuple(name for name in constraint.variables if team.owner[name] == owner)
        team = _linked(team, agent, owner, told)
    holder = team[agent]
    parents = (
        replace(one, constraints=(*one.constraints, constraint)) if one.name == parent else one
        for one in holder.parents
    )
    return _with(team, replace(holder, parents=tuple(parents)))


def _check_holder(team: Team, agent: str, parent: str, constraint: Constraint) -> None:
    """A constraint stands with the lowest robot of its scope, under the next."""
    _robot(team, agent), _robot(team, parent)
    if agent == parent:
        raise ChangeError(f"{_quoted(agent)} is no parent of its own", "a shared constraint is one with another robot")
    for name in constraint.variables:
        _check_variable(team, name)
    owners = {team.owner[name] for name in constraint.variables}
    what = _quoted(constraint.name)
    if agent not in owners or parent not in owners:
        message = f"the scope of {what} is not of {_quoted(agent)} and {_quoted(parent)}"
        raise ChangeError(message, "name variables of both")
    *_, above, lowest = (name for name in team.order if name in owners)
    if (above, lowest) != (parent, agent):
        hint = f"the lowest robot of its scope holds it, {_quoted(lowest)}, under the next, {_quoted(above)}"
        raise ChangeError(f"{what} does not stand with {_quoted(agent)} under {_quoted(parent)}", hint)


def _linked(team: Team, child: str, parent: str, told: tuple[str, ...]) -> Team:
    """`team`, in which `parent` tells `child` the variables `told`, besides what it told already."""
    below, above = team[child], team[parent]
    if not any(one.name == parent for one in below.parents):
        below = replace(below, parents=(*below.parents, Parent(parent)))
    if not any(one.name == child for one in above.children):
        above = replace(above, children=(*above.children, Child(child)))
    children = (
        replace(one, variables=tuple(dict.fromkeys((*one.variables, *told)))) if one.name == child else one
        for one in above.children
    )
    return _with(_with(team, below), replace(above, children=tuple(children)))


def _without_constraint(team: Team, agent: str, parent: str, name: str) -> Team:
    """Both parts of a partially known constraint go, as either side may have left its own out."""
    holder, above = _robot(team, agent), _robot(team, parent)
    sides = [
        *(one.constraints for one in holder.parents if one.name == parent),
        *(one.constraints for one in above.children if one.name == agent),
    ]
    there = dict.fromkeys(constraint.name for side in sides for constraint in side)
    if name not in there:
        hint = f"there are {_shown(' '.join(there))}" if there else "the parent is the higher of two that share one"
        message = f"{_quoted(agent)} shares no constraint {_quoted(name)} with a parent {_quoted(parent)}"
        raise ChangeError(message, hint, missing=name)
    parents = (
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == parent else one
        for one in holder.parents
    )
    children = (
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == agent else one
        for one in above.children
    )
    team = _with(_with(team, replace(holder, parents=tuple(parents))), replace(above, children=tuple(children)))
    return _still_showing(team)


def _less(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value not in domain:
        ranges = (f"{part[0]}..{part[-1]}" if len(part) > 1 else f"{part[0]}" for part in domain.ranges)
        hint = f"its domain is {_shown(' '.join(ranges))}" if domain.ranges else "its domain is empty"
        raise ChangeError(f"{_quoted(variable)} has no value {value}", hint)
    parts: list[range] = []
    for part in domain.ranges:
        pieces = (range(part.start, value), range(value + 1, part.stop)) if value in part else (part,)
        parts += [piece for piece in pieces if piece]
    return Domain(domain.name, tuple(parts))


def _more(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value in domain:
        raise ChangeError(f"{_quoted(variable)} has the value {value} already", "add one that it does not have")
    ranges = sorted((*domain.ranges, range(value, value + 1)), key=lambda part: part.start)
    return Domain(domain.name, tuple(ranges))


def _domain(team: Team, variable: str) -> Domain:
    _check_variable(team, variable)
    return team.variables[variable].domain


def _check_variable(team: Team, variable: str) -> None:
    if variable not in team.owner:
        hint = "name a variable of the robots that are there"
        raise ChangeError(f"no robot has the variable {_quoted(variable)}", hint, missing=variable)


def _with_domain(team: Team, variable: str, domain: Domain) -> Team:
    robot = team[team.owner[variable]]
    own = (replace(one, domain=domain) if one.name == variable else one for one in robot.variables)
    return _with(team, replace(robot, variables=tuple(own)))


def _with(team: Team, robot: Robot) -> Team:
    """`team` with `robot` in the place of its namesake."""
    return replace(team, robots=tuple(robot if one.name == robot.name else one for one in team.robots))


def _robot(team: Team, name: str) -> Robot:
    if name not in team:
        raise _no_robot(name)
    return team[name]


def _no_robot(name: str, line: int = 0) -> ChangeError:
    hint = "name a robot that is there at that time"
    return ChangeError(f"there is no robot {_quoted(name)}", hint, missing=name, line=line)


def _quoted(name: str) -> str:
    return f"'{_shown(name)}'"


def _shown(text: str) -> str:
    """`text` short enough to stand in a message."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 3]}..."
