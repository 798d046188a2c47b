"""A robot of an imported team as text: its file, its neighbours, and its constraints in words."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import msgspec

from robochoc.app.texts import say
from robochoc.formats.robot_reader import read_robot
from robochoc.model.constraint import INFINITE, Constraint, ConstraintModel, Function, Predicate, Relation, Semantics
from robochoc.model.cost_units import CostUnits, cost_shown, in_unit
from robochoc.modelling.infix import Infix

MOST_SENTENCES = 60
MOST_SHOWN = 40_000
"""The maximum number of characters shown from a file."""


class ShownRobotFile(msgspec.Struct, frozen=True):
    """A robot's file.

    Attributes:
        name: The file's name.
        text: The content of the file, or its beginning.
        is_cut: True if `text` is only the beginning.
        neighbours: The robots that share constraints with this robot.
        sentences: The robot's constraints in words, up to a maximum number.
        count: The number of the robot's constraints.
    """

    name: str
    text: str
    is_cut: bool
    neighbours: tuple[str, ...]
    sentences: tuple[str, ...]
    count: int


def read_robot_file(folder: Path, robot: str) -> ShownRobotFile:
    """Return a robot's file in the team's `folder`. Raises `InvalidInputError`, `OSError`."""
    file = _file_of(folder, robot)
    found = read_robot(file)
    constraints = [*found.constraints()]
    sentences = (sentence(one, found.symbol_table, found.costs) for one in constraints[:MOST_SENTENCES])
    with file.open(encoding="utf-8", errors="replace") as opened:
        text = opened.read(MOST_SHOWN + 1)
    return ShownRobotFile(
        file.relative_to(folder).as_posix(),
        text[:MOST_SHOWN],
        len(text) > MOST_SHOWN,
        tuple(dict.fromkeys([*(one.name for one in found.parents), *(one.name for one in found.children)])),
        tuple(sentences),
        len(constraints),
    )


def _file_of(folder: Path, robot: str) -> Path:
    """Return the path of a robot's file. Robots that join later have separate folders."""
    places = [folder, *sorted(folder.glob("late*"))]
    return next((file for place in places if (file := place / f"{robot}.xml").is_file()), folder / f"{robot}.xml")


_MOST_ROWS = 6
_LONGEST = 400


def sentence(constraint: Constraint, symbols: Sequence[str] = (), units: CostUnits | None = None) -> str:
    """Return a constraint on one line, such as `V1 ≠ V2`, with the cost of a violation.

    Args:
        constraint: The constraint.
        symbols: The names of the team's symbols, by their codes.
        units: The units of the costs in the robot's file. None: integers.
    """
    units = units or CostUnits()
    text = _in_words(constraint, symbols, units)
    text = text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
    if isinstance(constraint.definition, Predicate) and constraint.cost != INFINITE:
        cost = cost_shown(CostUnits(places=units.places).in_user_units(constraint.cost))
        text = say("imported.or-costs", says=text, cost=cost)
    return say("imported.own-part", says=text) if constraint.model == ConstraintModel.PKC else text


def _in_words(constraint: Constraint, symbols: Sequence[str], units: CostUnits) -> str:
    match constraint.definition:
        case Relation() as relation:
            return _table(constraint, relation, symbols, units)
        case Predicate(parameters=formals, body=body, symbolic=symbolic):
            return _Reading(dict(zip(formals, constraint.parameters, strict=True)), symbolic, symbols).text(body)
        case Function(parameters=formals, body=body, symbolic=symbolic):
            given = dict(zip(formals, constraint.parameters, strict=True))
            text = _Reading(given, symbolic, symbols).text(body)
            return say("imported.costs", says=in_unit(text, constraint.definition.places))


def _table(constraint: Constraint, relation: Relation, symbols: Sequence[str], units: CostUnits) -> str:
    """Return a table in words: its decisions and its first rows."""
    rows = []
    for number, row in enumerate(relation.tuples[:_MOST_ROWS]):
        entry = ", ".join(_label(value, column in relation.symbolic, symbols) for column, value in enumerate(row))
        entry = entry if relation.arity == 1 else f"({entry})"
        rows.append(f"{entry}: {_priced(relation.costs[number], units)}" if relation.costs else entry)
    if (more := len(relation.tuples) - len(rows)) > 0:
        rows.append(say("imported.more-rows", count=f"{more:,}"))
    over = ", ".join(map(str, constraint.scope))
    key = {
        Semantics.SUPPORTS: "imported.table-supports",
        Semantics.CONFLICTS: "imported.table-conflicts",
        Semantics.SOFT: "imported.table-soft",
    }[relation.semantics]
    return say(key, over=over, rows="; ".join(rows), default=_priced(relation.default_cost, units))


def _label(value: int, symbolic: bool, symbols: Sequence[str]) -> str:  # noqa: FBT001 - of a column
    return symbols[value] if symbolic and 0 <= value < len(symbols) else str(value)


def _priced(cost: float, units: CostUnits) -> str:
    if cost == INFINITE:
        return say("imported.forbidden")
    return say("imported.costing", cost=cost_shown(CostUnits(places=units.places).in_user_units(cost)))


class _Reading(Infix):
    """Infix notation, with `not` and `in` in the application's words."""

    def worded(self, operator: str, parts: Sequence[str]) -> str:
        """See `Infix.worded`."""
        return say(f"imported.says.{operator}", first=parts[0], others=", ".join(parts[1:]))
