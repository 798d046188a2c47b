"""Functions that return terms: all different, tables, elements of arrays, resources, and Python functions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from robochoc.modelling.codes import NUMBER, kind_of
from robochoc.modelling.errors import ModelError, ModelTypeError, calling_line
from robochoc.modelling.numbers import exact, is_infinite, is_number
from robochoc.modelling.terms import (
    FunctionCall,
    ModelVariable,
    Operation,
    TableTerm,
    Term,
    all_of,
    condition,
    number,
    term_of,
)


def all_different(*terms: object) -> Term:
    """Return the condition that all `terms` differ pairwise. They are separate arguments or one list.

    As a hard constraint, it is split into a constraint for each pair, which all protocols support.

    Raises:
        ModelTypeError: if the terms are of different kinds.
    """
    found = _several(terms)
    kinds = {term.kind for term in found} - {None}
    if len(kinds) > 1:
        one, other = sorted(map(str, kinds))[:2]
        raise ModelTypeError(f"all_different mixes {one} and {other}", "they are never equal: use terms of one kind")
    return Operation("different", *found) if len(found) > 1 else term_of(value=True)


def minimum(*terms: object) -> Term:
    """Return the minimum of numbers, which are separate arguments or one list."""
    return _extreme("min", terms)


def maximum(*terms: object) -> Term:
    """Return the maximum of numbers, which are separate arguments or one list."""
    return _extreme("max", terms)


def if_then_else(test: object, then: object, otherwise: object) -> Term:
    """Return a number: `then` if the condition `test` holds, otherwise `otherwise`."""
    return Operation("if", condition(test), number(then), number(otherwise))


def element(array: Iterable[object], index: object) -> Term:
    """Return the element at `index` (from 0) of `array`, whose elements are numbers or terms.

    If the index is outside the array, the constraint is violated. Negative indices count as outside.
    """
    found = [number(one) for one in array]
    if not found:
        raise ModelError("the array of element() is empty")
    return Operation("element", number(index), *found)


def cumulative(
    starts: Sequence[object], durations: Sequence[object], demands: Sequence[object], capacity: object
) -> Term:
    """Return the condition that the demand of simultaneous tasks never exceeds the capacity of a resource.

    Args:
        starts: The start of each task.
        durations: The duration of each task, which ends just before start + duration.
        demands: The demand of each task while it runs.
        capacity: The capacity of the resource.

    Raises:
        ModelError: if the numbers of starts, durations and demands differ.
    """
    if not len(starts) == len(durations) == len(demands):
        raise ModelError(f"cumulative has {len(starts)} starts, {len(durations)} durations and {len(demands)} demands")
    tasks = [(number(start), number(length), number(need)) for start, length, need in zip(starts, durations, demands)]  # noqa: B905 - checked above
    peaks = []
    for start, _, _ in tasks:
        running = ((other <= start) & (start < other + length) for other, length, _ in tasks)
        peaks.append(sum(need * one for one, (_, _, need) in zip(running, tasks, strict=True)) <= number(capacity))
    return all_of(peaks)


def allowed(terms: object, rows: Iterable[object]) -> Term:
    """Return the condition that the values of `terms` are in `rows`.

    Args:
        terms: The terms, or a single term.
        rows: Tuples of values; for a single term, values.
    """
    scope = _scope(terms)
    return TableTerm(scope, dict.fromkeys(_rows(scope, rows), True), default=False)


def forbidden(terms: object, rows: Iterable[object]) -> Term:
    """Return the condition that the values of `terms` are not in `rows`. See `allowed`."""
    scope = _scope(terms)
    return TableTerm(scope, dict.fromkeys(_rows(scope, rows), False), default=True)


def costs(terms: object, table: Mapping[Any, object] | Iterable[Any], default: object = 0) -> Term:
    """Return a number that depends on the values of `terms` and is looked up in a table.

    Args:
        terms: The terms, or a single term.
        table: A mapping from tuples of values to numbers (for a single term, from values to numbers). `math.inf`
            forbids a tuple. For one variable, the table may also be a list of numbers in the order of the domain; for
            two variables, a matrix with a row for each value of the first variable; and so on. NumPy arrays are also
            allowed.
        default: The number for all other values; `math.inf` forbids them.
    """
    scope = _scope(terms)
    single = isinstance(terms, Term)
    if isinstance(table, Mapping) or hasattr(table, "items"):
        rows = {(key,) if single else tuple(_row(key)): value for key, value in table.items()}
    else:
        rows = dict(_entries(scope, table))
    for value in (*rows.values(), default):
        if not _is_cost(value):
            raise ModelTypeError(f"invalid cost {value!r}", "expected a number, or math.inf to forbid")
    return TableTerm(scope, {key: rows[key] for key in _rows(scope, rows)}, _cost(default))


def function(function: Callable[..., object], *terms: object) -> Term:
    """Return a term whose value a Python function computes from the values of `terms`.

    A function that returns truth values is a condition; a function that returns numbers can be minimised, and
    `math.inf` forbids the values. When the problem is solved or saved, the function is called with all combinations of
    values, and robots receive the resulting table.

    Args:
        function: The function. It receives the values in the order of `terms`, and must be deterministic.
        *terms: Variables, or terms over them.
    """
    return FunctionCall(function, tuple(map(term_of, terms)), calling_line())


def _several(terms: tuple[object, ...]) -> list[Term]:
    given = terms[0] if len(terms) == 1 and not isinstance(terms[0], Term) else terms
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise ModelTypeError(f"{given!r} is not a list of terms")
    return [term_of(one) for one in given]


def _extreme(operator: str, terms: tuple[object, ...]) -> Term:
    found = [number(one) for one in _several(terms)]
    if not found:
        raise ModelError(f"{operator} requires a list with at least one term")
    return Operation(operator, *found) if len(found) > 1 else found[0]


def _scope(terms: object) -> tuple[Term, ...]:
    found = _several((terms,)) if not isinstance(terms, Term) else [terms]
    if not found:
        raise ModelError("a table requires at least one term")
    return tuple(found)


def _entries(scope: Sequence[Term], table: object) -> Iterator[tuple[tuple[object, ...], object]]:
    """Yield the entries of a nested list, with the values of the variables in `scope`, in the order of the domains."""
    if not scope:
        yield (), table
        return
    first, *others = scope
    if not isinstance(first, ModelVariable):
        raise ModelTypeError(f"{first!r} is not a variable, so a list does not determine its values", "use a dict")
    if not isinstance(table, Iterable) or isinstance(table, str):
        raise ModelTypeError(f"{table!r} is not a list of costs", f"expected one for each value of {first!r}")
    costs = list(table)
    if len(costs) != len(first.domain):
        raise ModelError(f"a list has {len(costs)} costs, but {first!r} has {len(first.domain)} values")
    for value, part in zip(first.domain, costs, strict=True):
        for values, cost in _entries(others, part):
            yield (value, *values), cost


def _row(row: object) -> Sequence[object]:
    if isinstance(row, str) or not isinstance(row, Sequence):
        raise ModelTypeError(f"{row!r} is not a row of values", "write a tuple: (1, 2)")
    return row


def _rows(scope: tuple[Term, ...], rows: Iterable[object]) -> list[tuple[object, ...]]:
    """Return `rows` as tuples. Raises `ModelError` if their lengths or kinds do not match the scope."""
    found = []
    for one in rows:
        row = (one,) if _is_value(scope, one) else tuple(_row(one))
        if len(row) != len(scope):
            raise ModelError(f"the row {row!r} has {len(row)} values for {len(scope)} terms")
        for term, value in zip(scope, row, strict=True):
            _check_value(term, value)
        found.append(row)
    return found


def _is_value(scope: tuple[Term, ...], row: object) -> bool:
    """Return whether `row` is a value of the only term in `scope`, and not a tuple with that value."""
    if len(scope) > 1:
        return False
    if scope[0].kind == kind_of(()):
        return not (isinstance(row, tuple) and len(row) == 1 and isinstance(row[0], tuple))
    return not isinstance(row, (tuple, list))


def _check_value(term: Term, value: object) -> None:
    if is_number(value) and term.kind in {NUMBER, None}:
        return
    if isinstance(term, ModelVariable) or not is_number(value):
        _ = term == value  # raises if the kinds differ, or the value is not in the variable's domain


def _is_cost(value: object) -> bool:
    return is_number(value) and value == value  # noqa: PLR0124 - a number


def _cost(value: object) -> object:
    return math.inf if is_infinite(value) else exact(value)
