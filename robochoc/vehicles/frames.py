"""Converts frames: ours is east, north, up (ENU), autopilots use north, east, down (NED) or latitude and longitude.

A place on the earth is expanded around the origin to the second order, on the WGS 84 ellipsoid. M and N are the
ellipsoid's radii of curvature along the meridian and across it:

    north = (M + h) dlat + east^2 tan(lat0) / (2 (N + h))
    east = (N + h) cos(lat) dlon

The error is less than 1 mm within 1 km of the origin, and less than 0.2 m within 5 km, for latitudes up to 75
degrees. Up is the difference of the heights above sea level: it follows the curvature of the earth, as barometers do,
and not the tangent plane (8 cm lower at 1 km).

Source: the radii, J. P. Snyder, "Map Projections: A Working Manual", USGS Professional Paper 1395, 1987, equations
4-18 to 4-20.
"""

from __future__ import annotations

from math import cos, degrees, radians, sin, sqrt, tan

import msgspec

from robochoc.flight.layout import Point

LATITUDE_MAX = 75.0
"""The largest latitude of an origin, in degrees, since the error is larger nearer to the poles."""
FAR_M = 5_000.0
"""The largest distance of a place from the origin along an axis, in metres."""
_SEMI_MAJOR_M = 6_378_137.0
_FLATTENING = 1 / 298.257223563
_ECCENTRICITY_2 = _FLATTENING * (2 - _FLATTENING)


class GpsPlace(msgspec.Struct, frozen=True):
    """A place on the earth, in degrees and in metres above mean sea level."""

    latitude: float
    longitude: float
    altitude_m: float


def ned_of(enu: Point) -> Point:
    """Convert east, north, up to north, east, down.

    >>> ned_of((1.0, 2.0, 3.0))
    (2.0, 1.0, -3.0)
    """
    east, north, up = enu
    return north, east, -up


def enu_of(ned: Point) -> Point:
    """Convert north, east, down to east, north, up."""
    return ned_of(ned)


def gps_of(enu: Point, origin: GpsPlace) -> GpsPlace:
    """Convert east, north, up, relative to `origin`, to a place on the earth."""
    east, north, up = enu
    latitude = radians(origin.latitude)
    meridian_m, normal_m = _radii(origin)
    north -= east**2 * tan(latitude) / (2 * normal_m)
    there = latitude + north / meridian_m
    longitude = origin.longitude + degrees(east / (normal_m * cos(there)))
    return GpsPlace(degrees(there), _in_turn(longitude), origin.altitude_m + up)


def enu_from_gps(place: GpsPlace, origin: GpsPlace) -> Point:
    """Convert a place on the earth to east, north, up, relative to `origin`."""
    latitude = radians(origin.latitude)
    meridian_m, normal_m = _radii(origin)
    east = normal_m * cos(radians(place.latitude)) * radians(_in_turn(place.longitude - origin.longitude))
    north = meridian_m * radians(place.latitude - origin.latitude) + east**2 * tan(latitude) / (2 * normal_m)
    return east, north, place.altitude_m - origin.altitude_m


def _radii(origin: GpsPlace) -> tuple[float, float]:
    """Return the radii of curvature along the meridian and across it, at the height of `origin`, in metres."""
    part = 1 - _ECCENTRICITY_2 * sin(radians(origin.latitude)) ** 2
    meridian_m = _SEMI_MAJOR_M * (1 - _ECCENTRICITY_2) / (part * sqrt(part))
    normal_m = _SEMI_MAJOR_M / sqrt(part)
    return meridian_m + origin.altitude_m, normal_m + origin.altitude_m


def _in_turn(degrees_east: float) -> float:
    """Return an equal angle between -180 and 180 degrees."""
    return (degrees_east + 180) % 360 - 180
