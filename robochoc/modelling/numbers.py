"""Exact numbers: what users write as a number, as an integer or a fraction."""

from __future__ import annotations

import math
import operator
from decimal import Decimal
from fractions import Fraction

from robochoc.model.cost_units import MAX_PLACES
from robochoc.modelling.places import ModelError, ModelTypeError, Place

Exact = int | Fraction
"""An exact number; a `Fraction` only where it is no integer."""

_FAR = 400
"""Decimals that are larger or smaller by this power of ten are refused: fractions of them fill the memory."""


def is_number(value: object) -> bool:
    """Return whether `value` is a number, a truth value included."""
    return isinstance(value, (int, float, Decimal, Fraction)) or hasattr(value, "__index__")


def exact(value: object) -> Exact:
    """Return the number `value` exactly. A float is what it is written as: 0.1 is one tenth.

    Raises:
        ModelError: if it is no finite number, or one that is too large to compute with.
    """
    if isinstance(value, int):
        return int(value)
    if isinstance(value, Fraction):
        return _whole_if_possible(value)
    if isinstance(value, Decimal) and value.is_finite():
        if value and not -_FAR <= value.adjusted() <= _FAR:
            raise ModelError(f"{value} is too large, or too small", "a cost has at most 18 digits")
        return _whole_if_possible(Fraction(value))
    if isinstance(value, float) and math.isfinite(value):
        return _whole_if_possible(Fraction(repr(float(value))))
    if hasattr(value, "__index__"):
        return operator.index(value)
    raise ModelTypeError(f"{value!r} is no finite number", "int, Decimal, Fraction or float")


def _whole_if_possible(value: Fraction) -> Exact:
    return value.numerator if value.denominator == 1 else value


def places_of(value: Exact, place: Place | None = None) -> int:
    """Return how many decimal places `value` has.

    Args:
        value: A cost.
        place: Where it was made.

    Raises:
        ModelError: if it cannot be written with at most nine places.
    """
    places = _places(value)
    if places is not None:
        return places
    hint = f"a cost has at most {MAX_PLACES} decimal places: multiply all costs by a number that makes them so"
    told = value if Fraction(value).denominator.bit_length() < _FAR else float(value)
    raise ModelError(f"the cost {told} cannot be written as a decimal", hint, place)


def shown(value: Exact) -> str:
    """Return a number as a decimal where it is one that costs can be, and else as a fraction."""
    places = _places(value)
    return str(value) if places is None else f"{Decimal(int(value * 10**places)).scaleb(-places):f}"


def _places(value: Exact) -> int | None:
    """Return the decimal places of a number. None: it has more than a cost may have."""
    denominator = Fraction(value).denominator
    return next((places for places in range(MAX_PLACES + 1) if 10**places % denominator == 0), None)
