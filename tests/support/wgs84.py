"""Places on WGS 84 by way of earth-centred coordinates: exact, and nothing that robochoc's own formula shares.

Source: B. Hofmann-Wellenhof et al., "GNSS", 2008, Section 8.2 (geodetic to Cartesian, and back by iteration).
"""

from __future__ import annotations

from math import atan2, cos, degrees, hypot, radians, sin, sqrt
from typing import NamedTuple

_A = 6_378_137.0
_F = 1 / 298.257223563
_E2 = _F * (2 - _F)
_ROUNDS = 12

Xyz = tuple[float, float, float]


class Geodetic(NamedTuple):
    """Latitude and longitude in degrees, and the height above the ellipsoid in metres."""

    lat: float
    lon: float
    alt: float


def enu_of(place: Geodetic, origin: Geodetic) -> Xyz:
    """Return east, north and up of `place`, in metres, in the plane that touches the earth at `origin`."""
    dx, dy, dz = (one - other for one, other in zip(_ecef(place), _ecef(origin), strict=True))
    phi, lam = radians(origin.lat), radians(origin.lon)
    east = -sin(lam) * dx + cos(lam) * dy
    north = -sin(phi) * cos(lam) * dx - sin(phi) * sin(lam) * dy + cos(phi) * dz
    up = cos(phi) * cos(lam) * dx + cos(phi) * sin(lam) * dy + sin(phi) * dz
    return east, north, up


def geodetic_of(enu: Xyz, origin: Geodetic) -> Geodetic:
    """Return where `enu`, as of `enu_of`, is."""
    east, north, up = enu
    phi, lam = radians(origin.lat), radians(origin.lon)
    x0, y0, z0 = _ecef(origin)
    x = x0 - sin(lam) * east - sin(phi) * cos(lam) * north + cos(phi) * cos(lam) * up
    y = y0 + cos(lam) * east - sin(phi) * sin(lam) * north + cos(phi) * sin(lam) * up
    z = z0 + cos(phi) * north + sin(phi) * up
    across = hypot(x, y)
    lat = atan2(z, across * (1 - _E2))
    for _ in range(_ROUNDS):
        normal = _A / sqrt(1 - _E2 * sin(lat) ** 2)
        lat = atan2(z + _E2 * normal * sin(lat), across)
    normal = _A / sqrt(1 - _E2 * sin(lat) ** 2)
    return Geodetic(degrees(lat), degrees(atan2(y, x)), across / cos(lat) - normal)


def _ecef(place: Geodetic) -> Xyz:
    phi, lam = radians(place.lat), radians(place.lon)
    normal = _A / sqrt(1 - _E2 * sin(phi) ** 2)
    across = (normal + place.alt) * cos(phi)
    return across * cos(lam), across * sin(lam), (normal * (1 - _E2) + place.alt) * sin(phi)
