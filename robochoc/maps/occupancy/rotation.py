"""Rotated maps: the yaw of a map's origin, as a number of quarter turns and the sine and cosine of the rest.

Sines are computed in integers, to 40 decimal places, so that the cells of rotated maps are the same on every machine.
"""

from __future__ import annotations

from fractions import Fraction

from robochoc.system.lazy_dataclass import dataclass

_ONE = 10**50
_PLACES = 10**40
_HALF_PI = Fraction(1_570796_326794_896619_231321_691639_751442_098584_699687_552910_487, 10**57)
_TERMS = 45
"""The number of terms in the series, the last of which is below 10**-50 for angles below 1."""

Place = tuple[Fraction, Fraction]
"""The x and y of a place, in metres or pixels."""


@dataclass(frozen=True)
class Rotation:
    """A counterclockwise rotation around the origin by less than an eighth of a circle."""

    cosine: Fraction = Fraction(1)
    sine: Fraction = Fraction(0)

    @property
    def is_zero(self) -> bool:
        """True if the angle is 0."""
        return not self.sine

    def rotated(self, place: Place) -> Place:
        """Return the rotated place."""
        x, y = place
        return (self.cosine * x - self.sine * y, self.sine * x + self.cosine * y) if self.sine else place

    def rotated_back(self, place: Place) -> Place:
        """Return the place rotated by the opposite angle."""
        x, y = place
        return (self.cosine * x + self.sine * y, self.cosine * y - self.sine * x) if self.sine else place


NO_ROTATION = Rotation()


def split_yaw(yaw: Fraction, reach: Fraction) -> tuple[int, Rotation]:
    """Return the quarter turns of a yaw, 0 to 3, and the remaining rotation by at most an eighth of a circle.

    Args:
        yaw: The angle in radians. Quarter turns may be given with few decimal places.
        reach: The remaining rotation is omitted if it moves points within this radius by at most 1/100.
    """
    quarters = round(yaw / _HALF_PI)
    rest = yaw - quarters * _HALF_PI
    if abs(rest) * reach * 100 <= 1:
        return quarters % 4, NO_ROTATION
    return quarters % 4, Rotation(*_cosine_and_sine(rest))


def _cosine_and_sine(angle: Fraction) -> tuple[Fraction, Fraction]:
    """Return the cosine and the sine, by their Taylor series."""
    x = round(angle * _ONE)
    sums, term = [0, 0], _ONE
    for power in range(_TERMS):
        sums[power % 2] += term if power % 4 < 2 else -term  # noqa: PLR2004 - signs are + + - -
        term = term * x // (_ONE * (power + 1))
    cosine, sine = (Fraction(round(Fraction(total * _PLACES, _ONE)), _PLACES) for total in sums)
    return cosine, sine
