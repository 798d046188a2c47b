"""Exact numbers: the user's numbers as integers or fractions."""

from __future__ import annotations

import math
import operator
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

from robochoc.model.cost_units import MAX_PLACES
from robochoc.modelling.errors import ModelError, ModelTypeError, SourceLine

Exact = int | Fraction
"""An exact number: an integer, or a `Fraction` if it is not an integer."""

_FAR = 400
"""The largest power of ten in decimals, positive or negative: larger ones make fractions that fill the memory."""


def is_number(value: object) -> bool:
    """Return whether `value` is a number of Python or NumPy, including truth values."""
    if isinstance(value, (Real, Decimal)) or is_truth(value):
        return True
    return hasattr(value, "__index__") and not hasattr(value, "__len__")  # arrays have `__len__`


def is_truth(value: object) -> bool:
    """Return whether `value` is a truth value of Python or NumPy, without importing NumPy."""
    return isinstance(value, bool) or (type(value).__module__ == "numpy" and type(value).__name__ in {"bool", "bool_"})


def whole_number(value: object) -> int | None:
    """Return an integer of Python or NumPy as a Python integer, or None for any other value."""
    return int(value) if isinstance(value, Integral) else None


def is_infinite(value: object) -> bool:
    """Return whether `value` is an infinite float, the cost that forbids."""
    return isinstance(value, Real) and not isinstance(value, Rational) and math.isinf(value)


def exact(value: object) -> Exact:
    """Return `value` as an exact number. A float has the value of its decimal text: 0.1 is one tenth.

    Raises:
        ModelError: if `value` is not a finite number, or is too large or too small.
    """
    if is_truth(value):
        return 1 if value else 0
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Rational):
        return _whole_if_possible(Fraction(value))
    if isinstance(value, Decimal) and value.is_finite():
        if value and not -_FAR <= value.adjusted() <= _FAR:
            raise ModelError(f"the number {value} is too large or too small", "a cost has at most 18 digits")
        return _whole_if_possible(Fraction(value))
    if isinstance(value, Real) and math.isfinite(value):
        return _whole_if_possible(Fraction(str(value)))
    if hasattr(value, "__index__"):
        return operator.index(value)
    raise ModelTypeError(f"{value!r} is not a finite number", "expected int, Decimal, Fraction or float")


def _whole_if_possible(value: Fraction) -> Exact:
    return value.numerator if value.denominator == 1 else value


def places_of(value: Exact, place: SourceLine | None = None) -> int:
    """Return the number of decimal places of a cost.

    Args:
        value: A cost.
        place: The line that created the cost.

    Raises:
        ModelError: if the cost has more than nine places.
    """
    places = decimal_places(value)
    if places is not None:
        return places
    hint = "round all costs by minimize(..., places=3) or maximize(..., places=3), or one cost by round(cost, 3)"
    text = float(value) or f"close to {'-' * (value < 0)}0"
    raise ModelError(f"the cost {text} has more than {MAX_PLACES} decimal places", hint, place)


def check_places(places: object) -> int | None:
    """Return the valid number of decimal places for costs, or None for exact costs. Raises `ModelError`."""
    whole = whole_number(places)
    if places is not None and (whole is None or not 0 <= whole <= MAX_PLACES):
        raise ModelTypeError(f"invalid places={places!r}", f"expected an integer from 0 to {MAX_PLACES}")
    return whole


def rounded(value: Exact, places: int | None) -> Exact:
    """Return `value` rounded half to even to `places` decimal places. None: not rounded."""
    return value if places is None else _whole_if_possible(round(Fraction(value), places))


def shown(value: Exact) -> str:
    """Return a number as text: as a decimal if it has few enough places for a cost, otherwise as a fraction."""
    places = decimal_places(value)
    return str(value) if places is None else f"{Decimal(int(value * 10**places)).scaleb(-places):f}"


def decimal_places(value: Exact) -> int | None:
    """Return the number of decimal places, or None if there are too many for a cost."""
    denominator = Fraction(value).denominator
    return next((places for places in range(MAX_PLACES + 1) if 10**places % denominator == 0), None)
