"""Expressions over real numbers, as expressions over integers: fixed-point arithmetic.

A real variable is stored as a number of steps: with three decimal places, 1500 steps are 1.5. `fixed_point` converts an
expression over such variables to an expression over their steps. Sums, differences, products, powers, minima, maxima
and comparisons stay exact. Only quotients, and values that are rounded to fewer places, are truncated toward zero.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from robochoc.model.expression.operators import OPERATORS
from robochoc.model.expression.parser import ExpressionError
from robochoc.model.expression.tree import DECIMAL, Apply, Constant, Expression, Name, Type, text

VALUE_PLACES = 6
"""The decimal places of the value of an expression over real numbers, and of a quotient."""
MAX_PLACES = 18
"""The maximum number of decimal places of an intermediate result."""


class _Scaled(NamedTuple):
    """An integer expression whose value is a number of units of 10**-`places`."""

    body: Expression
    places: int


def fixed_point(
    expression: Expression, real: Collection[str], places: int, wanted: Type, value_places: int
) -> Expression:
    """Return `expression`, over real numbers, as an expression over integers.

    Args:
        expression: The expression. It may have decimals.
        real: The names that are real numbers, in units of 10**-`places`. All other names are integers.
        places: The number of decimal places of real numbers.
        wanted: The type of the value, Boolean or integer.
        value_places: The number of decimal places of the value, if it is a number: its unit is 10**-`value_places`.

    Raises:
        ExpressionError: if an intermediate result needs too many decimal places, or an exponent is not a constant.
    """
    scaled = _Converter(frozenset(real), places).convert(expression)
    return scaled.body if wanted == Type.BOOLEAN else _in_places(scaled, value_places)


class _Converter:
    def __init__(self, real: frozenset[str], places: int) -> None:
        self._real = real
        self._places = places

    def convert(self, expression: Expression) -> _Scaled:
        """Return `expression` with its number of decimal places."""
        match expression:
            case Constant():
                return _Scaled(expression, 0)
            case Name(name):
                return _Scaled(expression, self._places if name in self._real else 0)
            case Apply(operator, (Constant(digits), Constant(places))) if operator == DECIMAL:
                return _Scaled(Constant(digits), places)
            case Apply(operator, arguments):
                scaled = self._applied(operator, [self.convert(argument) for argument in arguments])
        if scaled.places > MAX_PLACES:
            raise ExpressionError(
                f"'{text(expression)[:40]}' has more than {MAX_PLACES} decimal places",
                0,
                "use a coarser precision, or fewer factors",
            )
        return scaled

    def _applied(self, operator: str, parts: list[_Scaled]) -> _Scaled:
        places = [part.places for part in parts]
        bodies = tuple(part.body for part in parts)
        match operator:
            case "mul":
                return _Scaled(Apply("mul", bodies), sum(places))
            case "sqr":
                return _Scaled(Apply("sqr", bodies), 2 * places[0])
            case "pow":
                return _power(*parts)
            case "div" if any(places):
                return _quotient(*parts)
            case "if":
                then, otherwise = _aligned(parts[1:])
                return _Scaled(Apply("if", (bodies[0], then, otherwise)), max(places[1:]))
            case _:
                is_number = OPERATORS[operator].gives == Type.INTEGER
                return _Scaled(Apply(operator, _aligned(parts)), max(places) if is_number else 0)


def _power(base: _Scaled, exponent: _Scaled) -> _Scaled:
    if not base.places and not exponent.places:
        return _Scaled(Apply("pow", (base.body, exponent.body)), 0)
    if exponent.places or not isinstance(exponent.body, Constant) or exponent.body.value < 0:
        raise ExpressionError("the exponent of a power of real numbers must be a constant integer, 0 or more", 0)
    return _Scaled(Apply("pow", (base.body, exponent.body)), base.places * exponent.body.value)


def _quotient(dividend: _Scaled, divisor: _Scaled) -> _Scaled:
    """Return a quotient with at least `VALUE_PLACES` decimal places."""
    missing = VALUE_PLACES + divisor.places - dividend.places
    finer = _in_places(dividend, dividend.places + max(missing, 0))
    return _Scaled(Apply("div", (finer, divisor.body)), VALUE_PLACES + max(-missing, 0))


def _aligned(parts: Sequence[_Scaled]) -> tuple[Expression, ...]:
    """Return the bodies of `parts` with the decimal places of the finest part."""
    places = max(part.places for part in parts)
    return tuple(_in_places(part, places) for part in parts)


def _in_places(scaled: _Scaled, places: int) -> Expression:
    """Return the expression in units of 10**-`places`, truncated toward zero if it has more places."""
    factor = 10 ** abs(places - scaled.places)
    if places < scaled.places:
        return Apply("div", (scaled.body, Constant(factor)))
    if isinstance(scaled.body, Constant):
        return Constant(scaled.body.value * factor)
    return scaled.body if factor == 1 else Apply("mul", (Constant(factor), scaled.body))
