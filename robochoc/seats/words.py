"""The problem of one robot in words, for players who read: its variables, rules and costs, and its neighbours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robochoc.model.constraint import INFINITE, Constraint, ConstraintModel, Function, Relation, Semantics
from robochoc.model.cost_units import CostUnits, cost_shown, in_unit
from robochoc.model.problem import Robot, Team
from robochoc.modelling.infix import Infix
from robochoc.modelling.team_html import domain_text
from robochoc.system.plain_text import listed, printable

MAX_ROWS = 200
"""The maximum number of rows of a table that are listed."""


def problem_in_words(team: Team, name: str) -> str:
    """Return the problem of the robot called `name` as lines of text: only what this robot may know.

    Args:
        team: The team as its user wrote it, before costs are normalised.
        name: The robot.
    """
    robot = team[name]
    aim = "as large as possible" if robot.costs.maximize else "as small as possible"
    lines = [f"You decide for the robot {name}: {listed(one.name for one in robot.variables)}."]
    lines += [f"{one.name} is one of: {domain_text(one.domain)}." for one in robot.variables]
    for constraint in _known(team, robot):
        lines += _rule(team, constraint, robot)
    lines.append(f"Rules must hold. The sum of all {_noun(robot).lower()}s of the whole team should be {aim}.")
    return "\n".join(map(printable, lines))


def _known(team: Team, robot: Robot) -> Iterator[Constraint]:
    """Yield the constraints that a robot knows: its own, and totally known ones of others on its variables."""
    own = {one.name for one in robot.variables}
    yield from robot.constraints()
    for other in team.robots:
        if other.name != robot.name:
            for constraint in other.shared:
                if constraint.model != ConstraintModel.PKC and not own.isdisjoint(constraint.variables):
                    yield constraint


def _noun(robot: Robot) -> str:
    return "Gain" if robot.costs.maximize else "Cost"


def _rule(team: Team, constraint: Constraint, robot: Robot) -> Iterator[str]:
    """Yield the lines about one constraint."""
    noun = _noun(robot)
    definition = constraint.definition
    if not isinstance(definition, Relation):
        given = dict(zip(definition.parameters, constraint.parameters, strict=True))
        source = definition.real.source if definition.real else None
        text = Infix(given, definition.symbolic, robot.symbol_table).text(source or definition.body)
        if isinstance(definition, Function):
            yield f"{noun} {constraint.name}: {text if source else in_unit(text, definition.places)}."
        elif constraint.cost == INFINITE:
            yield f"Rule {constraint.name}: {text}."
        else:
            yield f"{noun} {constraint.name}: {_price(constraint.cost, robot)} unless {text}."
        return
    heads = {
        Semantics.SUPPORTS: f"Rule {constraint.name}: only these values are allowed",
        Semantics.CONFLICTS: f"Rule {constraint.name}: these values are forbidden",
        Semantics.SOFT: f"{noun} {constraint.name}: a {noun.lower()} for each combination of values",
    }
    yield f"{heads[definition.semantics]} for {', '.join(map(str, constraint.parameters))}."
    soft = definition.semantics == Semantics.SOFT
    for place, row in enumerate(definition.tuples[:MAX_ROWS]):
        values = ", ".join(_labels(team, constraint, row))
        yield f"  {values}{f': {_price(definition.costs[place], robot)}' if soft else ''}"
    if len(definition.tuples) > MAX_ROWS:
        yield f"  and {len(definition.tuples) - MAX_ROWS:,} more rows"
    if soft:
        yield f"  all other values: {_price(definition.default_cost, robot)}"


def _labels(team: Team, constraint: Constraint, row: Sequence[int]) -> Iterator[str]:
    """Yield the values in a row of a table, in the user's notation."""
    for term, part in zip(constraint.parameters, row, strict=True):
        yield str(team.variables[term].domain.label(part) if isinstance(term, str) else part)


def _price(paid: float, robot: Robot) -> str:
    """Return a cost in the user's units as text."""
    return "forbidden" if paid == INFINITE else cost_shown(CostUnits(places=robot.costs.places).in_user_units(paid))
