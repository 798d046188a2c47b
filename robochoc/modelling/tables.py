"""Terms as tables: what no expression says is computed for all combinations of values, within bounds."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from robochoc.modelling.meanings import UndefinedTermError
from robochoc.modelling.numbers import Exact, exact, is_infinite, is_number, is_truth
from robochoc.modelling.places import ModelError, ModelTypeError, Place
from robochoc.modelling.tabulated import Tabled
from robochoc.modelling.terms import Term, Variable

MAX_COMBINATIONS = 100_000
"""The maximum number of combinations of values of which a table is computed."""

Row = tuple[int, ...]
"""Integers of a relation."""

Price = Exact | float
"""A cost; `math.inf` forbids."""


def truths(term: Term, place: Place) -> tuple[list[Row], list[Row]]:
    """Return the rows of `term.variables` in which a condition holds, and those in which it does not."""
    holds: list[Row] = []
    fails: list[Row] = []
    for row, values in _combinations(term.variables, place, term):
        try:
            true = _truth(term.value(values), term, place)
        except UndefinedTermError:
            true = False
        (holds if true else fails).append(row)
    return holds, fails


def prices(parts: Sequence[tuple[Exact, Term]], scope: Sequence[Variable], place: Place) -> dict[Row, Price]:
    """Return what a weighted sum of terms is for each row of `scope`; `math.inf` where it has no value."""
    found: dict[Row, Price] = {}
    for row, values in _combinations(scope, place, parts[0][1]):
        try:
            found[row] = _total([(factor, _price(term, values, place)) for factor, term in parts])
        except UndefinedTermError:
            found[row] = math.inf
    return found


def listed_rows(term: Tabled) -> dict[Row, object] | None:
    """Return the rows of a table over distinct variables. None: it is over other terms."""
    variables = [one for one in term.arguments if isinstance(one, Variable)]
    if len(term.variables) < len(term.arguments) or len(variables) < len(term.arguments):
        return None
    found = {}
    for row, value in term.rows.items():
        codes = [variable.codes.code(one) for variable, one in zip(variables, row, strict=True)]
        if None not in codes:
            found[tuple(code for code in codes if code is not None)] = value
    return found


def commonest(found: Mapping[Row, Price]) -> Price:
    """Return the price of most rows."""
    return Counter(found.values()).most_common(1)[0][0] if found else 0


def _combinations(scope: Sequence[Variable], place: Place, term: Term) -> Iterator[tuple[Row, dict[Variable, object]]]:
    size = math.prod(len(variable.codes.ever) for variable in scope)
    if size > MAX_COMBINATIONS:
        raise ModelError(
            f"{in_short(term)} has {size:,} combinations of values, and files can express it only as a table",
            f"{MAX_COMBINATIONS:,} are computed: split it, or write it with integers",
            place,
        )
    values = [[(code, variable.codes.value(code)) for code in variable.codes.ever] for variable in scope]
    for row in itertools.product(*values):
        told = {variable: value for variable, (_, value) in zip(scope, row, strict=True)}
        yield tuple(code for code, _ in row), told


def in_short(term: Term) -> str:
    """Return a term as users wrote it, shortened for a message."""
    return repr(term) if len(repr(term)) <= 60 else f"{repr(term)[:57]}..."  # noqa: PLR2004 - of a message


def _truth(value: object, term: Term, place: Place) -> bool:
    if is_truth(value):
        return bool(value)
    raise ModelTypeError(f"{term!r} gives {value!r}, no truth value", "let it return True or False", place)


def _price(term: Term, values: Mapping[Variable, object], place: Place) -> Price:
    value = term.value(values)
    if is_infinite(value):
        return math.inf
    if not is_number(value) or value != value:  # noqa: PLR0124 - not a number
        raise ModelTypeError(f"{term!r} gives {value!r}, no number", "let it return a number", place)
    return exact(value)


def _total(parts: Sequence[tuple[Exact, Price]]) -> Price:
    total: Exact = 0
    for factor, price in parts:
        if isinstance(price, float):
            return math.inf
        total += factor * price
    return exact(total)
