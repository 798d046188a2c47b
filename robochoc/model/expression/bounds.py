"""Bounds on expressions by interval arithmetic (Moore, "Interval Analysis", 1966). They are never too narrow."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from typing import NamedTuple

from robochoc.model.expression.tree import BOUND, Apply, Constant, Expression, Name


class Interval(NamedTuple):
    """All integers from `low` to `high`. Either end may be infinite."""

    low: float
    high: float


ANY_INTEGER = Interval(-math.inf, math.inf)
"""The interval of an unknown value."""


def bounds(expression: Expression, limits: Mapping[str, Interval]) -> Interval:
    """Return an interval that contains every defined value of `expression`.

    Args:
        expression: The expression.
        limits: Intervals that contain the values of the names in the expression.
    """
    match expression:
        case Constant(value):
            return Interval(value, value)
        case Name(name):
            return limits[name]
        case Apply("if", (condition, then, otherwise)):
            low, high = bounds(condition, limits)
            if low == high:
                return bounds(then if low else otherwise, limits)
            return _hull(bounds(then, limits), bounds(otherwise, limits))
        case Apply(operator, arguments):
            return _applied(operator, [bounds(argument, limits) for argument in arguments])


class Excess(NamedTuple):
    """A part of an expression whose values may exceed +-`BOUND`, and the interval that contains them."""

    part: Expression
    interval: Interval


def excess(expression: Expression, limits: Mapping[str, Interval]) -> Excess | None:
    """Return a smallest part of `expression` that may have a result, or an intermediate result, beyond +-`BOUND`.

    Args:
        expression: The expression.
        limits: Intervals that contain the values of the names in the expression.
    """
    found: list[Excess] = []

    def checked(part: Expression) -> Interval:
        if not isinstance(part, Apply):
            return bounds(part, limits)
        parts = [checked(argument) for argument in part.arguments]
        steps = list(_steps(part.operator, parts))
        for step in steps:
            if not found and max(-step.low, step.high) > BOUND:
                found.append(Excess(part, step))
        return steps[-1]

    checked(expression)
    return found[0] if found else None


def _steps(operator: str, parts: list[Interval]) -> Iterator[Interval]:
    """Yield the intervals of all intermediate results of an operator. The last one is that of its value."""
    match operator:
        case "if":
            yield _hull(*parts[1:])
        case "add":
            yield from itertools.accumulate(parts, _sum)
        case "mul":
            yield from itertools.accumulate(parts, _product_of_two)
        case "pow":
            yield _raised(*parts)
        case _:
            yield _applied(operator, parts)


def _applied(operator: str, parts: list[Interval]) -> Interval:
    if operator in _BOUNDS:
        return _BOUNDS[operator](*parts)
    return _UNCERTAIN  # all other operators are Boolean


def _sum(*parts: Interval) -> Interval:
    return Interval(reduce(_plus, (part.low for part in parts)), reduce(_plus, (part.high for part in parts)))


def _difference(left: Interval, right: Interval) -> Interval:
    return Interval(_plus(left.low, -right.high), _plus(left.high, -right.low))


def _product(*parts: Interval) -> Interval:
    return reduce(_product_of_two, parts)


def _quotient(dividend: Interval, divisor: Interval) -> Interval:
    """Return the bounds of a truncated quotient. Its divisor is at least 1 or at most -1, since 0 has no quotient."""
    size = _absolute(dividend).high
    if divisor.low == 0 < divisor.high:
        divisor = Interval(1, divisor.high)
    elif divisor.high == 0 > divisor.low:
        divisor = Interval(divisor.low, -1)
    if divisor.low <= 0 <= divisor.high or any(end in _INFINITE for end in (*dividend, *divisor)):
        return Interval(-size, size)
    ends = [_truncated(int(part), int(by)) for part in dividend for by in divisor]
    return Interval(min(ends), max(ends))


def _truncated(dividend: int, divisor: int) -> int:
    size = abs(dividend) // abs(divisor)
    return size if (dividend < 0) == (divisor < 0) else -size


def _remainder(dividend: Interval, divisor: Interval) -> Interval:
    """Return the bounds of a remainder. It has the sign of the dividend, and is less than the divisor."""
    most = max(_absolute(divisor).high - 1, 0)
    return Interval(max(min(0, dividend.low), -most), min(max(0, dividend.high), most))


def _square(part: Interval) -> Interval:
    size = _absolute(part)
    return Interval(_times(size.low, size.low), _times(size.high, size.high))


def _power(base: Interval, exponent: Interval) -> Interval:
    low, high = _raised(base, exponent)
    return Interval(max(low, -BOUND), min(high, BOUND))  # results beyond the bound are undefined


def _raised(base: Interval, exponent: Interval) -> Interval:
    """Return the bounds of a power. They are infinite if the power has more than `_MAX_BITS` bits."""
    size, most = _absolute(base).high, exponent.high
    greatest: float = 1
    if size > 1 and most >= 1:
        is_finite = math.inf not in {size, most} and int(size).bit_length() * most <= _MAX_BITS
        greatest = size**most if is_finite else math.inf
    return Interval(0 if base.low >= 0 else -greatest, greatest)


def _hull(one: Interval, other: Interval) -> Interval:
    return Interval(min(one.low, other.low), max(one.high, other.high))


def _absolute(part: Interval) -> Interval:
    low = 0 if part.low <= 0 <= part.high else min(abs(part.low), abs(part.high))
    return Interval(low, max(abs(part.low), abs(part.high)))


def _product_of_two(one: Interval, other: Interval) -> Interval:
    ends = [_times(left, right) for left, right in itertools.product(one, other)]
    return Interval(min(ends), max(ends))


def _plus(left: float, right: float) -> float:
    """Return a sum of integers or equal infinities. Python cannot add a large integer to an infinity."""
    return left if left in _INFINITE else right if right in _INFINITE else left + right


def _times(left: float, right: float) -> float:
    """Return a product of integers or infinities. Zero times infinity is zero, since the factor is always zero."""
    if left in _INFINITE or right in _INFINITE:
        return 0 if not left or not right else math.inf if (left > 0) == (right > 0) else -math.inf
    return left * right


def _truth(*, is_true: bool, is_false: bool) -> Interval:
    """Return the interval of a Boolean that is certainly true, certainly false, or uncertain."""
    return Interval(int(is_true), int(not is_false))


def _less(left: Interval, right: Interval) -> Interval:
    return _truth(is_true=left.high < right.low, is_false=left.low >= right.high)


def _all_equal(*parts: Interval) -> Interval:
    lowest, highest = min(part.low for part in parts), max(part.high for part in parts)
    is_false = max(part.low for part in parts) > min(part.high for part in parts)
    return _truth(is_true=lowest == highest, is_false=is_false)


def _is_in(part: Interval, *members: Interval) -> Interval:
    return _greatest(*(_all_equal(part, member) for member in members))


def _negation(part: Interval) -> Interval:
    return Interval(1 - part.high, 1 - part.low)


def _least(*parts: Interval) -> Interval:
    return Interval(min(part.low for part in parts), min(part.high for part in parts))


def _greatest(*parts: Interval) -> Interval:
    return Interval(max(part.low for part in parts), max(part.high for part in parts))


_UNCERTAIN = Interval(0, 1)
_MAX_BITS = 4096
_INFINITE = (math.inf, -math.inf)

_BOUNDS: dict[str, Callable[..., Interval]] = {
    "neg": lambda part: Interval(-part.high, -part.low),
    "abs": _absolute,
    "add": _sum,
    "sub": _difference,
    "dist": lambda left, right: _absolute(_difference(left, right)),
    "mul": _product,
    "min": _least,
    "max": _greatest,
    "div": _quotient,
    "mod": _remainder,
    "sqr": _square,
    "pow": _power,
    "eq": _all_equal,
    "ne": lambda left, right: _negation(_all_equal(left, right)),
    "lt": _less,
    "le": lambda left, right: _negation(_less(right, left)),
    "gt": lambda left, right: _less(right, left),
    "ge": lambda left, right: _negation(_less(left, right)),
    "in": _is_in,
    "not": _negation,
    "and": _least,
    "or": _greatest,
    "iff": _all_equal,
    "imp": lambda condition, consequence: _greatest(_negation(condition), consequence),
}
