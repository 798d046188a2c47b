"""Frames of autopilots: ENU and NED are exchanged; places on the earth agree with the exact ellipsoid."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.vehicles.frames import FAR_M, LATITUDE_MAX, GpsPlace, enu_from_gps, enu_of, gps_of, ned_of
from tests.support import wgs84
from tests.support.cases import looped

NEAR_M = 1_000.0
ORIGINS = st.builds(
    GpsPlace,
    st.floats(-LATITUDE_MAX, LATITUDE_MAX),
    st.floats(-180, 180),
    st.floats(-100, 4_000, allow_subnormal=False),
)


def within(limit_m: float) -> st.SearchStrategy[tuple[float, float, float]]:
    side = st.floats(-limit_m, limit_m, allow_subnormal=False)
    return st.tuples(side, side, st.floats(-50, 200, allow_subnormal=False))


@looped(
    ("enu", "ned"),
    [((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0)), ((0, 0, 1), (0, 0, -1)), ((3, -4, 2.5), (-4, 3, -2.5))],
)
def test_east_north_up_is_north_east_down(enu: tuple[float, float, float], ned: tuple[float, float, float]) -> None:
    assert ned_of(enu) == ned
    assert enu_of(ned) == enu


@given(ORIGINS, within(FAR_M))
def test_a_place_on_the_earth_comes_back(origin: GpsPlace, place: tuple[float, float, float]) -> None:
    assert enu_from_gps(gps_of(place, origin), origin) == pytest.approx(place, abs=1e-3)


@pytest.mark.parametrize(("limit_m", "error_m"), [(NEAR_M, 1e-3), (FAR_M, 0.2)])
def test_the_formula_is_as_near_to_the_ellipsoid_as_it_says(limit_m: float, error_m: float) -> None:
    worst = 0.0
    for latitude in (-LATITUDE_MAX, -47.4, 0.0, 12.0, 60.0, LATITUDE_MAX):
        for longitude in (-180.0, 0.0, 8.5, 179.999):
            for turn in range(16):
                angle = turn * math.tau / 16
                place = (limit_m * math.cos(angle), limit_m * math.sin(angle), 0.0)
                found = gps_of(place, GpsPlace(latitude, longitude, 0.0))
                exact = wgs84.enu_of(
                    wgs84.Geodetic(found.latitude, found.longitude, found.altitude_m),
                    wgs84.Geodetic(latitude, longitude, 0.0),
                )
                worst = max(worst, math.dist(exact[:2], place[:2]))
                assert exact[2] == pytest.approx(-(limit_m**2) / (2 * 6_371_000), rel=0.02)
    assert worst < error_m


def test_across_the_date_line() -> None:
    east, north, up = enu_from_gps(GpsPlace(0.0, -179.9999, 3.0), GpsPlace(0.0, 179.9999, 1.0))
    assert (east, north, up) == pytest.approx((22.26, 0.0, 2.0), abs=0.01)
    assert gps_of((22.26, 0.0, 2.0), GpsPlace(0.0, 179.9999, 1.0)).longitude == pytest.approx(-179.9999, abs=1e-6)
