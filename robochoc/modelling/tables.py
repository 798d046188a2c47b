"""Computes terms as tables: the values for all combinations of the variables' values, if no expression is possible."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine
from robochoc.modelling.numbers import Exact, exact, is_infinite, is_number, is_truth
from robochoc.modelling.operators import UndefinedTermError
from robochoc.modelling.terms import ModelVariable, TableTerm, Term

MAX_COMBINATIONS = 100_000
"""The maximum number of combinations of values in a computed table."""

Row = tuple[int, ...]
"""A row of codes."""

Price = Exact | float
"""A cost; `math.inf` forbids."""


def truths(term: Term, place: SourceLine) -> tuple[list[Row], list[Row]]:
    """Return the rows of `term.variables` in which a condition holds, and the rows in which it does not."""
    holds: list[Row] = []
    fails: list[Row] = []
    for row, values in _combinations(term.variables, place, term):
        try:
            true = _truth(term.value(values), term, place)
        except UndefinedTermError:
            true = False
        (holds if true else fails).append(row)
    return holds, fails


def prices(parts: Sequence[tuple[Exact, Term]], scope: Sequence[ModelVariable], place: SourceLine) -> dict[Row, Price]:
    """Return the value of a weighted sum of terms for each row of `scope`, or `math.inf` if the sum is undefined."""
    found: dict[Row, Price] = {}
    for row, values in _combinations(scope, place, parts[0][1]):
        try:
            found[row] = _total([(factor, _price(term, values, place)) for factor, term in parts])
        except UndefinedTermError:
            found[row] = math.inf
    return found


def listed_rows(term: TableTerm) -> dict[Row, object] | None:
    """Return a table over distinct variables with its rows as codes. None: its arguments are other terms, or real."""
    variables = [one for one in term.arguments if isinstance(one, ModelVariable)]
    if len(term.variables) < len(term.arguments) or len(variables) < len(term.arguments):
        return None
    if any(variable.codes.real for variable in variables):
        return None
    found = {}
    for row, value in term.rows.items():
        codes = [variable.codes.code(one) for variable, one in zip(variables, row, strict=True)]
        if None not in codes:
            found[tuple(code for code in codes if code is not None)] = value
    return found


def commonest(found: Mapping[Row, Price]) -> Price:
    """Return the most frequent price."""
    return Counter(found.values()).most_common(1)[0][0] if found else 0


def _combinations(
    scope: Sequence[ModelVariable], place: SourceLine, term: Term
) -> Iterator[tuple[Row, dict[ModelVariable, object]]]:
    real = next((one for one in scope if one.codes.real), None)
    if real is not None:
        hint = "use + - * / ** abs, minimum, maximum, if_then_else and comparisons"
        raise ModelError(f"{in_short(term)} can be expressed only as a table, and {real!r} is real", hint, place)
    size = math.prod(len(variable.codes.ever) for variable in scope)
    if size > MAX_COMBINATIONS:
        raise ModelError(
            f"{in_short(term)} can be expressed only as a table, and has {size:,} combinations of values",
            f"the maximum is {MAX_COMBINATIONS:,}: split it, or write it with integers",
            place,
        )
    values = [[(code, variable.codes.value(code)) for code in variable.codes.ever] for variable in scope]
    for row in itertools.product(*values):
        named = {variable: value for variable, (_, value) in zip(scope, row, strict=True)}
        yield tuple(code for code, _ in row), named


def in_short(term: Term) -> str:
    """Return the text of a term, shortened for a message."""
    return repr(term) if len(repr(term)) <= 60 else f"{repr(term)[:57]}..."  # noqa: PLR2004 - of a message


def _truth(value: object, term: Term, place: SourceLine) -> bool:
    if is_truth(value):
        return bool(value)
    raise ModelTypeError(f"{term!r} returns {value!r}, not a truth value", "return True or False", place)


def _price(term: Term, values: Mapping[ModelVariable, object], place: SourceLine) -> Price:
    value = term.value(values)
    if is_infinite(value):
        return math.inf
    if not is_number(value) or value != value:  # noqa: PLR0124 - not a number
        raise ModelTypeError(f"{term!r} returns {value!r}, not a number", "return a number", place)
    return exact(value)


def _total(parts: Sequence[tuple[Exact, Price]]) -> Price:
    total: Exact = 0
    for factor, price in parts:
        if isinstance(price, float):
            return math.inf
        total += factor * price
    return exact(total)
