"""A team as HTML for a notebook: its robots, its constraints, and the constraint graph as SVG."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import Enum

from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Predicate, Relation, Semantics
from robochoc.model.cost_units import CostUnits, cost_shown, in_unit
from robochoc.model.expression import Apply, Expression, Name
from robochoc.model.expression import text as expression_text
from robochoc.model.orders import constraint_graph
from robochoc.model.problem import ProblemKind, Team
from robochoc.modelling.html_tables import heading, table, text
from robochoc.system.plain_text import counted

MAX_ROBOTS = 60
"""The most robots for which a graph is drawn; a larger graph would be illegible."""
_MARGIN = 110
_LONGEST = 16
_MAX_RANGES = 12


def team_html(team: Team, user_values: Mapping[str, Iterable[object]] = {}) -> str:
    """Return the HTML of a team: its robots with their variables, its constraints, and the constraint graph.

    Args:
        team: The team.
        user_values: The user's values of variables for which the files contain codes.
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
            shown_values(user_values[variable.name]) if variable.name in user_values else domain_text(variable.domain),
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
        constraints = [*robot.private, *robot.shared, *(one for child in robot.children for one in child.constraints)]
        for one in constraints:
            yield one.name, robot.name, ", ".join(one.variables), _definition(one), _cost(one, robot.costs)


def _definition(constraint: Constraint) -> str:
    match constraint.definition:
        case Relation(semantics=semantics, tuples=tuples):
            return f"a table of {len(tuples):,} {'costs' if semantics == Semantics.SOFT else semantics}"
        case Predicate(parameters=formals, body=body) | Function(parameters=formals, body=body):
            return expression_text(_with_actual(body, dict(zip(formals, constraint.parameters, strict=True))))


def _with_actual(expression: Expression, actual: Mapping[str, str | int]) -> Expression:
    """Return an expression with its formal parameters replaced by actual parameters."""
    match expression:
        case Name(name) if name in actual:
            return Name(str(actual[name]))
        case Apply(operator, arguments):
            return Apply(operator, tuple(_with_actual(one, actual) for one in arguments))
        case _:
            return expression


def _cost(constraint: Constraint, units: CostUnits) -> str:
    definition = constraint.definition
    if isinstance(definition, Function):
        return in_unit("its value", definition.places)
    if isinstance(definition, Relation) and definition.semantics == Semantics.SOFT:
        return "in the table"
    if constraint.cost == INFINITE:
        return "must hold"
    return cost_shown(CostUnits(places=units.places).in_user_units(constraint.cost))


def shown_values(values: Iterable[object]) -> str:
    """Return users' values as text; members of an `Enum` by their names."""
    return ", ".join(value.name if isinstance(value, Enum) else str(value) for value in values)


def domain_text(domain: Domain) -> str:
    """Return the values of a domain as text; of many ranges, the first ones."""
    if domain.symbols or domain.real:
        return " ".join(str(domain.label(value)) for value in domain)
    shown = [f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0]) for part in domain.ranges[:_MAX_RANGES]]
    return " ".join(shown) + (" ..." if len(domain.ranges) > _MAX_RANGES else "")


def graph_svg(team: Team) -> str:
    """Return the SVG of the constraint graph; empty if there is one robot, or more than `MAX_ROBOTS`."""
    if not 1 < len(team.robots) <= MAX_ROBOTS:
        return ""
    near = constraint_graph(team)
    count = len(team.order)
    radius = max(60, 9 * count)
    size = 2 * (radius + _MARGIN)
    places = {name: _on_circle(number, count, radius, size / 2) for number, name in enumerate(team.order)}
    lines = [
        _line(places[one], places[other])
        for number, one in enumerate(team.order)
        for other in team.order[:number]
        if other in near[one]
    ]
    nodes = [_node(name, *places[name], size / 2) for name in team.order]
    top, height = _MARGIN - 30, 2 * radius + 60
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 {top} {size} {height}" role="img"'
        f' aria-label="constraint graph: {count} robots, {len(lines)} links" style="max-width:{size}px;width:100%">'
        f'<g stroke="currentColor" stroke-opacity=".35">{"".join(lines)}</g>{"".join(nodes)}</svg>'
    )


def _on_circle(number: int, count: int, radius: float, middle: float) -> tuple[float, float]:
    angle = 2 * math.pi * number / count - math.pi / 2
    return middle + radius * math.cos(angle), middle + radius * math.sin(angle)


def _line(one: Sequence[float], other: Sequence[float]) -> str:
    return f'<line x1="{one[0]:.1f}" y1="{one[1]:.1f}" x2="{other[0]:.1f}" y2="{other[1]:.1f}"/>'


def _node(name: str, x: float, y: float, middle: float) -> str:
    """Return the SVG of a robot, with its name outside the circle."""
    shown = name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
    beside = abs(x - middle) > 1
    right = x > middle
    anchor = ("start" if right else "end") if beside else "middle"
    dx, dy = ((11 if right else -11), 4) if beside else (0, 20 if y > middle else -11)
    return (
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="6" fill="#3f51b5"><title>{text(name)}</title></circle>'
        f'<text x="{x + dx:.1f}" y="{y + dy:.1f}" text-anchor="{anchor}" font-size="12" fill="currentColor">'
        f"{text(shown)}</text>"
    )
