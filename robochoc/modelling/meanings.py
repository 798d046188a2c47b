"""What operators on terms mean, in exact numbers, and how they are shown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.modelling.codes import BOOLEAN, NUMBER, Kind
from robochoc.modelling.numbers import exact, is_number, shown
from robochoc.modelling.places import ModelError

MAX_BITS = 4096
"""The maximum number of bits of a power."""


class UndefinedTermError(ArithmeticError):
    """A term has no value here: a division by zero."""


class Meaning(NamedTuple):
    """An operator: what it gives and computes. A `lazy` one gets functions that return its arguments' values."""

    gives: Kind
    compute: Callable[..., object]
    shown: str
    lazy: Callable[..., object] | None = None

    def text(self, arguments: Sequence[str]) -> str:
        """Return it with `arguments`, as a user would write it."""
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
    """Return the element of an array at an index from 0 on. Negative ones are outside: nothing counts from the end."""
    place = exact(index)
    if not isinstance(place, int) or not 0 <= place < len(array):
        raise UndefinedTermError
    return exact(array[place])


def _key(value: object) -> object:
    return exact(value) if is_number(value) else value


MEANINGS: dict[str, Meaning] = {
    "abs": Meaning(NUMBER, lambda x: abs(exact(x)), "abs"),
    "mul": Meaning(NUMBER, _product, "*"),
    "floordiv": Meaning(NUMBER, _quotient, "//"),
    "mod": Meaning(NUMBER, _remainder, "%"),
    "pow": Meaning(NUMBER, _power, "**"),
    "min": Meaning(NUMBER, lambda *terms: min(map(exact, terms)), "minimum"),
    "max": Meaning(NUMBER, lambda *terms: max(map(exact, terms)), "maximum"),
    "if": Meaning(
        NUMBER,
        lambda test, then, otherwise: then if test else otherwise,
        "if_then_else",
        lambda test, then, otherwise: then() if test() else otherwise(),
    ),
    "eq": Meaning(BOOLEAN, _equal, "=="),
    "ne": Meaning(BOOLEAN, lambda x, y: not _equal(x, y), "!="),
    "in": Meaning(BOOLEAN, lambda x, *members: any(_equal(x, one) for one in members), "is_in"),
    "lt": Meaning(BOOLEAN, lambda x, y: exact(x) < exact(y), "<"),
    "le": Meaning(BOOLEAN, lambda x, y: exact(x) <= exact(y), "<="),
    "gt": Meaning(BOOLEAN, lambda x, y: exact(x) > exact(y), ">"),
    "ge": Meaning(BOOLEAN, lambda x, y: exact(x) >= exact(y), ">="),
    "not": Meaning(BOOLEAN, lambda x: not x, "~"),
    "and": Meaning(BOOLEAN, lambda *terms: all(terms), "&"),
    "or": Meaning(BOOLEAN, lambda *terms: any(terms), "|"),
    "xor": Meaning(BOOLEAN, lambda x, y: bool(x) != bool(y), "^"),
    "implies": Meaning(BOOLEAN, lambda x, y: bool(y) or not x, "implies"),
    "different": Meaning(BOOLEAN, lambda *terms: len(set(map(_key, terms))) == len(terms), "all_different"),
    "element": Meaning(NUMBER, _element, "element"),
}

PARTIAL = frozenset(("floordiv", "mod", "pow", "element"))
"""The operators that may have no value, however their arguments are."""
