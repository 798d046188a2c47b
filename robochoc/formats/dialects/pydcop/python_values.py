"""Python's operators and some of its functions, exact and bounded, on the values in pyDCOP's functions.

Numbers are integers and fractions: `0.1 + 0.2` is 0.3 here. Only infinities are floats.

Each operation is one call of C code, which cannot be interrupted. Its cost is therefore bounded by the size of its
operands: numbers have at most `MAX_BITS` bits, and lists and dictionaries are `BoundedTuple` and `BoundedDict`, whose
size counts nested members as often as they can be reached.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction

from robochoc.system.errors import RobochocError

Value = None | bool | int | Fraction | float | str | tuple["Value", ...] | dict["Value", "Value"]
"""The value of an expression. Lists and dictionaries are always `BoundedTuple` and `BoundedDict`."""

MAX_BITS = 1024
"""The maximum size of a number, and of its denominator, in bits."""
MAX_ITEMS = 100_000
"""The maximum size of a value: the number of its members, including the members of members."""
MAX_NESTING = 50
"""The maximum depth of lists in lists."""
_MAX_COLLISIONS = 16
"""The maximum number of different keys with the same hash. With more keys, a lookup becomes a linear search."""

_DECIMAL = re.compile(r"\s*[+-]?[0-9]{1,18}(\.[0-9]{1,18})?\s*")
_PLACES = 18


class NoValueError(RobochocError):
    """Raised if the function has no value for these arguments. The message is the reason."""


class _Sized:
    """The size of a list or dictionary: `size` members on all levels, and `nesting` levels."""

    size: int
    nesting: int

    def _measure(self, members: Iterable[Value]) -> None:
        """Set the size. Raises `NoValueError` if it is too large."""
        size = nesting = 0
        for member in members:
            size += max(1, size_of(member))
            if isinstance(member, (BoundedTuple, BoundedDict)):
                nesting = max(nesting, member.nesting)
            if size > MAX_ITEMS:
                raise NoValueError(f"a list has more than {MAX_ITEMS} members, those of its members included")
        if nesting >= MAX_NESTING:
            raise NoValueError(f"lists are nested more than {MAX_NESTING} levels deep")
        self.size, self.nesting = size, nesting + 1


class BoundedTuple(tuple["Value", ...], _Sized):  # noqa: SLOT001 - a tuple cannot have any
    """A list or tuple. Raises `NoValueError` if it is too large."""

    def __init__(self, members: Iterable[Value]) -> None:  # noqa: ARG002 - `tuple` has read them
        self._measure(self)


class BoundedDict(dict["Value", "Value"], _Sized):
    """A dictionary. Raises `NoValueError` if it is too large, or if its keys are chosen to collide."""

    def __init__(self, entries: Mapping[Value, Value]) -> None:
        super().__init__(entries)
        self._measure([*self, *self.values()])


def size_of(value: Value) -> int:
    """Return the number of steps for one operation on `value`: 0 for a value without members."""
    if isinstance(value, (BoundedTuple, BoundedDict)):
        return value.size
    return len(value) if isinstance(value, str) else 0


def number(value: Value) -> int | Fraction | float:
    """Return `value`. Raises `NoValueError` unless it is a number."""
    if isinstance(value, (int, Fraction, float)):
        return value
    raise NoValueError(f"{_shown(value)} is not a number")


def bounded(value: Value) -> Value:
    """Return `value`. Raises `NoValueError` for a number that is too large, and for NaN."""
    if isinstance(value, Fraction):
        large = value.numerator.bit_length() > MAX_BITS or value.denominator.bit_length() > MAX_BITS
    elif isinstance(value, float):
        large = math.isnan(value)
    else:
        large = isinstance(value, int) and value.bit_length() > MAX_BITS
    if large:
        raise NoValueError("a number is too large")
    return value


def literal(value: object) -> Value:
    """Return a constant in the source as a value. A float is converted from its decimal text. Raises `NoValueError`."""
    if isinstance(value, float):
        return value if math.isinf(value) else Fraction(repr(value))
    if value is None or isinstance(value, (int, str)):
        return bounded(value)
    raise NoValueError(f"the constant {value!r:.60}")


def divide(left: Fraction | float, right: Fraction | float) -> Value:
    """Return the exact quotient."""
    if isinstance(left, float) or isinstance(right, float):
        return float(left) / float(right)
    return Fraction(left) / Fraction(right)


def power(base: Fraction | float, exponent: Fraction | float) -> Value:
    """Return the power. Its size is checked before the computation. Roots are computed as floats, like in Python."""
    if isinstance(base, float) or isinstance(exponent, float):
        raise NoValueError("a power of infinity")
    if exponent != int(exponent):
        if base < 0:
            raise NoValueError("a root of a negative number")
        return Fraction(repr(float(base) ** float(exponent)))
    size = max(Fraction(base).numerator.bit_length(), Fraction(base).denominator.bit_length())
    if abs(exponent) > MAX_BITS or size * abs(exponent) > 2 * MAX_BITS:
        raise NoValueError("a power is too large")
    integer = int(exponent)
    return base**integer if integer >= 0 else Fraction(base) ** integer


ARITHMETIC: dict[type[ast.operator], Callable[..., Value]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: divide,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: power,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.BitXor: operator.xor,
}
"""The arithmetic operators on two numbers."""
SIGNS: dict[type[ast.unaryop], Callable[..., Value]] = {ast.USub: operator.neg, ast.UAdd: operator.pos}
"""The signs of a number."""
COMPARISONS: dict[type[ast.cmpop], Callable[..., bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda one, many: one in many,
    ast.NotIn: lambda one, many: one not in many,
    ast.Is: operator.eq,
    ast.IsNot: operator.ne,
}
"""Comparisons of two values. `is` means `==`, since equal domain values need not be the same object."""


def _round(value: Value, places: Value = None) -> Value:
    rounded = number(value)
    if places is None:
        return round(rounded)
    if not isinstance(places, int) or abs(places) > _PLACES:
        raise NoValueError(f"round supports at most {_PLACES} places")
    return round(Fraction(rounded), places)


def _int(value: Value) -> Value:
    if isinstance(value, str):
        if not _DECIMAL.fullmatch(value) or "." in value:
            raise NoValueError(f"{_shown(value)} is not an integer")
        return int(value)
    return int(number(value))


def _float(value: Value) -> Value:
    if not isinstance(value, str):
        return number(value)
    if value.strip().lower().removeprefix("+") in ("inf", "infinity"):
        return math.inf
    if value.strip().lower() in ("-inf", "-infinity"):
        return -math.inf
    if not _DECIMAL.fullmatch(value):
        raise NoValueError(f"{_shown(value)} is not a number")
    return Fraction(value)


def _range(*ends: Value) -> Value:
    if not all(isinstance(end, int) for end in ends):
        raise NoValueError("range requires integers")
    values = range(*[int(number(end)) for end in ends])
    if len(values[: MAX_ITEMS + 1]) > MAX_ITEMS:  # `len` of a range has at most 63 bits
        raise NoValueError("a range is too long")
    return BoundedTuple(values)


def _power(base: Value, exponent: Value) -> Value:
    return power(number(base), number(exponent))


def _sum(values: Value) -> Value:
    total: Value = 0
    for one in items(values):
        total = bounded(number(total) + number(one))
    return total


FUNCTIONS: dict[str, Callable[..., Value]] = {
    "abs": lambda value: abs(number(value)),
    "all": all,
    "any": any,
    "bool": bool,
    "float": _float,
    "int": _int,
    "len": len,
    "max": max,
    "min": min,
    "pow": _power,
    "range": _range,
    "round": _round,
    "sum": _sum,
}
"""The allowed functions of Python."""
AGGREGATES = frozenset({"all", "any", "len", "max", "min", "sum"})
"""The functions whose result does not depend on the order of a set's members."""


def distinct(values: Iterable[Value]) -> BoundedTuple:
    """Return the different `values`. Raises `NoValueError` for values that cannot be in a set."""
    by_hash: dict[int, list[Value]] = {}
    try:
        for value in values:
            alike = by_hash.setdefault(hash(value), [])
            if value not in alike:
                alike.append(value)
            if len(alike) > _MAX_COLLISIONS:
                raise NoValueError("too many members of a set or keys of a dictionary have the same hash")
    except TypeError:
        raise NoValueError("a member of a set is a dictionary") from None
    return BoundedTuple(dict.fromkeys(values))


def items(value: Value) -> tuple[Value, ...]:
    """Return the members of `value` for a loop. Raises `NoValueError` unless it is a list, dictionary or text."""
    if isinstance(value, tuple):
        return value
    if isinstance(value, (str, dict)):
        return tuple(value)
    raise NoValueError(f"{_shown(value)} is not a list")


def _shown(value: Value) -> str:
    return f"{value!r:.40}" if not isinstance(value, Fraction) else str(float(value))
