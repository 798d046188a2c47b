"""Conversion of costs as written by users (`5`, `0.25`, `-3`, `infinity`) to integers of a `CostUnits`, without floats.

docs/reference/format.md, "Costs".
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from lxml import etree

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.names import BEYOND, check_integer, digits
from robochoc.formats.xml import attribute
from robochoc.model.cost_units import MAX_PLACES, CostUnits
from robochoc.model.expression.fixed_point import VALUE_PLACES
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    Definition,
    ProblemKind,
    Relation,
    Robot,
    Semantics,
)

_NUMBER = re.compile(rf"([+-]?)([0-9]{{1,18}})(?:\.([0-9]{{1,{MAX_PLACES}}}))?")
_SCALE = re.compile(rf"1|0\.0{{0,{MAX_PLACES - 1}}}1")
_DECIMAL = f"write an integer or a decimal of at most {MAX_PLACES} places"


def read_cost(word: str, units: CostUnits) -> float:
    """Return the cost in `word` as an integer of `units`, or `INFINITE`. Raises `MistakeError`."""
    if word in {"infinity", "+infinity", "-infinity"}:
        _check_forbids(word, units)
        return INFINITE
    return _integer(word, units.places)


def cost_text(cost: float, units: CostUnits) -> str:
    """Return the text of `cost`, an integer of `units` or `INFINITE`. `read_cost` reads it.

    Raises:
        ValueError: if the cost is not an integer.
    """
    if cost == INFINITE:
        return "-infinity" if units.maximize else "infinity"
    if cost != int(cost):
        raise ValueError(f"the cost {cost} is not an integer")
    return _decimal(int(cost), units.places)


def scale_text(places: int) -> str:
    """Return the `scale` of costs with `places` decimal places: 0.001 for three."""
    return _decimal(1, places)


def places_used(root: etree._Element) -> int:
    """Return the largest number of decimal places in the costs of a file. Invalid costs are ignored."""
    words = [attribute(element, "constant") for element in root.iterchildren("presentation")]
    words += [attribute(element, "cost") for element in root.iter("constraint")]
    for relation in itertools.chain.from_iterable(root.iterchildren("relations")):
        words.append(attribute(relation, "defaultCost"))
        text = relation.text or ""
        if "." in text and attribute(relation, "semantics") == Semantics.SOFT:
            words += [part.partition(":")[0].strip() for part in text.split("|") if ":" in part]
    places = [_places(word) for word in words if "." in word]
    for function in root.iter("function"):
        is_real = "real" in (function.findtext("parameters") or "").split()[::2]
        scale = attribute(function, "scale")
        places.append(places_of_scale(scale) or 0 if scale else VALUE_PLACES * is_real)
    return max(places, default=0)


def read_units(presentation: etree._Element, kind: ProblemKind, places: int) -> CostUnits:
    """Return the unit of the costs in a file. The costs have `places` decimal places. Raises `MistakeError`."""
    units = CostUnits(attribute(presentation, "objective") == "maximize", _scale(presentation, places))
    constant = attribute(presentation, "constant")
    if constant:
        units = replace(units, constant=_integer(constant, units.places))
    check_units(units, kind)
    return units


def check_units(units: CostUnits, kind: ProblemKind) -> None:
    """Raise `MistakeError` unless `units` are valid for a robot of that `kind`."""
    if not 0 <= units.places <= MAX_PLACES:
        raise MistakeError(f"the costs have {units.places} decimal places", f"use 0 to {MAX_PLACES}")
    if not -BEYOND < units.constant < BEYOND:
        message = f"the constant of the costs has {digits(units.constant)} digits"
        raise MistakeError(message, "use at most 18 digits, decimal places included")
    if kind != ProblemKind.DISWCSP and units != CostUnits():
        what = (
            "an objective to maximise"
            if units.maximize
            else "a constant cost"
            if units.constant
            else "a scale of costs"
        )
        raise MistakeError(f"a DisCSP cannot have {what}", 'write type="DisWCSP" in the presentation, or delete it')


class CostConversion:
    """Converts the costs of robots to the finer unit of their team by multiplying them by `factor`."""

    def __init__(self, factor: int) -> None:
        self._factor = factor
        self._known: dict[int, tuple[Definition, Definition]] = {}

    def robot(self, robot: Robot) -> Robot:
        """Return `robot` with its costs in the finer unit. Raises `MistakeError` if a cost then has too many digits."""
        constant = int(self.cost(robot.costs.constant))
        places = robot.costs.places + len(str(self._factor)) - 1
        costs = replace(robot.costs, places=places, constant=constant)
        declared = robot.declared and self.robot(robot.declared)
        return replace(robot.with_constraints(self.constraint), costs=costs, declared=declared)

    def cost(self, cost: float) -> float:
        """Return `cost` in the finer unit. Raises `MistakeError`."""
        if cost == INFINITE:
            return cost
        converted = int(cost) * self._factor
        check_integer(converted)
        return converted

    def constraints(self, constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        """Return `constraints` in the finer unit. Raises `MistakeError`."""
        return tuple(map(self.constraint, constraints))

    def constraint(self, constraint: Constraint) -> Constraint:
        """Return `constraint` in the finer unit. Raises `MistakeError`."""
        return replace(constraint, definition=self.definition(constraint.definition), cost=self.cost(constraint.cost))

    def definitions(self, definitions: Mapping[str, Definition | None]) -> dict[str, Definition | None]:
        """Return `definitions` in the finer unit. Raises `MistakeError`."""
        return {name: one and self.definition(one) for name, one in definitions.items()}

    def definition(self, definition: Definition) -> Definition:
        """Return `definition` in the finer unit. Equal arguments give the same object. Raises `MistakeError`."""
        if not isinstance(definition, Relation) or definition.semantics != Semantics.SOFT:
            return definition
        if id(definition) not in self._known:
            converted = replace(
                definition,
                costs=tuple(map(self.cost, definition.costs)),
                default_cost=self.cost(definition.default_cost),
            )
            self._known[id(definition)] = definition, converted
        return self._known[id(definition)][1]


def _check_forbids(word: str, units: CostUnits) -> None:
    if (word == "-infinity") != units.maximize:
        aim, right = ("maximised", "-infinity") if units.maximize else ("minimised", "infinity")
        raise MistakeError(f"the cost {word} is not possible where costs are {aim}", f"write {right} to forbid")


def _integer(word: str, places: int) -> int:
    match = _NUMBER.fullmatch(word)
    if not match:
        raise MistakeError(f"'{shortened(word)}' is not a cost", f"{_DECIMAL}, or infinity to forbid")
    sign, whole, decimals = match[1], match[2], (match[3] or "").rstrip("0")
    if len(decimals) > places:
        hint = f'write scale="{scale_text(len(decimals))}" in the presentation, or leave the scale out'
        raise MistakeError(f"the cost {word} has more decimal places than the scale of the file", hint)
    value = int(whole + decimals.ljust(places, "0"))
    check_integer(value)
    return -value if sign == "-" else value


def _places(word: str) -> int:
    match = _NUMBER.fullmatch(word)
    return len((match[3] or "").rstrip("0")) if match else 0


def _scale(presentation: etree._Element, places: int) -> int:
    given = attribute(presentation, "scale")
    if not given:
        return places
    found = places_of_scale(given)
    if found is None:
        hint = f"expected a power of ten of at most {MAX_PLACES} places: 1, 0.1, 0.01, ..."
        raise MistakeError(f"invalid scale '{shortened(given)}'", hint)
    return found


def places_of_scale(text: str) -> int | None:
    """Return the number of decimal places in a scale: 3 for 0.001. None: it is not a scale."""
    return len(text.partition(".")[2]) if _SCALE.fullmatch(text) else None


def _decimal(value: int, places: int) -> str:
    if not places:
        return str(value)
    written = str(abs(value)).rjust(places + 1, "0")
    decimals = written[-places:].rstrip("0")
    return f"{'-' * (value < 0)}{written[:-places]}{'.' * bool(decimals)}{decimals}"
