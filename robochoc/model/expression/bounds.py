"""Bounds of an expression by interval arithmetic (Moore, "Interval Analysis", 1966): never too narrow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from functools import reduce
from typing import NamedTuple

from robochoc.model.expression.tree import BOUND, Apply, Constant, Expression, Name


class Interval(NamedTuple):
    """All integers from `low` to `high`; an end may be infinite."""

    low: float
    high: float


ANY_INTEGER = Interval(-math.inf, math.inf)
"""Nothing is known."""


def bounds(expression: Expression, limits: Mapping[str, Interval]) -> Interval:
    """Return an interval in which every defined value of `expression` lies.

    Args:
        expression: The expression.
        limits: Intervals in which the values of its names lie.
    """
    match expression:
        case Constant(value):
            return Interval(value, value)
        case Name(name):
            return limits[name]
        case Apply("if", (_, then, otherwise)):
            return _hull(bounds(then, limits), bounds(otherwise, limits))
        case Apply(operator, arguments):
            return _applied(operator, [bounds(argument, limits) for argument in arguments])


def _applied(operator: str, parts: list[Interval]) -> Interval:
    if operator in _BOUNDS:
        return _BOUNDS[operator](*parts)
    return Interval(0, 1)  # all others are Boolean


def _sum(*parts: Interval) -> Interval:
    return Interval(sum(part.low for part in parts), sum(part.high for part in parts))


def _difference(left: Interval, right: Interval) -> Interval:
    return Interval(left.low - right.high, left.high - right.low)


def _product(*parts: Interval) -> Interval:
    return reduce(_product_of_two, parts)


def _quotient(dividend: Interval, divisor: Interval) -> Interval:  # noqa: ARG001 - at least 1 or at most -1
    size = _absolute(dividend).high
    return Interval(-size, size)


def _remainder(dividend: Interval, divisor: Interval) -> Interval:  # noqa: ARG001 - it has the dividend's sign
    return Interval(min(0, dividend.low), max(0, dividend.high))


def _square(part: Interval) -> Interval:
    size = _absolute(part)
    return Interval(_times(size.low, size.low), _times(size.high, size.high))


def _power(base: Interval, exponent: Interval) -> Interval:  # noqa: ARG001 - no result is larger
    return Interval(0 if base.low >= 0 else -BOUND, BOUND)


def _hull(one: Interval, other: Interval) -> Interval:
    return Interval(min(one.low, other.low), max(one.high, other.high))


def _absolute(part: Interval) -> Interval:
    low = 0 if part.low <= 0 <= part.high else min(abs(part.low), abs(part.high))
    return Interval(low, max(abs(part.low), abs(part.high)))


def _product_of_two(one: Interval, other: Interval) -> Interval:
    ends = [_times(left, right) for left, right in itertools.product(one, other)]
    return Interval(min(ends), max(ends))


def _times(left: float, right: float) -> float:
    return left * right if left and right else 0  # zero times infinity is zero: the factor is zero everywhere


_BOUNDS: dict[str, Callable[..., Interval]] = {
    "neg": lambda part: Interval(-part.high, -part.low),
    "abs": _absolute,
    "add": _sum,
    "sub": _difference,
    "dist": lambda left, right: _absolute(_difference(left, right)),
    "mul": _product,
    "min": lambda *parts: Interval(min(part.low for part in parts), min(part.high for part in parts)),
    "max": lambda *parts: Interval(max(part.low for part in parts), max(part.high for part in parts)),
    "div": _quotient,
    "mod": _remainder,
    "sqr": _square,
    "pow": _power,
}
