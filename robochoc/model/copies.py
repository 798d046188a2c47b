"""Several copies of a team as one team, and constraints over other variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from robochoc.model.constraint import Constraint
from robochoc.model.problem import Child, Parent, Robot, Team


def copied_team(team: Team, copies: int) -> Team:
    """Return a team with `copies` copies of `team`, which share no constraints. The first copy keeps its names.

    The names in copy 2 end in `_2`, or in `_2_` if such a name exists. Copies have no topics, and the team has no
    scenario.
    """
    taken = {*team.order, *team.variables}
    robots: list[Robot] = [replace(robot, topics=()) for robot in team.robots]
    for number in range(2, copies + 1):
        ending = f"_{number}"
        while any(f"{name}{ending}" in taken for name in taken):
            ending += "_"
        robots += [_copied(robot, {name: f"{name}{ending}" for name in taken}) for robot in team.robots]
    return Team(team.name, tuple(robots))


def renamed_constraint(constraint: Constraint, names: Mapping[str, str]) -> Constraint:
    """Return `constraint` over other variables; `names` maps the present names to the new ones."""
    scope, parameters = (
        tuple(names.get(term, term) if isinstance(term, str) else term for term in part)
        for part in (constraint.scope, constraint.parameters)
    )
    return replace(constraint, scope=scope, parameters=parameters)


def _copied(robot: Robot, names: Mapping[str, str]) -> Robot:
    def renamed(constraints: tuple[Constraint, ...]) -> tuple[Constraint, ...]:
        return tuple(renamed_constraint(one, names) for one in constraints)

    return replace(
        robot,
        name=names[robot.name],
        variables=tuple(replace(one, name=names[one.name]) for one in robot.variables),
        private=renamed(robot.private),
        parents=tuple(Parent(names[one.name], renamed(one.constraints), one.line) for one in robot.parents),
        children=tuple(
            Child(
                names[one.name],
                tuple(names[name] for name in one.variables),
                renamed(one.constraints),
                one.line,
                renamed(one.copies),
            )
            for one in robot.children
        ),
        topics=(),
        shown=tuple(names[name] for name in robot.shown),
        costs=replace(robot.costs, constant=0),
    )
