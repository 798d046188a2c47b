"""Changes of a team: the paper's function delta (Section 3.1), which maps a DisCSP to its successor.

The functions are pure: they return another team. Changes are caused by a scenario, by the robots' situation, or by the
loss or return of a robot.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import assert_never

from robochoc.model.magnitudes import MAX_COST, MagnitudeError, Magnitudes
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    ConstraintModel,
    Domain,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
)
from robochoc.model.team_edits import (
    ChangeError,
    check_holder,
    check_variable,
    check_variables_free,
    keep_needed_interfaces,
    link,
    no_robot,
    quoted,
    replace_robot,
    robot_named,
    shortened,
    with_shared_constraint,
    without_robots,
)


class ExcessiveChangeError(ChangeError):
    """Raised for a change with numbers that are too large (`model/magnitudes.py`) in any team."""


def apply_changes(team: Team, changes: Iterable[Change]) -> Team:
    """Return `team` after applying `changes` one after the other.

    Raises:
        ChangeError: if a change is impossible.
    """
    for change in changes:
        match change:
            case RemoveAgent(name):
                team = without_robots(team, [robot_named(team, name).name])
            case AddAgent(robot):
                team = _with_robot(team, robot)
            case RemoveValue(variable, value):
                team = _with_domain(team, variable, _without_value(team, variable, value))
            case AddValue(variable, value):
                team = _with_domain(team, variable, _with_value(team, variable, value))
            case AddConstraint(agent, parent, constraint):
                team = _with_constraint(team, agent, parent, constraint)
            case RemoveConstraint(agent, parent, name):
                team = _without_constraint(team, agent, parent, name)
            case never:
                assert_never(never)
        _check_magnitudes(team, change)
    return team


def _check_magnitudes(team: Team, change: Change) -> None:
    """Raise `ExcessiveChangeError` if numbers in `change`, which is already applied in `team`, are too large."""
    match change:
        case AddAgent(robot):
            changed = list(team[robot.name].constraints())
        case AddConstraint(constraint=constraint):
            changed = [constraint]
        case AddValue(variable):
            changed = [one for one in team.constraints() if variable in one.variables]
        case _:
            return
    domains = {name: variable.domain for name, variable in team.variables.items()}
    places = max(robot.costs.places for robot in team.robots)
    magnitudes = Magnitudes(domains, places, 2 * MAX_COST)  # twice: normalised costs begin at 0 (`model/costs.py`)
    for one in changed:
        try:
            magnitudes.check(one)
        except MagnitudeError as error:
            raise ExcessiveChangeError(error.message, error.hint, line=one.line) from None


def team_after_events(team: Team, events: int) -> Team:
    """Return `team` after the first `events` events of its scenario. The result has no scenario.

    Changes that are impossible because of lost robots are skipped.
    """
    now = replace(team, scenario=()) if team.scenario else team
    for event in team.scenario[:events]:
        now, _ = apply_possible_changes(now, event.changes)
    return now


def apply_possible_changes(team: Team, changes: Iterable[Change]) -> tuple[Team, list[Change]]:
    """Return `team` after applying those of `changes` that are possible, and these changes."""
    applied = []
    for change in changes:
        with suppress(ChangeError):
            team = apply_changes(team, [change])
            applied.append(change)
    return team, applied


def describe_change(change: Change, team: Team) -> str:
    """Return `change` in a few words, with the labels of values in `team`."""
    match change:
        case RemoveAgent(name):
            return f"-{name}"
        case AddAgent(robot):
            return f"+{robot.name}"
        case RemoveValue(variable, value):
            return f"{variable} without {_label(team, variable, value)}"
        case AddValue(variable, value):
            return f"{variable} with {_label(team, variable, value)}"
        case AddConstraint(agent, parent, constraint):
            return f"+{constraint.name} ({parent}, {agent})"
        case RemoveConstraint(agent, parent, name):
            return f"-{name} ({parent}, {agent})"
        case never:
            assert_never(never)


def _label(team: Team, variable: str, value: int) -> float | str:
    known = team.variables.get(variable)
    return known.domain.label(value) if known else value


def affected_robots(team: Team, change: Change) -> set[str]:
    """Return the names of the robots in `team` that are affected by `change`."""
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


def _with_robot(team: Team, robot: Robot) -> Team:
    _check_newcomer(team, robot)
    team = replace(team, robots=(*team.robots, replace(robot, parents=())))
    for parent in robot.parents:
        team = link(team, robot.name, parent.name, ())
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
    """Raise `ChangeError` for errors in a new robot that do not depend on its constraints."""
    own = quoted(robot.name)
    if robot.name in team:
        raise ChangeError(f"the robot {own} is already in the team", "remove it before it joins again")
    if team.robots and robot.kind is not team.kind:
        raise ChangeError(f"{own} is a {robot.kind} in a team of {team.kind}", "write the same type in both")
    if team.robots and robot.costs.maximize is not team.robots[0].costs.maximize:
        does, others = ("maximizes", "minimizes") if robot.costs.maximize else ("minimizes", "maximizes")
        hint = "write the same objective in both"
        raise ChangeError(f"{own} {does} costs in a team that {others} them", hint)
    check_variables_free(team, robot)
    for child in robot.children:
        hint = "list parents only: a robot that joins has the lowest priority"
        raise ChangeError(f"{own} has the child {quoted(child.name)}", hint, line=child.line)
    for parent in robot.parents:
        if parent.name not in team:
            raise no_robot(parent.name, parent.line)


def _check_parents(team: Team, robot: Robot, constraint: Constraint) -> None:
    """Raise `ChangeError` unless the other robots in the scope are parents of `robot`, as in any robot's file."""
    parents = {parent.name for parent in robot.parents}
    for name in constraint.variables:
        owner = team.owner.get(name, robot.name)
        if owner not in parents and owner != robot.name:
            message = f"{quoted(name)} belongs to {quoted(owner)}, which is not a parent of {quoted(robot.name)}"
            raise ChangeError(message, "list it under agents_parent as well")


def _with_constraint(team: Team, agent: str, parent: str, constraint: Constraint) -> Team:
    check_holder(team, agent, parent, constraint)
    return with_shared_constraint(team, constraint)


def _without_constraint(team: Team, agent: str, parent: str, name: str) -> Team:
    """Return `team` without these constraints, including both parts of partially known ones."""
    holder, above = robot_named(team, agent), robot_named(team, parent)
    sides = [
        *(one.constraints for one in holder.parents if one.name == parent),
        *(one.constraints for one in above.children if one.name == agent),
    ]
    known = dict.fromkeys(constraint.name for side in sides for constraint in side)
    if name not in known:
        hint = f"they share {shortened(' '.join(known))}" if known else "the parent is the robot of higher priority"
        message = f"{quoted(agent)} shares no constraint {quoted(name)} with a parent {quoted(parent)}"
        raise ChangeError(message, hint, missing=name)
    parents = (
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == parent else one
        for one in holder.parents
    )
    children = (
        replace(one, constraints=tuple(c for c in one.constraints if c.name != name)) if one.name == agent else one
        for one in above.children
    )
    team = replace_robot(
        replace_robot(team, replace(holder, parents=tuple(parents))), replace(above, children=tuple(children))
    )
    return keep_needed_interfaces(team)


def _without_value(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value not in domain:
        ranges = (f"{part[0]}..{part[-1]}" if len(part) > 1 else f"{part[0]}" for part in domain.ranges)
        values = map(str, map(domain.label, domain)) if domain.symbols else ranges
        hint = f"its domain is {shortened(' '.join(values))}" if domain.ranges else "its domain is empty"
        raise ChangeError(f"{quoted(variable)} has no value {domain.label(value)}", hint)
    parts: list[range] = []
    for part in domain.ranges:
        pieces = (range(part.start, value), range(value + 1, part.stop)) if value in part else (part,)
        parts += [piece for piece in pieces if piece]
    return replace(domain, ranges=tuple(parts))


def _with_value(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value in domain:
        raise ChangeError(f"{quoted(variable)} already has the value {domain.label(value)}", "add another value")
    ranges = sorted((*domain.ranges, range(value, value + 1)), key=lambda part: part.start)
    return replace(domain, ranges=tuple(ranges))


def _domain(team: Team, variable: str) -> Domain:
    check_variable(team, variable)
    return team.variables[variable].domain


def _with_domain(team: Team, variable: str, domain: Domain) -> Team:
    robot = team[team.owner[variable]]
    own = (replace(one, domain=domain) if one.name == variable else one for one in robot.variables)
    return replace_robot(team, replace(robot, variables=tuple(own)))


def rejoin(team: Team, robot: Robot) -> Team:
    """Return `team` with `robot`, which was lost and returns, in place of the robot with the same name.

    Constraints and links with robots outside the team are skipped. The links of its neighbours stay. The robot shows
    its neighbours the variables that their constraints need, even if its file does not list these variables.

    Raises:
        ChangeError: if the robot's file has different neighbours or another kind of problem, lacks a variable that
            others need, or has a partially known constraint.
    """
    _check_returning(team, robot)
    known = {*team.owner, *(variable.name for variable in robot.variables)}

    def possible(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in constraints if known.issuperset(constraint.variables))

    parents = [replace(one, constraints=possible(one.constraints)) for one in robot.parents if one.name in team]
    below = [replace(one, constraints=possible(one.constraints)) for one in robot.children if one.name in team]
    team = replace_robot(team, replace(robot, parents=tuple(parents), children=tuple(below)))
    missing = [name for constraint in team.constraints() for name in constraint.variables if name not in team.owner]
    if missing:
        message = f"the variable {quoted(missing[0])}, which other robots need, is missing"
        raise ChangeError(message, "keep the variables that the robot had")
    return _link_neighbours(team, robot.name)


def _check_returning(team: Team, robot: Robot) -> None:
    """Raise `ChangeError` unless `robot` can replace the robot with the same name in `team`."""
    before = team[robot.name]
    added = {one.name for one in robot.parents if one.name in team} - {one.name for one in before.parents}
    added |= {one.name for one in robot.children if one.name in team} - {one.name for one in before.children}
    for name in added:
        message = f"{quoted(robot.name)} lists {quoted(name)}, which was not such a neighbour before"
        raise ChangeError(message, "list the neighbours that it had")
    check_variables_free(team, robot)
    if robot.kind is not team.kind:
        raise ChangeError(f"{quoted(robot.name)} is a {robot.kind} in a team of {team.kind}", "write the same type")
    parts = (part for child in robot.children for part in child.constraints)
    secret = next((one for one in (*robot.shared, *parts) if one.model == ConstraintModel.PKC), None)
    if secret:
        message = f"{quoted(secret.name)} is partially known (PKC)"
        raise ChangeError(message, "use TKC: the links of a robot that comes back change their direction")


def _link_neighbours(team: Team, name: str) -> Team:
    """Return `team` with `name` and its neighbours listing each other, and the variables that constraints need."""
    own = {variable.name for variable in team[name].variables}
    for parent in team[name].parents:
        for constraint in parent.constraints:
            check_holder(team, name, parent.name, constraint)
            for owner in {team.owner[term] for term in constraint.variables} - {name}:
                team = link(team, name, owner, tuple(t for t in constraint.variables if team.owner[t] == owner))
    for other in team.robots:
        if any(child.name == name for child in other.children):
            team = link(team, name, other.name, ())
        if any(parent.name == name for parent in other.parents):
            needed = dict.fromkeys(term for constraint in other.shared for term in constraint.variables if term in own)
            team = link(team, other.name, name, tuple(needed))
    return team
