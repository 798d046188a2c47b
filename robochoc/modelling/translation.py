"""Translates terms into the integer expressions of XML files (docs/reference/format.md, "Functional expressions").

A number that may be a fraction becomes an integer expression and a divisor, so nothing is rounded. `//` and `%` round
down in Python but toward zero in files; the translation corrects this with `mod`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.model.expression import Apply, Constant, Expression, Name
from robochoc.model.expression.bounds import Interval, bounds, excess
from robochoc.modelling.codes import BOOLEAN, NUMBER
from robochoc.modelling.numbers import exact
from robochoc.modelling.tables import MAX_COMBINATIONS
from robochoc.modelling.terms import ConstantTerm, Linear, ModelVariable, Operation, Term
from robochoc.system.errors import RobochocError

MAX_SIZE = 5_000
"""The maximum number of operators and terms in an expression; each nested quotient doubles the number."""
MAX_LEVELS = 60
"""The maximum depth of an expression."""


class UntranslatableError(RobochocError):
    """The term has no equivalent expression, and must become a table."""


class Scaled(NamedTuple):
    """A number, stored as an integer expression that is divided by `divisor` (1 or more)."""

    expression: Expression
    divisor: int = 1


class Translator:
    """Translates terms over variables. `names` contains the variables' names in the expressions."""

    def __init__(self, names: Mapping[ModelVariable, str]) -> None:
        self._names = names
        self._limits = {name: _interval(variable) for variable, name in names.items()}
        self._combinations = math.prod(len(variable.codes.ever) for variable in names)

    def whole_condition(self, term: Term) -> Expression:
        """Return a Boolean expression that fits into a file. Raises `UntranslatableError`."""
        return self._within_limits(self.condition(term))

    def whole_number(self, term: Term) -> Scaled:
        """Return a number whose expression fits into a file. Raises `UntranslatableError`."""
        found = self.number(term)
        return found._replace(expression=self._within_limits(found.expression))

    def _within_limits(self, expression: Expression) -> Expression:
        """Return `expression` if it fits into a file, and into 64 bits unless a table would be too large.

        Raises:
            UntranslatableError: if the term must become a table, whose entries have no such limit.
        """
        check_size(expression)
        if self._combinations <= MAX_COMBINATIONS and excess(expression, self._limits):
            raise UntranslatableError
        return expression

    def condition(self, term: Term) -> Expression:
        """Return a Boolean expression. Raises `UntranslatableError`."""
        match term:
            case ConstantTerm(given=given):
                return Apply("eq", (Constant(int(bool(given))), Constant(1)))
            case ModelVariable(kind=kind) if kind == BOOLEAN:
                return Apply("eq", (Name(self._names[term]), Constant(1)))
            case Operation(operator="and" | "or" | "not" | "xor" as operator, arguments=arguments):
                return Apply(operator, tuple(map(self.condition, arguments)))
            case Operation(operator="implies", arguments=(one, other)):
                return Apply("or", (Apply("not", (self.condition(one),)), self.condition(other)))
            case Operation(operator="different", arguments=arguments):
                pairs = [("ne", one, other) for n, one in enumerate(arguments) for other in arguments[:n]]
                found = tuple(self._comparison(*pair) for pair in pairs)
                return found[0] if len(found) == 1 else Apply("and", found)
            case Operation(operator=operator, arguments=arguments) if operator in _COMPARISONS:
                return self._comparison(operator, *arguments)
            case _:
                raise UntranslatableError

    def number(self, term: Term) -> Scaled:
        """Return a number. Raises `UntranslatableError`."""
        match term:
            case ConstantTerm(given=given):
                value = Fraction(exact(given))
                return Scaled(Constant(value.numerator), value.denominator)
            case ModelVariable(kind=kind) if kind in {NUMBER, BOOLEAN}:
                return Scaled(Name(self._names[term]), term.codes.scale)
            case Linear(parts=parts, constant=constant):
                return self._sum([(factor, self.number(one)) for factor, one in parts], Fraction(constant))
            case Operation(kind=kind) if kind == BOOLEAN:
                return Scaled(Apply("if", (self.condition(term), Constant(1), Constant(0))))
            case Operation(operator=operator, arguments=arguments):
                return self._applied(operator, arguments)
            case _:
                raise UntranslatableError

    def _applied(self, operator: str, arguments: Sequence[Term]) -> Scaled:
        if operator == "if":
            test, *chosen = arguments
            branches, divisor = _together(map(self.number, chosen))
            return Scaled(Apply("if", (self.condition(test), *branches)), divisor)
        numbers = [self.number(one) for one in arguments]
        match operator:
            case "abs" | "min" | "max":
                found, divisor = _together(numbers)
                return Scaled(Apply(operator, tuple(found)), divisor)
            case "mul":
                factors = tuple(one.expression for one in numbers)
                return Scaled(Apply("mul", factors), math.prod(one.divisor for one in numbers))
            case "floordiv" | "mod":
                return self._division(operator, numbers)
            case "element":
                return self._element(*numbers)
            case _:
                return self._power(*numbers)

    def _sum(self, parts: list[tuple[int | Fraction, Scaled]], constant: Fraction) -> Scaled:
        factors = [Fraction(factor) / number.divisor for factor, number in parts]
        divisor = math.lcm(constant.denominator, *(factor.denominator for factor in factors))
        whole = [int(factor * divisor) for factor in factors]
        numbers = [(factor, number.expression) for factor, (_, number) in zip(whole, parts, strict=True)]
        terms = [(factor, one) for factor, one in numbers if factor or may_be_undefined(one)]
        rest = int(constant * divisor)
        if not terms:
            return Scaled(Constant(rest), divisor)
        match terms:
            case [(1, one), (-1, other)] | [(-1, other), (1, one)] if not rest:
                return Scaled(Apply("sub", (one, other)), divisor)
            case [(1, one)] if rest:
                return Scaled(Apply("add" if rest > 0 else "sub", (one, Constant(abs(rest)))), divisor)
            case [(-1, one)] if rest:
                return Scaled(Apply("sub", (Constant(rest), one)), divisor)
        found = [_times(factor, expression) for factor, expression in terms]
        found += [Constant(rest)] if rest else []
        return Scaled(found[0] if len(found) == 1 else Apply("add", tuple(found)), divisor)

    def _division(self, operator: str, numbers: Sequence[Scaled]) -> Scaled:
        """Return the quotient rounded down, or the remainder with the sign of the divisor."""
        (left, right), divisor = _together(numbers)
        down = self._bounds(left).low >= 0 and self._bounds(right).low > 0
        rest = Apply("mod", (left, right))
        if not down:
            rest = Apply("mod", (Apply("add", (rest, right)), right))
        if operator == "mod":
            return Scaled(rest, divisor)
        return Scaled(Apply("div", (left if down else Apply("sub", (left, rest)), right)))

    def _element(self, index: Scaled, *array: Scaled) -> Scaled:
        if index.divisor != 1:
            raise UntranslatableError
        found, divisor = _together(array)
        place = index.expression
        chosen = [Apply("if", (Apply("eq", (place, Constant(n))), one, Constant(0))) for n, one in enumerate(found)]
        low, high = self._bounds(place)
        if low < 0 or high >= len(found):
            inside = Apply("and", (Apply("ge", (place, Constant(0))), Apply("lt", (place, Constant(len(found))))))
            undefined = Apply("div", (Constant(1), Constant(0)))
            chosen.append(Apply("if", (inside, Constant(0), undefined)))
        return Scaled(chosen[0] if len(chosen) == 1 else Apply("add", tuple(chosen)), divisor)

    def _power(self, base: Scaled, exponent: Scaled) -> Scaled:
        if base.divisor != 1 or exponent.divisor != 1 or self._bounds(exponent.expression).low < 0:
            raise UntranslatableError
        return Scaled(Apply("pow", (base.expression, exponent.expression)))

    def _comparison(self, operator: str, *sides: Term) -> Expression:
        symbolic = next((side for side in sides if isinstance(side, ModelVariable) and side.codes.symbolic), None)
        if symbolic is not None:
            return Apply(operator, tuple([self._symbol(side, symbolic) for side in sides]))
        found, _ = _together([self.number(side) for side in sides])
        return Apply(operator, tuple(found))

    def _symbol(self, term: Term, variable: ModelVariable) -> Expression:
        """Return the expression for the comparison of a symbol with `variable`. Raises `UntranslatableError`."""
        if isinstance(term, ModelVariable):
            return Name(self._names[term])
        code = variable.codes.code(term.given) if isinstance(term, ConstantTerm) else None
        if code is None:
            raise UntranslatableError
        return Constant(code)

    def _bounds(self, expression: Expression) -> Interval:
        return bounds(expression, self._limits)


_COMPARISONS = {"eq", "ne", "in", "lt", "le", "gt", "ge"}


def _interval(variable: ModelVariable) -> Interval:
    return Interval(*variable.codes.ends)


def _together(numbers: Sequence[Scaled] | map[Scaled]) -> tuple[list[Expression], int]:
    """Return the numbers as expressions with a common divisor, and that divisor."""
    found = list(numbers)
    divisor = math.lcm(*(one.divisor for one in found))
    return [_times(divisor // one.divisor, one.expression) for one in found], divisor


def _times(factor: int, expression: Expression) -> Expression:
    match factor, expression:
        case 1, _:
            return expression
        case _, Constant(value):
            return Constant(factor * value)
        case -1, _:
            return Apply("neg", (expression,))
        case _:
            return Apply("mul", (Constant(factor), expression))


def check_size(expression: Expression) -> None:
    """Raise `UntranslatableError` if `expression` is too large for a file. Shared subexpressions are visited once."""
    known: dict[int, tuple[int, int]] = {}

    def size(one: Expression) -> tuple[int, int]:
        if not isinstance(one, Apply):
            return 1, 1
        if id(one) not in known:
            parts = [size(argument) for argument in one.arguments]
            known[id(one)] = 1 + sum(count for count, _ in parts), 1 + max(depth for _, depth in parts)
        return known[id(one)]

    count, depth = size(expression)
    if count > MAX_SIZE or depth > MAX_LEVELS:
        raise UntranslatableError


def may_be_undefined(expression: Expression) -> bool:
    """Return whether an expression contains a quotient, a remainder or a power, and so may be undefined."""
    waiting = [expression]
    while waiting:
        one = waiting.pop()
        if isinstance(one, Apply):
            if one.operator in {"div", "mod", "pow"}:
                return True
            waiting += one.arguments
    return False
