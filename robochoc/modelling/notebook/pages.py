"""Teams and outcomes as pieces of a notebook's page."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from html import escape
from typing import TYPE_CHECKING

from robochoc.model.constraint import INFINITE, Constraint, Domain, Function, Predicate, Relation, Semantics
from robochoc.model.cost_units import CostUnits
from robochoc.model.expression import Apply, Expression, Name
from robochoc.model.expression import text as expression_text
from robochoc.model.headline import describe_outcome
from robochoc.model.problem import AddAgent, ProblemKind, Team
from robochoc.model.wording import counted
from robochoc.modelling.notebook.graph import graph_svg
from robochoc.modelling.notebook.tables import heading, table

if TYPE_CHECKING:
    from robochoc.modelling.solution import Solution

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
    if team.kind is ProblemKind.DISWCSP:
        aim = ", maximised" if team.robots[0].costs.maximize else ", minimised"
    events = f", {counted(len(team.scenario), 'event')}" if team.scenario else ""
    robots = [
        (robot.name, variable.name, _values(told[variable.name]) if variable.name in told else _domain(variable.domain))
        for robot in team.robots
        for variable in robot.variables
    ]
    columns = 5 if team.kind is ProblemKind.DISWCSP else 4
    parts = (
        heading(team.name, f"{sizes}{events}: a {team.kind}{aim}"),
        table(("robot", "variable", "values"), robots),
        table(("constraint", "held by", "over", "says", "cost")[:columns], [row[:columns] for row in constraints]),
        graph_svg(team),
    )
    return f"<div>{''.join(parts)}</div>"


def solution_html(solution: Solution) -> str:
    """Return an outcome: what happened, the values, the epochs, and what the run took."""
    team = solution.problem
    owner = _owners(team) if team else {}
    plain = team is None or team.kind is ProblemKind.DISCSP
    metrics = solution.metrics
    spent = {
        "messages": f"{sum(metrics.messages.values()):,}",
        "bytes": f"{metrics.bytes:,}",
        "NCCCs": f"{metrics.ncccs:,}",
        "checks": f"{metrics.checks:,}",
        "seconds": f"{metrics.wall_s:.3f}",
    }
    epochs = [
        (number, epoch.opened_by, len(epoch.robots), epoch.verdict, "" if epoch.cost is None or plain else epoch.cost)
        for number, epoch in enumerate(solution.epochs)
    ]
    robots = len(team.robots) if team else len({owner.get(name, name) for name in solution.assignment})
    parts = (
        heading(
            f"{solution.team}: {describe_outcome(solution, robots)}",
            f"{solution.protocols}, {solution.runtime}{', verified' if solution.verified else ''}",
        ),
        table(
            ("robot", "variable", "value"),
            [(owner.get(name, ""), name, _values([value])) for name, value in solution.values.items()],
        ),
        table(("withdrawn",), [(name,) for name in solution.withdrawn]),
        table(("epoch", "opened by", "robots", "verdict", "cost"), epochs),
        table(tuple(spent), [tuple(spent.values())]),
    )
    return f"<div>{''.join(parts)}</div>"


def _owners(team: Team) -> dict[str, str]:
    """Return the robot of each variable, those included that join later."""
    changes = [change for event in team.scenario for change in event.changes]
    joining = [change.robot for change in changes if isinstance(change, AddAgent)]
    return {**team.owner, **{one.name: robot.name for robot in joining for one in robot.variables}}


def framed(page: str, height: int) -> str:
    """Return a whole page as a frame of another one, from which it can reach nothing."""
    return (
        f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" style="width:100%;height:{height}px;border:0"'
        ' title="the scene"></iframe>'
    )


def _constraints(team: Team) -> Iterator[tuple[str, str, str, str, str]]:
    for robot in team.robots:
        held = [*robot.private, *robot.shared, *(one for child in robot.children for one in child.constraints)]
        for one in held:
            yield one.name, robot.name, ", ".join(one.variables), _says(one), _cost(one, robot.costs)


def _says(constraint: Constraint) -> str:
    match constraint.definition:
        case Relation(semantics=semantics, tuples=tuples):
            return f"a table of {len(tuples):,} {'costs' if semantics is Semantics.SOFT else semantics}"
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
    if isinstance(definition, Relation) and definition.semantics is Semantics.SOFT:
        return "in the table"
    if constraint.cost == INFINITE:
        return "must hold"
    return str(CostUnits(places=units.places).told(constraint.cost))


def _values(values: Iterable[object]) -> str:
    """Return users' values; members of an `Enum` by their names."""
    return ", ".join(value.name if isinstance(value, Enum) else str(value) for value in values)


def _domain(domain: Domain) -> str:
    if domain.symbols:
        return " ".join(str(domain.label(value)) for value in domain)
    shown = [f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0]) for part in domain.ranges[:_MAX_RANGES]]
    return " ".join(shown) + (" ..." if len(domain.ranges) > _MAX_RANGES else "")
