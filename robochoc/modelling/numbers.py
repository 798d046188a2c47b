"""Exact numbers: what users write as a number, as an integer or a fraction."""

from __future__ import annotations

import math
import operator
from decimal import Decimal
from fractions import Fraction
from numbers import Integral, Rational, Real

from robochoc.model.cost_units import MAX_PLACES
from robochoc.modelling.places import ModelError, ModelTypeError, Place

Exact = int | Fraction
"""An exact number; a `Fraction` only where it is no integer."""

_FAR = 400
"""Decimals that are larger or smaller by this power of ten are refused: fractions of them fill the memory."""


def is_number(value: object) -> bool:
    """Return whether `value` is a number of Python or NumPy, a truth value included."""
    if isinstance(value, (Real, Decimal)) or is_truth(value):
        return True
    return hasattr(value, "__index__") and not hasattr(value, "__len__")  # which arrays have


def is_truth(value: object) -> bool:
    """Return whether `value` is a truth value of Python or NumPy, which is not imported."""
    return isinstance(value, bool) or (type(value).__module__ == "numpy" and type(value).__name__ in {"bool", "bool_"})


def whole_number(value: object) -> int | None:
    """Return an integer of Python or NumPy as Python's; None for anything else."""
    return int(value) if isinstance(value, Integral) else None


def is_infinite(value: object) -> bool:
    """Return whether `value` is a float that is infinite: the cost that forbids."""
    return isinstance(value, Real) and not isinstance(value, Rational) and math.isinf(value)


def exact(value: object) -> Exact:
    """Return the number `value` exactly. A float is what it is written as: 0.1 is one tenth.

    Raises:
        ModelError: if it is no finite number, or one that is too large to compute with.
    """
    if is_truth(value):
        return 1 if value else 0
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Rational):
        return _whole_if_possible(Fraction(value))
    if isinstance(value, Decimal) and value.is_finite():
        if value and not -_FAR <= value.adjusted() <= _FAR:
            raise ModelError(f"{value} is too large, or too small", "a cost has at most 18 digits")
        return _whole_if_possible(Fraction(value))
    if isinstance(value, Real) and math.isfinite(value):
        return _whole_if_possible(Fraction(str(value)))
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
    hint = "round it: minimize(..., places=3) and maximize(..., places=3) round every cost, round(cost, 3) rounds one"
    told = float(value) or f"close to {'-' * (value < 0)}0"
    raise ModelError(f"the cost {told} has more than {MAX_PLACES} decimal places", hint, place)


def check_places(places: object) -> int | None:
    """Return the number of decimal places to which costs are rounded; None: costs are exact. Raises `ModelError`."""
    whole = whole_number(places)
    if places is not None and (whole is None or not 0 <= whole <= MAX_PLACES):
        raise ModelTypeError(f"places={places!r}", f"expected an integer from 0 to {MAX_PLACES}")
    return whole


def rounded(value: Exact, places: int | None) -> Exact:
    """Return `value`, rounded half to even to `places` decimal places unless these are None."""
    return value if places is None else _whole_if_possible(round(Fraction(value), places))


def shown(value: Exact) -> str:
    """Return a number as a decimal where it is one that costs can be, and else as a fraction."""
    places = _places(value)
    return str(value) if places is None else f"{Decimal(int(value * 10**places)).scaleb(-places):f}"


def _places(value: Exact) -> int | None:
    """Return the decimal places of a number. None: it has more than a cost may have."""
    denominator = Fraction(value).denominator
    return next((places for places in range(MAX_PLACES + 1) if 10**places % denominator == 0), None)
