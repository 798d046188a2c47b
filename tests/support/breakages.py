"""What can be done to a team of Python objects so that it is broken: the tools of `broken_objects.py`.

Names of robots, variables and constraints are those of `broken_case.TEAM`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, cast

from robochoc.formats import PREDEFINED
from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.problem import (
    Change,
    Child,
    Constraint,
    ConstraintModel,
    Domain,
    Parent,
    Predicate,
    ProblemKind,
    Relation,
    Robot,
    ScenarioEvent,
    Semantics,
    Team,
    Term,
    Topic,
    Variable,
)

Breakage = Callable[[Team], Team]


def robot(which: str, **changes: object) -> Breakage:
    """The robot `which`, with other parts."""
    return lambda team: with_robot(team, replace(team[which], **cast("Any", changes)))


def with_robot(team: Team, changed: Robot) -> Team:
    return replace(team, robots=tuple(changed if one.name == changed.name else one for one in team.robots))


def each(edit: Callable[[Robot], Robot]) -> Breakage:
    return lambda team: replace(team, robots=tuple(map(edit, team.robots)))


def constraint(which: str, holder: str = "", **changes: object) -> Breakage:
    """The constraint `which`, changed wherever it stands (or with the robot `holder` only)."""

    def edited(constraints: tuple[Constraint, ...]) -> tuple[Constraint, ...]:
        return tuple(replace(one, **cast("Any", changes)) if one.name == which else one for one in constraints)

    def edit(one: Robot) -> Robot:
        if holder not in {"", one.name}:
            return one
        return replace(
            one,
            private=edited(one.private),
            parents=tuple(replace(parent, constraints=edited(parent.constraints)) for parent in one.parents),
            children=tuple(replace(child, constraints=edited(child.constraints)) for child in one.children),
        )

    return each(edit)


def over(name: str, *terms: str | int, holder: str = "") -> Breakage:
    """The constraint `name`, over other terms."""
    return constraint(name, holder, scope=terms, parameters=terms)


def domain(*ranges: range) -> Breakage:
    """Robot2 with another domain."""
    return robot("Robot2", variables=(Variable("V2", Domain("D1", ranges)),))


def relation(*rows: tuple[int, ...], semantics: Semantics = Semantics.CONFLICTS, **more: object) -> Breakage:
    """Robot2 with another relation."""
    return constraint("C2", definition=Relation("r1", 2, semantics, rows, **cast("Any", more)))


def predicate(body: Expression, *parameters: str, name: str = "p1") -> Breakage:
    """Robot2 with another predicate."""
    return constraint("C1", definition=Predicate(name, parameters or ("X", "Y", "i", "j"), body))


def parents(name: str, *listed: Parent) -> Breakage:
    return robot(name, parents=listed)


def child(name: str, of: str, **changes: object) -> Breakage:
    """The child `name` of the robot `of`, changed."""
    return lambda team: robot(
        of,
        children=tuple(replace(one, **cast("Any", changes)) if one.name == name else one for one in team[of].children),
    )(team)


def no_child(name: str, of: str) -> Breakage:
    return lambda team: robot(of, children=tuple(one for one in team[of].children if one.name != name))(team)


def moved(name: str, holder: str, to: str) -> Breakage:
    """The shared constraint `name` of `holder`, under another parent."""

    def edit(team: Team) -> Team:
        (it,) = (one for one in team[holder].shared if one.name == name)
        rest = (
            replace(parent, constraints=tuple(one for one in parent.constraints if one.name != name))
            for parent in team[holder].parents
        )
        return parents(
            holder,
            *(replace(one, constraints=(*one.constraints, it)) if one.name == to else one for one in rest),
        )(team)

    return edit


def weighted(then: Breakage) -> Breakage:
    return lambda team: then(each(lambda one: replace(one, kind=ProblemKind.DISWCSP))(team))


def topic(z: Expression) -> Breakage:
    x = Apply("mul", (Constant(2), Name("V3")))
    return robot("Robot3", topics=(Topic("/drone3/waypoint3", x=x, y=Constant(-1), z=z),))


def ring(_: Team) -> Team:
    def one(name: str, parent: str, below: str) -> Robot:
        values = (Variable(f"V{name}", Domain("D1", (range(1, 3),))),)
        return Robot(name, values, parents=(Parent(parent),), children=(Child(below, (f"V{name}",)),))

    return Team("ring", (one("A", "C", "B"), one("B", "A", "C"), one("C", "B", "A")))


def nested(levels: int) -> Expression:
    body: Expression = Name("X")
    for _ in range(levels):
        body = Apply("abs", (body,))
    return body


def doubled(times: int) -> Expression:
    """A small tree that would be written with more characters than there are atoms."""
    body: Expression = Name("X")
    for _ in range(times):
        body = Apply("add", (body, body))
    return Apply("eq", (body, body))


def shared_variable(team: Team) -> Team:
    (variable,) = team["Robot3"].variables
    team = robot("Robot3", variables=(replace(variable, name="V2"),), topics=())(team)
    team = over("C4", "V1", "V2", holder="Robot3")(team)
    return over("C5", "W1", "V1", "V2")(team)


def unseen_variable(team: Team) -> Team:
    (variable,) = team["Robot2"].variables
    team = robot("Robot2", variables=(replace(variable, name="W2"), variable))(team)
    return over("C3", "V1", "W2", holder="Robot1")(team)


def turned_link(team: Team) -> Team:
    team = no_child("Robot3", "Robot1")(team)
    return robot("Robot1", parents=(Parent("Robot3"),))(team)


VALUES = Domain("D", (range(1, 5),))
NEWCOMER = Robot("Late", (Variable("VL", VALUES),))


def bound(*terms: Term, model: ConstraintModel = ConstraintModel.TKC) -> Constraint:
    return Constraint("C", PREDEFINED["ne"], terms, terms, model)


def scenario(*changes: Change, after: int | None = None) -> Breakage:
    return lambda team: replace(team, scenario=(ScenarioEvent(changes, after),))
