"""Expressions as Python functions, for fast repeated checks of a constraint.

The module shares no code with `operators`; tests compare their results.
"""

from __future__ import annotations

import math
import operator as arithmetic
from collections.abc import Callable, Sequence

from robochoc.model.expression.tree import (
    BOUND,
    Apply,
    Constant,
    ExcessiveValueError,
    Expression,
    Name,
    UndefinedValueError,
)

_TWO = 2

Closure = Callable[[Sequence[int]], int]


def compile_expression(expression: Expression, names: Sequence[str]) -> Closure:
    """Return `expression` as a function of the values of `names`, in their order. It is faster than `evaluate`.

    The function raises `UndefinedValueError` in the same cases as `evaluate`.

    Raises:
        ValueError: if a name of the expression is not in `names`.
    """
    match expression:
        case Constant(value):
            return lambda _values: value
        case Name(name):
            return arithmetic.itemgetter(names.index(name))
        case Apply("if", (condition, then, otherwise)):
            test, yes, no = (compile_expression(part, names) for part in (condition, then, otherwise))
            return lambda values: yes(values) if test(values) else no(values)
        case Apply(operator, arguments):
            return _CLOSURES[operator](*(compile_expression(argument, names) for argument in arguments))


def _within(value: int) -> int:
    if abs(value) > BOUND:
        raise ExcessiveValueError
    return value


def _add(*terms: Closure) -> Closure:
    def total(values: Sequence[int]) -> int:
        result = 0
        for term in terms:
            result = _within(result + term(values))
        return result

    return total


def _mul(*factors: Closure) -> Closure:
    def product(values: Sequence[int]) -> int:
        result = 1
        for factor in [factor(values) for factor in factors]:
            result = _within(result * factor)
        return result

    return product


def _same(*terms: Closure) -> Closure:
    if len(terms) == _TWO:
        left, right = terms
        return lambda values: 1 if left(values) == right(values) else 0
    return lambda values: 1 if len({term(values) for term in terms}) == 1 else 0


def _div(left: Closure, right: Closure) -> Closure:
    def quotient(values: Sequence[int]) -> int:
        dividend, divisor = left(values), right(values)
        if not divisor:
            raise UndefinedValueError
        floor, rest = divmod(dividend, divisor)
        return _within(floor + 1 if rest and floor < 0 else floor)

    return quotient


def _mod(left: Closure, right: Closure) -> Closure:
    def rest(values: Sequence[int]) -> int:
        dividend, divisor = left(values), right(values)
        if not divisor:
            raise UndefinedValueError
        size = abs(dividend) % abs(divisor)
        return size if dividend >= 0 else -size

    return rest


def _pow(left: Closure, right: Closure) -> Closure:
    def power(values: Sequence[int]) -> int:
        base, exponent = left(values), right(values)
        if exponent < 0:
            raise UndefinedValueError
        if base in {0, 1, -1}:
            return int(base ** min(exponent, 2 - exponent % 2))
        if exponent * math.log2(abs(base)) > BOUND.bit_length():
            raise ExcessiveValueError
        return _within(base**exponent)

    return power


_CLOSURES: dict[str, Callable[..., Closure]] = {
    "neg": lambda x: lambda values: _within(-x(values)),
    "abs": lambda x: lambda values: _within(abs(x(values))),
    "sqr": lambda x: lambda values: _within(x(values) ** 2),
    "add": _add,
    "sub": lambda x, y: lambda values: _within(x(values) - y(values)),
    "mul": _mul,
    "div": _div,
    "mod": _mod,
    "pow": _pow,
    "min": lambda *terms: lambda values: min([term(values) for term in terms]),
    "max": lambda *terms: lambda values: max([term(values) for term in terms]),
    "dist": lambda x, y: lambda values: _within(abs(x(values) - y(values))),
    "eq": _same,
    "in": lambda x, *members: lambda values: int(x(values) in [member(values) for member in members]),
    "ne": lambda x, y: lambda values: 1 if x(values) != y(values) else 0,
    "lt": lambda x, y: lambda values: 1 if x(values) < y(values) else 0,
    "le": lambda x, y: lambda values: 1 if x(values) <= y(values) else 0,
    "gt": lambda x, y: lambda values: 1 if x(values) > y(values) else 0,
    "ge": lambda x, y: lambda values: 1 if x(values) >= y(values) else 0,
    "not": lambda x: lambda values: 1 - x(values),
    "and": lambda *terms: lambda values: 1 if all([term(values) for term in terms]) else 0,  # noqa: C419 - all of them
    "or": lambda *terms: lambda values: 1 if any([term(values) for term in terms]) else 0,  # noqa: C419 - all of them
    "xor": lambda *terms: lambda values: sum([term(values) for term in terms]) % 2,
    "iff": _same,
    "imp": lambda x, y: lambda values: max(1 - x(values), y(values)),
}
