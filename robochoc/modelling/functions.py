"""Terms that no operator makes: all different, tables, elements of arrays, resources, functions of the user's."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from robochoc.modelling.codes import NUMBER, kind_of
from robochoc.modelling.numbers import exact, is_infinite, is_number
from robochoc.modelling.places import ModelError, ModelTypeError, here
from robochoc.modelling.tabulated import Called, Tabled
from robochoc.modelling.terms import Applied, Term, Variable, all_of, condition, number, term_of


def all_different(*terms: object) -> Term:
    """Return the condition that no two of `terms` are equal. It takes them one by one, or as one list.

    As a hard constraint it becomes one of each pair, so that every protocol can work on it.

    Raises:
        ModelTypeError: if they are of different kinds.
    """
    found = _several(terms)
    kinds = {term.kind for term in found} - {None}
    if len(kinds) > 1:
        one, other = sorted(map(str, kinds))[:2]
        raise ModelTypeError(f"{one} and {other} in all_different", "they are never equal: give terms of one kind")
    return Applied("different", *found) if len(found) > 1 else term_of(value=True)


def minimum(*terms: object) -> Term:
    """Return the least of numbers, given one by one or as one list."""
    return _extreme("min", terms)


def maximum(*terms: object) -> Term:
    """Return the greatest of numbers, given one by one or as one list."""
    return _extreme("max", terms)


def if_then_else(test: object, then: object, otherwise: object) -> Term:
    """Return a number: `then` where the condition `test` holds, else `otherwise`."""
    return Applied("if", condition(test), number(then), number(otherwise))


def element(array: Iterable[object], index: object) -> Term:
    """Return the number at `index` in `array`, whose elements are numbers or terms. The first has the index 0.

    A constraint in which the index is outside of the array is violated. There are no negative indices.
    """
    found = [number(one) for one in array]
    if not found:
        raise ModelError("an array without elements")
    return Applied("element", number(index), *found)


def cumulative(
    starts: Sequence[object], durations: Sequence[object], demands: Sequence[object], capacity: object
) -> Term:
    """Return the condition that tasks never need more of a resource at a time than there is.

    Args:
        starts: When each task begins.
        durations: How long each takes. It does not run any more at its start plus that.
        demands: How much each needs while it runs.
        capacity: How much there is.

    Raises:
        ModelError: if there are not as many durations and demands as starts.
    """
    if not len(starts) == len(durations) == len(demands):
        raise ModelError(f"{len(starts)} starts, {len(durations)} durations and {len(demands)} demands")
    tasks = [(number(start), number(length), number(need)) for start, length, need in zip(starts, durations, demands)]  # noqa: B905 - checked above
    peaks = []
    for start, _, _ in tasks:
        running = ((other <= start) & (start < other + length) for other, length, _ in tasks)
        peaks.append(sum(need * one for one, (_, _, need) in zip(running, tasks, strict=True)) <= number(capacity))
    return all_of(peaks)


def allowed(terms: object, rows: Iterable[object]) -> Term:
    """Return the condition that the values of `terms` are one of `rows`.

    Args:
        terms: The terms, or one.
        rows: Tuples of values; of one term, values.
    """
    scope = _scope(terms)
    return Tabled(scope, dict.fromkeys(_rows(scope, rows), True), default=False)


def forbidden(terms: object, rows: Iterable[object]) -> Term:
    """Return the condition that the values of `terms` are none of `rows`. See `allowed`."""
    scope = _scope(terms)
    return Tabled(scope, dict.fromkeys(_rows(scope, rows), False), default=True)


def costs(terms: object, table: Mapping[Any, object], default: object = 0) -> Term:
    """Return the number that a table has for the values of `terms`.

    Args:
        terms: The terms, or one.
        table: Numbers by rows of values, or by values if it is one term. `math.inf` forbids a row.
        default: The number for all other rows; `math.inf` forbids them.
    """
    scope = _scope(terms)
    single = isinstance(terms, Term)
    rows = {(key,) if single else tuple(_row(key)): value for key, value in table.items()}
    for value in (*rows.values(), default):
        if not _is_cost(value):
            raise ModelTypeError(f"{value!r} is no cost", "expected a number, or math.inf to forbid")
    return Tabled(scope, {key: rows[key] for key in _rows(scope, rows)}, _cost(default))


def function(function: Callable[..., object], *terms: object) -> Term:
    """Return the term that a Python function computes from the values of `terms`.

    A function that returns truth values is a condition, one that returns numbers can be minimised; `math.inf` forbids.
    It is called with all combinations of values when the problem is solved or saved; robots get the table.

    Args:
        function: The function. It gets the values in the order of `terms`, and returns the same for the same ones.
        *terms: Variables, or terms of them.
    """
    return Called(function, tuple(map(term_of, terms)), here())


def _several(terms: tuple[object, ...]) -> list[Term]:
    given = terms[0] if len(terms) == 1 and not isinstance(terms[0], Term) else terms
    if not isinstance(given, Iterable) or isinstance(given, str):
        raise ModelTypeError(f"{given!r} is no list of terms")
    return [term_of(one) for one in given]


def _extreme(operator: str, terms: tuple[object, ...]) -> Term:
    found = [number(one) for one in _several(terms)]
    if not found:
        raise ModelError("the least or greatest of nothing")
    return Applied(operator, *found) if len(found) > 1 else found[0]


def _scope(terms: object) -> tuple[Term, ...]:
    found = _several((terms,)) if not isinstance(terms, Term) else [terms]
    if not found:
        raise ModelError("a table over nothing")
    return tuple(found)


def _row(row: object) -> Sequence[object]:
    if isinstance(row, str) or not isinstance(row, Sequence):
        raise ModelTypeError(f"{row!r} is no row of values", "write a tuple: (1, 2)")
    return row


def _rows(scope: tuple[Term, ...], rows: Iterable[object]) -> list[tuple[object, ...]]:
    """Return rows as tuples, if they are as long as the scope and of its kinds. Raises `ModelError`."""
    found = []
    for one in rows:
        row = (one,) if _is_value(scope, one) else tuple(_row(one))
        if len(row) != len(scope):
            raise ModelError(f"the row {row!r} has {len(row)} values, and there are {len(scope)} terms")
        for term, value in zip(scope, row, strict=True):
            _check_value(term, value)
        found.append(row)
    return found


def _is_value(scope: tuple[Term, ...], row: object) -> bool:
    """Return whether `row` is a value of the only term of `scope`, and no row with that."""
    if len(scope) > 1:
        return False
    if scope[0].kind == kind_of(()):
        return not (isinstance(row, tuple) and len(row) == 1 and isinstance(row[0], tuple))
    return not isinstance(row, (tuple, list))


def _check_value(term: Term, value: object) -> None:
    if is_number(value) and term.kind in {NUMBER, None}:
        return
    if isinstance(term, Variable) or not is_number(value):
        _ = term == value  # raises where the kinds differ, or it is no value of the variable


def _is_cost(value: object) -> bool:
    return is_number(value) and value == value  # noqa: PLR0124 - a number


def _cost(value: object) -> object:
    return math.inf if is_infinite(value) else exact(value)
