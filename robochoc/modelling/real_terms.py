"""Translates terms over real variables into expressions with decimals, for `model/expression/fixed_point.py`."""

from __future__ import annotations

from fractions import Fraction
from typing import Never

from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.expression.bounds import ANY_INTEGER, Interval
from robochoc.model.expression.tree import DECIMAL, total
from robochoc.modelling.numbers import Exact, decimal_places, exact
from robochoc.modelling.terms import ConstantTerm, ModelVariable, Term
from robochoc.modelling.translation import Scaled, Translator, UntranslatableError, check_size


class RealTranslator(Translator):
    """Translates terms over real variables. All numbers have the divisor 1, since the expressions have decimals."""

    def number(self, term: Term) -> Scaled:
        """Return a number. Raises `UntranslatableError`."""
        match term:
            case ConstantTerm(given=given):
                return Scaled(_times(exact(given), Constant(1)))
            case ModelVariable(codes=codes) if codes.real:
                return Scaled(Name(self._names[term]))
            case _:
                found = super().number(term)
                return Scaled(_times(Fraction(1, found.divisor), found.expression))

    def _sum(self, parts: list[tuple[int | Fraction, Scaled]], constant: Fraction) -> Scaled:
        terms = [(factor, number.expression) for factor, number in parts]
        terms += [(constant, Constant(1))] if constant else []
        plus = [_times(factor, one) for factor, one in terms if factor >= 0]
        minus = [_times(-factor, one) for factor, one in terms if factor < 0]
        if plus and minus:
            return Scaled(Apply("sub", (total(plus), total(minus))))
        return Scaled(Apply("neg", (total(minus),)) if minus else total(plus))

    def _element(self, index: Scaled, *array: Scaled) -> Never:  # noqa: ARG002 - an index is an integer
        raise UntranslatableError

    def _bounds(self, expression: Expression) -> Interval:
        return Interval(expression.value, expression.value) if isinstance(expression, Constant) else ANY_INTEGER

    def _within_limits(self, expression: Expression) -> Expression:
        check_size(expression)
        return expression


def _times(factor: Exact, expression: Expression) -> Expression:
    """Return the product of an expression and an exact number, which may be a fraction."""
    places = decimal_places(factor)
    if places is None:  # a decimal makes the quotient one of real numbers
        number = Fraction(factor)
        dividend = Apply("mul", (Apply(DECIMAL, (Constant(10 * number.numerator), Constant(1))), expression))
        return Apply("div", (dividend, Constant(number.denominator)))
    if factor == 1:
        return expression
    scaled = Constant(int(factor * 10**places))
    decimal = Apply(DECIMAL, (scaled, Constant(places))) if places else scaled
    return decimal if expression == Constant(1) else Apply("mul", (decimal, expression))
