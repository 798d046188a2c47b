"""Random changes of a team that files can say as well as objects: some leave it valid, most do not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random
from typing import TypeVar

from robochoc.formats import PREDEFINED
from robochoc.model.problem import INFINITE, Constraint, Domain, ProblemKind, Robot, Team, Term

Mutation = Callable[[Robot, Team, Random], Robot]
_Item = TypeVar("_Item")


def mutated(team: Team, chance: Random) -> Team:
    """`team`, in which one robot is another, or is gone."""
    place = chance.randrange(len(team.robots))
    if len(team.robots) > 1 and chance.random() < 0.05:
        return replace(team, robots=_without(team.robots, place))
    robot = chance.choice(_MUTATIONS)(team.robots[place], team, chance)
    return replace(team, robots=_with(team.robots, place, robot))


def _without(items: Sequence[_Item], place: int) -> tuple[_Item, ...]:
    return (*items[:place], *items[place + 1 :])


def _with(items: Sequence[_Item], place: int, item: _Item) -> tuple[_Item, ...]:
    return (*items[:place], item, *items[place + 1 :])


def _no_parent(robot: Robot, _: Team, chance: Random) -> Robot:
    if not robot.parents:
        return robot
    return replace(robot, parents=_without(robot.parents, chance.randrange(len(robot.parents))))


def _no_child(robot: Robot, _: Team, chance: Random) -> Robot:
    if not robot.children:
        return robot
    return replace(robot, children=_without(robot.children, chance.randrange(len(robot.children))))


def _costly(robot: Robot, _team: Team, _: Random) -> Robot:
    return replace(robot, kind=ProblemKind.DISWCSP)


def _heavy(robot: Robot, _: Team, chance: Random) -> Robot:
    return replace(robot, weight=chance.choice((1, 2, 10**6)))


def _other_parent(robot: Robot, team: Team, chance: Random) -> Robot:
    if not robot.parents:
        return robot
    place = chance.randrange(len(robot.parents))
    other = replace(robot.parents[place], name=chance.choice([*team.order, "nobody"]))
    return replace(robot, parents=_with(robot.parents, place, other))


def _told_otherwise(robot: Robot, team: Team, chance: Random) -> Robot:
    if not robot.children:
        return robot
    place = chance.randrange(len(robot.children))
    names = chance.choice(([variable.name for variable in robot.variables], [*team.variables, "nobody"]))
    told = tuple(chance.sample(names, chance.randrange(len(names) + 1)))
    return replace(robot, children=_with(robot.children, place, replace(robot.children[place], variables=told)))


def _other_name(robot: Robot, team: Team, chance: Random) -> Robot:
    place = chance.randrange(len(robot.variables))
    variable = replace(robot.variables[place], name=chance.choice([*team.variables, "nobody"]))
    return replace(robot, variables=_with(robot.variables, place, variable))


def _other_values(robot: Robot, _: Team, chance: Random) -> Robot:
    place = chance.randrange(len(robot.variables))
    ranges = chance.choice(((), (range(1, 3),), (range(3, 5), range(4, 9)), (range(200_000),), (range(3), range(3, 5))))
    variable = replace(robot.variables[place], domain=Domain("D9", ranges))
    return replace(robot, variables=_with(robot.variables, place, variable))


def _under_another(robot: Robot, _: Team, chance: Random) -> Robot:
    if not robot.parents:
        return robot
    first, *rest = chance.sample(robot.parents, len(robot.parents))
    held = (*robot.shared,)
    return replace(robot, parents=(replace(first, constraints=held), *(replace(one, constraints=()) for one in rest)))


def _private(robot: Robot, _: Team, chance: Random) -> Robot:
    return replace(robot, private=(*robot.private, chance.choice(robot.shared))) if robot.shared else robot


def _another_constraint(robot: Robot, team: Team, chance: Random) -> Robot:
    if not robot.parents:
        return robot
    place = chance.randrange(len(robot.parents))
    parent = robot.parents[place]
    theirs = [one.name for one in team[parent.name].variables] if parent.name in team else ["nobody"]
    ours = [one.name for one in robot.variables]
    anybody: list[Term] = [*team.variables, "nobody", 3]
    scope: tuple[Term, ...] = (chance.choice(theirs), chance.choice(ours))
    if chance.random() < 0.5:
        scope = tuple(chance.choice(anybody) for _ in range(chance.choice((1, 2, 2, 3))))
    cost = chance.choice((INFINITE, INFINITE, 3))
    one = Constraint("C", PREDEFINED[chance.choice(("ne", "lt"))], scope, scope, cost=cost)
    held = replace(parent, constraints=(*parent.constraints, one))
    return replace(robot, parents=_with(robot.parents, place, held))


_MUTATIONS: tuple[Mutation, ...] = (
    _no_parent,
    _no_child,
    _costly,
    _heavy,
    _other_parent,
    _told_otherwise,
    _told_otherwise,
    _other_name,
    _other_values,
    _under_another,
    _private,
    _another_constraint,
    _another_constraint,
)
