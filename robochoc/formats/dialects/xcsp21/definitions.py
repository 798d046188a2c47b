"""Relations, predicates and functions of XCSP 2.1."""

from __future__ import annotations

import re
from decimal import Decimal

from robochoc.formats.diagnostics import MistakeError, shortened
from robochoc.formats.dialects.xcsp21.instance import Price, Sides, Table
from robochoc.formats.dialects.xcsp21.numbers import CostReader, integer, split_tuples
from robochoc.formats.element_view import ElementView
from robochoc.model.constraint import INFINITE, Function, Predicate
from robochoc.model.expression import Expression, ExpressionError, Type, parse

_ZERO = Decimal(0)
_OTHER_FORMS = ("infix", "prefix", "postfix", "math")
_SEMANTICS = ("supports", "conflicts", "soft")
_TRUTH = re.compile(r"\b(true|false)\b")
_TRUTH_VALUES = {"true": "eq(0,0)", "false": "ne(0,0)"}


def read_relation(element: ElementView, costs: CostReader) -> Table | Sides:
    """Return a relation. Raises `MistakeError`.

    A cost holds for all following tuples until the next one. The last of equal tuples wins, as with FRODO. Where there
    is no `defaultCost`, tuples that are not listed are forbidden.
    """
    semantics = element.attribute("semantics")
    element.ignore_attributes("nbTuples")
    if semantics not in _SEMANTICS:
        raise MistakeError(f"the semantics '{shortened(semantics)}'", f"known are {' '.join(_SEMANTICS)}")
    if semantics == "soft":
        return _soft(element, costs)
    listed, other = (_ZERO, INFINITE) if semantics == "supports" else (INFINITE, _ZERO)
    found: dict[tuple[int, ...], Price] = {}
    for cost, values in split_tuples(element.text()):
        if cost:
            raise MistakeError(f"the cost {shortened(cost)} in a {semantics} relation", 'write semantics="soft"')
        found[_values(values)] = listed
    return _table(element, found, other)


def _soft(element: ElementView, costs: CostReader) -> Table | Sides:
    default = element.attribute("defaultCost")
    other = [costs.cost(word) for word in default.split()] or [INFINITE]
    now: list[Price] = []
    first: dict[tuple[int, ...], Price] = {}
    second: dict[tuple[int, ...], Price] = {}
    written = None
    for cost, text in split_tuples(element.text()):
        if cost and cost != written:
            now, written = [costs.cost(word) for word in cost.split()], cost
        if not now:
            raise MistakeError(f"the tuple '{shortened(text.strip())}' has no cost", "write cost:tuple, 5:1 2|3:2 2")
        if len(now) > 2 or (first and (len(now) > 1) != bool(second)):  # noqa: PLR2004 - one for each side
            raise MistakeError(f"the costs '{shortened(cost)}'", "one cost a tuple, or two everywhere: one a side")
        values = _values(text)
        if values:
            first[values] = now[0]
            if len(now) > 1:
                second[values] = now[1]
    if second or len(other) > 1:
        return Sides(_table(element, first, other[0]), _table(element, second, other[-1]))
    return _table(element, first, other[0])


def _table(element: ElementView, costs: dict[tuple[int, ...], Price], default: Price) -> Table:
    name, given = element.attribute("name"), element.attribute("arity")
    arity = len(next(iter(costs))) if costs else integer(given or "0")
    for values in costs:
        if len(values) != arity:
            shown = " ".join(map(str, values))
            raise MistakeError(f"the tuple '{shortened(shown)}' has {len(values)} values, others {arity}", "mend it")
    return Table(name, arity, costs, default)


def _values(text: str) -> tuple[int, ...]:
    return tuple([integer(word) for word in text.split()])


def read_formula(element: ElementView) -> Predicate | Function:
    """Return a predicate, or a function whose value is a cost. Raises `MistakeError`."""
    name, function = element.attribute("name"), element.tag == "function"
    formula, parameters = element.child("expression"), element.child("parameters")
    functional = formula.child("functional") if formula else None
    if formula is None or functional is None:
        others = next((form for form in _OTHER_FORMS if formula and formula.has(form)), "")
        wrong = f"an expression in the form {others}" if others else "no expression"
        raise MistakeError(f"'{shortened(name)}' has {wrong}", "write <expression><functional>")
    formula.ignore(*_OTHER_FORMS)  # say the same
    if function:
        element.ignore_attributes("return")
    formals = _parameters(parameters.text() if parameters else "")
    body = expression(functional.text(), formals, Type.INTEGER if function else Type.BOOLEAN)
    return Function(name, formals, body) if function else Predicate(name, formals, body)


def _parameters(text: str) -> tuple[str, ...]:
    words = text.split()
    if len(words) % 2 or any(word != "int" for word in words[::2]):
        raise MistakeError(f"the parameters '{shortened(text.strip())}'", "write int X int Y")
    if len(set(words[1::2])) < len(words) // 2:
        raise MistakeError(f"a parameter stands twice in '{shortened(text.strip())}'", "give each its own name")
    return tuple(words[1::2])


def expression(text: str, names: tuple[str, ...], wanted: Type) -> Expression:
    """Return the functional expression in `text`. Raises `MistakeError`."""
    if not {"true", "false"} & set(names):
        text = _TRUTH.sub(lambda word: _TRUTH_VALUES[word[0]], text)
    try:
        return parse(text, names, wanted)
    except ExpressionError as error:
        raise MistakeError(f"in the expression: {error.message}", error.hint or "see the format's reference") from None
