"""A robot that was lost comes back into its team."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from robochoc.model.problem import Constraint, ConstraintModel, Robot, Team
from robochoc.model.team_edits import ChangeError, check_holder, check_variables_free, link, quoted, replace_robot


def rejoin(team: Team, robot: Robot) -> Team:
    """Return `team` with `robot` back in it. It replaces the robot of the same name.

    Constraints and links with robots that are not there are left out. The links of its neighbours stay. It shows them
    the variables that their constraints need, also where its file does not say so.

    Raises:
        ChangeError: if its file names other neighbours than before, is of another kind, lacks a variable that others
            need, or has a partially known constraint.
    """
    _check_returning(team, robot)
    known = {*team.owner, *(variable.name for variable in robot.variables)}

    def kept(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(constraint for constraint in constraints if known.issuperset(constraint.variables))

    parents = [replace(one, constraints=kept(one.constraints)) for one in robot.parents if one.name in team]
    below = [replace(one, constraints=kept(one.constraints)) for one in robot.children if one.name in team]
    team = replace_robot(team, replace(robot, parents=tuple(parents), children=tuple(below)))
    gone = [name for constraint in team.constraints() for name in constraint.variables if name not in team.owner]
    if gone:
        raise ChangeError(f"the variable {quoted(gone[0])} is gone, and others need it", "keep the robot's variables")
    return _link_neighbours(team, robot.name)


def _check_returning(team: Team, robot: Robot) -> None:
    """Raise `ChangeError` unless `robot` can take the place that it had in `team`."""
    before = team[robot.name]
    added = {one.name for one in robot.parents if one.name in team} - {one.name for one in before.parents}
    added |= {one.name for one in robot.children if one.name in team} - {one.name for one in before.children}
    for name in added:
        message = f"{quoted(robot.name)} names {quoted(name)}, which does not know it as such"
        raise ChangeError(message, "name the neighbours that it had")
    check_variables_free(team, robot)
    if robot.kind is not team.kind:
        raise ChangeError(f"{quoted(robot.name)} is a {robot.kind} in a team of {team.kind}", "write the same type")
    parts = (part for child in robot.children for part in child.constraints)
    secret = next((one for one in (*robot.shared, *parts) if one.model == ConstraintModel.PKC), None)
    if secret:
        message = f"{quoted(secret.name)} is partially known (PKC)"
        raise ChangeError(message, "a robot that comes back turns its links: use TKC")


def _link_neighbours(team: Team, name: str) -> Team:
    """Return `team`, in which `name` and its neighbours list each other, with the variables that constraints need."""
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
