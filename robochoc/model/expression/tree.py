"""Trees of functional expressions, and their canonical text."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from enum import StrEnum

from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

BOUND = 2**63
"""A result beyond +-BOUND is undefined."""


class Type(StrEnum):
    """The type of an expression's value. Names (formal parameters or variables) are integers or symbols."""

    INTEGER = "integer"
    BOOLEAN = "Boolean"
    SYMBOL = "a symbol"
    SET = "a set"


@dataclass(frozen=True, slots=True)
class Constant:
    """An integer literal."""

    value: int


@dataclass(frozen=True, slots=True)
class Name:
    """A formal parameter of a predicate, or a variable."""

    name: str


@dataclass(frozen=True, slots=True)
class Apply:
    """An operator (under its XCSP 2.1 name) applied to arguments."""

    operator: str
    arguments: tuple[Expression, ...]


Expression = Constant | Name | Apply


class UndefinedValueError(RobochocError, ArithmeticError):
    """Raised if the expression has no value: a division by zero, a negative exponent, or a result out of bounds."""


class ExcessiveValueError(UndefinedValueError):
    """Raised if the expression or a part of it has a value beyond +-`BOUND`. Teams that allow this are invalid."""


PARTIAL = frozenset({"div", "mod", "pow"})
"""The operators that are undefined for some integers within the bounds."""

DECIMAL = "decimal"
"""The operator of a decimal in an expression over real numbers: its digits, and its number of decimal places.

`model/expression/fixed_point.py` replaces decimals by integers. No other operator contains them.
"""

SYMBOLIC = ("eq", "ne", "in")
"""The operators that compare symbols."""


def is_total(expression: Expression) -> bool:
    """Return whether `expression` has no operator that may be undefined."""
    if not isinstance(expression, Apply):
        return True
    return expression.operator not in PARTIAL and all(map(is_total, expression.arguments))


def text(expression: Expression, symbolic: Collection[str] = (), symbols: Sequence[str] = ()) -> str:
    """Return `expression` in XCSP 2.1's functional form, for `parse`: `ne(abs(sub(X,Y)),1)`.

    Args:
        expression: The expression.
        symbolic: The names in the expression that are symbols. Constants compared with them are written as symbols,
            `eq(X,'red')`.
        symbols: The symbols, by their codes. Other codes are written as integers.
    """
    match expression:
        case Constant(value):
            return str(value)
        case Name(name):
            return name
        case Apply(operator, (Constant(value), Constant(places))) if operator == DECIMAL:
            digits = str(abs(value)).rjust(places + 1, "0")
            return f"{'-' * (value < 0)}{digits[:-places]}.{digits[-places:]}"
        case Apply(operator, arguments):
            named = bool(symbolic) and operator in SYMBOLIC and any(_is_in(one, symbolic) for one in arguments)
            written = [
                f"'{symbols[one.value]}'"
                if named and isinstance(one, Constant) and 0 <= one.value < len(symbols)
                else text(one, symbolic, symbols)
                for one in arguments
            ]
            if operator == "in":
                return f"in({written[0]},set({','.join(written[1:])}))"
            return f"{operator}({','.join(written)})"


def _is_in(expression: Expression, names: Collection[str]) -> bool:
    return isinstance(expression, Name) and expression.name in names


def with_arguments(expression: Expression, actual: Mapping[str, Expression]) -> Expression:
    """Return `expression` with its names replaced by `actual` expressions."""
    match expression:
        case Name(name):
            return actual[name]
        case Apply(operator, arguments):
            return Apply(operator, tuple(with_arguments(argument, actual) for argument in arguments))
        case Constant():
            return expression


def names(expression: Expression) -> tuple[str, ...]:
    """Return the distinct names in `expression`, in order of appearance."""
    return tuple(dict.fromkeys(_every_name(expression)))


def _every_name(expression: Expression) -> Iterator[str]:
    match expression:
        case Name(name):
            yield name
        case Apply(_, arguments):
            for argument in arguments:
                yield from _every_name(argument)
        case Constant():
            pass


def total(terms: Iterable[Expression]) -> Expression:
    """Return the sum of any number of integer `terms`. `add` requires at least two terms."""
    given = tuple(terms)
    match given:
        case ():
            return Constant(0)
        case (only,):
            return only
        case _:
            return Apply("add", given)
