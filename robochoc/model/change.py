"""Changes of a team: the paper's function delta (Section 3.1), which takes a DisCSP to the next one.

Functions are pure: they take a team and a change, and return another team. Changes come from a scenario, from the
robots' situation, or from the loss of a robot.
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
    with_constraint_held,
    without_robots,
)


class ExcessiveChangeError(ChangeError):
    """A change with numbers that are too large (`model/magnitudes.py`) in any team."""


def apply_changes(team: Team, changes: Iterable[Change]) -> Team:
    """Return `team` after `changes`, one after the other.

    Raises:
        ChangeError: if the team cannot take one of them.
    """
    for change in changes:
        match change:
            case RemoveAgent(name):
                team = without_robots(team, [robot_named(team, name).name])
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
        _check_magnitudes(team, change)
    return team


def _check_magnitudes(team: Team, change: Change) -> None:
    """Raise `ExcessiveChangeError` if `change`, already applied in `team`, has numbers that are too large."""
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

    Changes that the team cannot take, because robots are lost, are left out.

    """
    now = replace(team, scenario=()) if team.scenario else team
    for event in team.scenario[:events]:
        now, _ = apply_possible_changes(now, event.changes)
    return now


def apply_possible_changes(team: Team, changes: Iterable[Change]) -> tuple[Team, list[Change]]:
    """Return `team` after those of `changes` that it can take, one after the other, and which these are."""
    taken = []
    for change in changes:
        with suppress(ChangeError):
            team = apply_changes(team, [change])
            taken.append(change)
    return team, taken


def describe_change(change: Change, team: Team) -> str:
    """Return `change` in a few words; values are told as the variables of `team` have them."""
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


def _label(team: Team, variable: str, value: int) -> int | str:
    known = team.variables.get(variable)
    return known.domain.label(value) if known else value


def affected_robots(team: Team, change: Change) -> set[str]:
    """Return the names of the robots of `team` that `change` concerns."""
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
    """Raise `ChangeError` for mistakes of a new robot that do not depend on its constraints."""
    own = quoted(robot.name)
    if robot.name in team:
        raise ChangeError(f"the robot {own} is there already", "a robot can come again once it has left")
    if team.robots and robot.kind is not team.kind:
        raise ChangeError(f"{own} is a {robot.kind} in a team of {team.kind}", "write the same type in both")
    if team.robots and robot.costs.maximize is not team.robots[0].costs.maximize:
        does, others = ("maximizes", "minimizes") if robot.costs.maximize else ("minimizes", "maximizes")
        hint = "write the same objective in both"
        raise ChangeError(f"{own} {does} costs in a team that {others} them", hint)
    check_variables_free(team, robot)
    for child in robot.children:
        hint = "it takes the lowest priority, so its file names parents only"
        raise ChangeError(f"{own} has the child {quoted(child.name)}", hint, line=child.line)
    for parent in robot.parents:
        if parent.name not in team:
            raise no_robot(parent.name, parent.line)


def _check_parents(team: Team, robot: Robot, constraint: Constraint) -> None:
    """Raise `ChangeError` unless the other robots of the scope are parents of `robot`, as in any robot's file."""
    parents = {parent.name for parent in robot.parents}
    for name in constraint.variables:
        owner = team.owner.get(name, robot.name)
        if owner not in parents and owner != robot.name:
            message = f"{quoted(name)} belongs to {quoted(owner)}, which is no parent of {quoted(robot.name)}"
            raise ChangeError(message, "list it under agents_parent as well")


def _with_constraint(team: Team, agent: str, parent: str, constraint: Constraint) -> Team:
    check_holder(team, agent, parent, constraint)
    return with_constraint_held(team, constraint)


def _without_constraint(team: Team, agent: str, parent: str, name: str) -> Team:
    """Return `team` without these constraints. Of a partially known one both parts go."""
    holder, above = robot_named(team, agent), robot_named(team, parent)
    sides = [
        *(one.constraints for one in holder.parents if one.name == parent),
        *(one.constraints for one in above.children if one.name == agent),
    ]
    there = dict.fromkeys(constraint.name for side in sides for constraint in side)
    if name not in there:
        hint = f"there are {shortened(' '.join(there))}" if there else "the parent is the higher of two that share one"
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


def _less(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value not in domain:
        ranges = (f"{part[0]}..{part[-1]}" if len(part) > 1 else f"{part[0]}" for part in domain.ranges)
        held = map(str, map(domain.label, domain)) if domain.symbols else ranges
        hint = f"its domain is {shortened(' '.join(held))}" if domain.ranges else "its domain is empty"
        raise ChangeError(f"{quoted(variable)} has no value {domain.label(value)}", hint)
    parts: list[range] = []
    for part in domain.ranges:
        pieces = (range(part.start, value), range(value + 1, part.stop)) if value in part else (part,)
        parts += [piece for piece in pieces if piece]
    return replace(domain, ranges=tuple(parts))


def _more(team: Team, variable: str, value: int) -> Domain:
    domain = _domain(team, variable)
    if value in domain:
        raise ChangeError(
            f"{quoted(variable)} has the value {domain.label(value)} already", "add one that it does not have"
        )
    ranges = sorted((*domain.ranges, range(value, value + 1)), key=lambda part: part.start)
    return replace(domain, ranges=tuple(ranges))


def _domain(team: Team, variable: str) -> Domain:
    check_variable(team, variable)
    return team.variables[variable].domain


def _with_domain(team: Team, variable: str, domain: Domain) -> Team:
    robot = team[team.owner[variable]]
    own = (replace(one, domain=domain) if one.name == variable else one for one in robot.variables)
    return replace_robot(team, replace(robot, variables=tuple(own)))
