"""Values, slopes and convexity of expressions over boxes of integers, by interval arithmetic without rounding.

The slopes of an expression enclose its generalised gradient, so that a mean value theorem holds also for `abs`, `min`
and `max` (Clarke, "Optimization and Nonsmooth Analysis", 1983). Convexity is recognised by the rules of disciplined
convex programming (Grant, Boyd and Ye, 2006).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from functools import reduce
from typing import NamedTuple

from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.expression.operators import OPERATORS
from robochoc.model.expression.tree import Apply, Constant, Expression, Name, Type

Box = Mapping[str, Interval]
Number = Fraction | int
Point = Mapping[str, Number]
Slopes = dict[str, Interval]


class LocalModel(NamedTuple):
    """An expression over a box, and near a point in it.

    Attributes:
        range: An interval that contains all values in the box.
        value: The value at the point.
        slopes: For each name, an interval that contains all slopes in the box. A missing name has the slope 0.
        gradient: For each name, a slope at the point; if the expression is convex or concave, a subgradient.
        convex: True if the expression is known to be convex on the box.
        concave: True if it is known to be concave.
    """

    range: Interval
    value: Number
    slopes: Slopes
    gradient: dict[str, Number]
    convex: bool
    concave: bool


def local_model(expression: Expression, box: Box, point: Point) -> LocalModel | None:
    """Return a model of `expression` without truncated quotients over `box`.

    None: the expression has steps in the box, or an operator without slopes.
    """
    match expression:
        case Constant(value):
            return LocalModel(Interval(value, value), value, {}, {}, convex=True, concave=True)
        case Name(name):
            one = {name: Interval(1, 1)}
            return LocalModel(box[name], point[name], one, {name: 1}, convex=True, concave=True)
        case Apply("if", (condition, then, otherwise)):
            low, high = bounds(condition, box)
            return local_model(then if low else otherwise, box, point) if low == high else None
        case Apply(operator, arguments) if OPERATORS[operator].gives == Type.INTEGER:
            parts = [local_model(argument, box, point) for argument in arguments]
            known = [part for part in parts if part is not None]
            if len(known) < len(parts) or operator not in _RULES:
                return None
            return _RULES[operator](*known)
        case _:
            return None


def _combined(factor: int, part: LocalModel) -> LocalModel:
    """Return `factor` times a model."""
    low, high = sorted((factor * part.range.low, factor * part.range.high))
    return LocalModel(
        Interval(low, high),
        factor * part.value,
        {name: _scaled(slope, Interval(factor, factor)) for name, slope in part.slopes.items()},
        {name: factor * slope for name, slope in part.gradient.items()},
        part.convex if factor >= 0 else part.concave,
        part.concave if factor >= 0 else part.convex,
    )


def _sum(*parts: LocalModel) -> LocalModel:
    slopes: Slopes = {}
    gradient: dict[str, Number] = {}
    for part in parts:
        for name, slope in part.slopes.items():
            before = slopes.get(name, Interval(0, 0))
            slopes[name] = Interval(before.low + slope.low, before.high + slope.high)
        for name, exact in part.gradient.items():
            gradient[name] = gradient.get(name, 0) + exact
    return LocalModel(
        Interval(sum(part.range.low for part in parts), sum(part.range.high for part in parts)),
        sum(part.value for part in parts),
        slopes,
        gradient,
        all(part.convex for part in parts),
        all(part.concave for part in parts),
    )


def _difference(left: LocalModel, right: LocalModel) -> LocalModel:
    return _sum(left, _combined(-1, right))


def _product(*parts: LocalModel) -> LocalModel:
    return reduce(_product_of_two, parts)


def _product_of_two(left: LocalModel, right: LocalModel) -> LocalModel:
    for factor, other in ((left, right), (right, left)):
        if factor.range.low == factor.range.high and not factor.slopes:
            return _combined(int(factor.range.low), other)
    slopes = _sum(_with_slopes(left, right.range), _with_slopes(right, left.range)).slopes
    gradient = {
        name: left.gradient.get(name, 0) * right.value + right.gradient.get(name, 0) * left.value
        for name in {**left.gradient, **right.gradient}
    }
    whole = _scaled(left.range, right.range)
    return LocalModel(whole, left.value * right.value, slopes, gradient, convex=False, concave=False)


def _with_slopes(part: LocalModel, factor: Interval) -> LocalModel:
    return part._replace(slopes={name: _scaled(slope, factor) for name, slope in part.slopes.items()})


def _scaled(one: Interval, other: Interval) -> Interval:
    ends = [left * right for left in one for right in other]
    return Interval(min(ends), max(ends))


def _composed(part: LocalModel, value: Number, highest: float, slope: Interval, at: Number) -> LocalModel:
    """Return a convex function with the minimum 0 at 0, whose slope over the box is `slope`, and `at` at the point."""
    is_rising = part.convex and part.range.low >= 0
    is_falling = part.concave and part.range.high <= 0
    return LocalModel(
        Interval(0, highest),
        value,
        {name: _scaled(one, slope) for name, one in part.slopes.items()},
        {name: at * one for name, one in part.gradient.items()},
        convex=is_rising or is_falling or (part.convex and part.concave),
        concave=False,
    )


def _square(part: LocalModel) -> LocalModel:
    low, high = part.range
    found = _composed(
        part, part.value * part.value, max(low * low, high * high), Interval(2 * low, 2 * high), 2 * part.value
    )
    return found if low <= 0 <= high else found._replace(range=Interval(min(low * low, high * high), found.range.high))


def _absolute(part: LocalModel) -> LocalModel:
    if part.range.low >= 0:
        return part
    if part.range.high <= 0:
        return _combined(-1, part)
    at = (part.value > 0) - (part.value < 0)
    size = max(part.value, -part.value)
    return _composed(part, size, max(-part.range.low, part.range.high), Interval(-1, 1), at)


def _distance(left: LocalModel, right: LocalModel) -> LocalModel:
    return _absolute(_difference(left, right))


def _power(base: LocalModel, exponent: LocalModel) -> LocalModel | None:
    number = int(exponent.value)
    if exponent.slopes or not 1 <= number <= _MOST_FACTORS:
        return None
    half = _product(*[base] * (number // 2 or 1))
    return _square(half) if number % 2 == 0 else _product(*[base] * number)


def _least(*parts: LocalModel) -> LocalModel:
    return _combined(-1, _greatest(*[_combined(-1, part) for part in parts]))


def _greatest(*parts: LocalModel) -> LocalModel:
    floor = max(part.range.low for part in parts)
    possible = [part for part in parts if part.range.high >= floor]
    if len(possible) == 1:
        return possible[0]
    names = {name for part in possible for name in part.slopes}
    zero = Interval(0, 0)
    slopes = {
        name: Interval(
            min(part.slopes.get(name, zero).low for part in possible),
            max(part.slopes.get(name, zero).high for part in possible),
        )
        for name in names
    }
    chosen = max(possible, key=lambda part: part.value)
    highest = max(part.range.high for part in possible)
    return LocalModel(
        Interval(floor, highest),
        chosen.value,
        slopes,
        chosen.gradient,
        all(one.convex for one in possible),
        concave=False,
    )


_MOST_FACTORS = 12
_RULES: dict[str, Callable[..., LocalModel | None]] = {
    "neg": lambda part: _combined(-1, part),
    "abs": _absolute,
    "sqr": _square,
    "add": _sum,
    "sub": _difference,
    "mul": _product,
    "pow": _power,
    "min": _least,
    "max": _greatest,
    "dist": _distance,
}
