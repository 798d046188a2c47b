"""A team as a piece of a notebook's page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from enum import Enum

from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Predicate, Relation, Semantics
from robochoc.model.cost_units import CostUnits, cost_shown
from robochoc.model.expression import Apply, Expression, Name
from robochoc.model.expression import text as expression_text
from robochoc.model.notebook.graph import graph_svg
from robochoc.model.notebook.tables import heading, table
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.wording import counted

_MAX_RANGES = 12


def team_html(team: Team, told: Mapping[str, Iterable[object]] = {}) -> str:
    """Return a team: its robots with their variables, its constraints, and the constraint graph.

    Args:
        team: The team.
        told: The values of variables as their user wrote them, where these are not what files hold.
    """
    constraints = list(_constraints(team))
    counts = {"robot": len(team.robots), "variable": len(team.variables), "constraint": len(constraints)}
    sizes = ", ".join(counted(number, thing) for thing, number in counts.items())
    aim = ""
    if team.kind == ProblemKind.DISWCSP:
        aim = ", maximised" if team.robots[0].costs.maximize else ", minimised"
    events = f", {counted(len(team.scenario), 'event')}" if team.scenario else ""
    robots = [
        (
            robot.name,
            variable.name,
            shown_values(told[variable.name]) if variable.name in told else _domain(variable.domain),
        )
        for robot in team.robots
        for variable in robot.variables
    ]
    columns = 5 if team.kind == ProblemKind.DISWCSP else 4
    parts = (
        heading(team.name, f"{sizes}{events}: a {team.kind}{aim}"),
        table(("robot", "variable", "values"), robots),
        table(("constraint", "held by", "over", "says", "cost")[:columns], [row[:columns] for row in constraints]),
        graph_svg(team),
    )
    return f"<div>{''.join(parts)}</div>"


def _constraints(team: Team) -> Iterator[tuple[str, str, str, str, str]]:
    for robot in team.robots:
        held = [*robot.private, *robot.shared, *(one for child in robot.children for one in child.constraints)]
        for one in held:
            yield one.name, robot.name, ", ".join(one.variables), _says(one), _cost(one, robot.costs)


def _says(constraint: Constraint) -> str:
    match constraint.definition:
        case Relation(semantics=semantics, tuples=tuples):
            return f"a table of {len(tuples):,} {'costs' if semantics == Semantics.SOFT else semantics}"
        case Predicate(parameters=formals, body=body) | Function(parameters=formals, body=body):
            return expression_text(_with(body, dict(zip(formals, constraint.parameters, strict=True))))


def _with(expression: Expression, actual: Mapping[str, str | int]) -> Expression:
    """Return an expression, in which what is passed to it stands in the place of formal parameters."""
    match expression:
        case Name(name) if name in actual:
            return Name(str(actual[name]))
        case Apply(operator, arguments):
            return Apply(operator, tuple(_with(one, actual) for one in arguments))
        case _:
            return expression


def _cost(constraint: Constraint, units: CostUnits) -> str:
    definition = constraint.definition
    if isinstance(definition, Function):
        return "its value"
    if isinstance(definition, Relation) and definition.semantics == Semantics.SOFT:
        return "in the table"
    if constraint.cost == INFINITE:
        return "must hold"
    return cost_shown(CostUnits(places=units.places).told(constraint.cost))


def shown_values(values: Iterable[object]) -> str:
    """Return users' values; members of an `Enum` by their names."""
    return ", ".join(value.name if isinstance(value, Enum) else str(value) for value in values)


def _domain(domain: Domain) -> str:
    if domain.symbols:
        return " ".join(str(domain.label(value)) for value in domain)
    shown = [f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0]) for part in domain.ranges[:_MAX_RANGES]]
    return " ".join(shown) + (" ..." if len(domain.ranges) > _MAX_RANGES else "")
