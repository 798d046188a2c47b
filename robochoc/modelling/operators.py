"""The operators in terms: how to compute and print them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.modelling.codes import BOOLEAN, NUMBER, ValueKind
from robochoc.modelling.errors import ModelError
from robochoc.modelling.numbers import exact, is_number, shown
from robochoc.system.errors import RobochocError

MAX_BITS = 4096
"""The maximum number of bits of a power."""


class UndefinedTermError(RobochocError, ArithmeticError):
    """A term is undefined for this assignment, as in a division by zero."""


class TermOperator(NamedTuple):
    """An operator in terms.

    Attributes:
        gives: The kind of the resulting values.
        compute: Computes a value from the arguments' values.
        shown: The operator's name or symbol.
        lazy: As `compute`, but receives functions that return the arguments' values, for operators that do not need
            all.
    """

    gives: ValueKind
    compute: Callable[..., object]
    shown: str
    lazy: Callable[..., object] | None = None

    def text(self, arguments: Sequence[str]) -> str:
        """Return the operator applied to `arguments`, as a user would write it."""
        if self.shown.isidentifier():
            return f"{self.shown}({', '.join(arguments)})"
        if len(arguments) == 1:
            return f"{self.shown}{arguments[0]}"
        return f"({f' {self.shown} '.join(arguments)})"


def _equal(left: object, right: object) -> bool:
    if is_number(left) and is_number(right):
        return exact(left) == exact(right)
    return left == right


def _quotient(left: object, right: object) -> int:
    divisor = exact(right)
    if not divisor:
        raise UndefinedTermError
    return exact(left) // divisor


def _remainder(left: object, right: object) -> object:
    divisor = exact(right)
    if not divisor:
        raise UndefinedTermError
    return exact(left) % divisor


def _power(left: object, right: object) -> object:
    base, exponent = Fraction(exact(left)), exact(right)
    if not isinstance(exponent, int) or (not base and exponent < 0):
        raise UndefinedTermError
    bits = max(base.numerator.bit_length(), base.denominator.bit_length())
    if base not in {-1, 0, 1} and bits * abs(exponent) > MAX_BITS:
        raise ModelError(f"{shown(exact(base))} ** {exponent} has more than {MAX_BITS} bits", "use smaller numbers")
    return exact(base ** (exponent if abs(base) != 1 else exponent % 2))


def _product(left: object, right: object) -> object:
    return exact(left) * exact(right)


def _element(index: object, *array: object) -> object:
    """Return the element at an index from 0. Negative indices are undefined."""
    place = exact(index)
    if not isinstance(place, int) or not 0 <= place < len(array):
        raise UndefinedTermError
    return exact(array[place])


def _key(value: object) -> object:
    return exact(value) if is_number(value) else value


OPERATORS: dict[str, TermOperator] = {
    "abs": TermOperator(NUMBER, lambda x: abs(exact(x)), "abs"),
    "mul": TermOperator(NUMBER, _product, "*"),
    "floordiv": TermOperator(NUMBER, _quotient, "//"),
    "mod": TermOperator(NUMBER, _remainder, "%"),
    "pow": TermOperator(NUMBER, _power, "**"),
    "min": TermOperator(NUMBER, lambda *terms: min(map(exact, terms)), "minimum"),
    "max": TermOperator(NUMBER, lambda *terms: max(map(exact, terms)), "maximum"),
    "if": TermOperator(
        NUMBER,
        lambda test, then, otherwise: then if test else otherwise,
        "if_then_else",
        lambda test, then, otherwise: then() if test() else otherwise(),
    ),
    "eq": TermOperator(BOOLEAN, _equal, "=="),
    "ne": TermOperator(BOOLEAN, lambda x, y: not _equal(x, y), "!="),
    "in": TermOperator(BOOLEAN, lambda x, *members: any(_equal(x, one) for one in members), "is_in"),
    "lt": TermOperator(BOOLEAN, lambda x, y: exact(x) < exact(y), "<"),
    "le": TermOperator(BOOLEAN, lambda x, y: exact(x) <= exact(y), "<="),
    "gt": TermOperator(BOOLEAN, lambda x, y: exact(x) > exact(y), ">"),
    "ge": TermOperator(BOOLEAN, lambda x, y: exact(x) >= exact(y), ">="),
    "not": TermOperator(BOOLEAN, lambda x: not x, "~"),
    "and": TermOperator(BOOLEAN, lambda *terms: all(terms), "&"),
    "or": TermOperator(BOOLEAN, lambda *terms: any(terms), "|"),
    "xor": TermOperator(BOOLEAN, lambda x, y: bool(x) != bool(y), "^"),
    "implies": TermOperator(BOOLEAN, lambda x, y: bool(y) or not x, "implies"),
    "different": TermOperator(BOOLEAN, lambda *terms: len(set(map(_key, terms))) == len(terms), "all_different"),
    "element": TermOperator(NUMBER, _element, "element"),
}

PARTIAL = frozenset(("floordiv", "mod", "pow", "element"))
"""The operators whose value may be undefined."""
