"""Ways and traffic without autopilots: points that fly to their set points, late, at random speeds, and are blown."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from random import Random

import numpy as np
import pytest

from robochoc.flight.layout import Point
from robochoc.maps.routes.distances import line_distances
from robochoc.vehicles.fleet import Fence, Fleet, VehicleLink
from robochoc.vehicles.messages import VehicleTarget
from robochoc.vehicles.route_planner import RouteError, RoutePlanner, spacing
from robochoc.vehicles.steps import length_along, on_line
from robochoc.vehicles.traffic import STILL_S, Traffic
from tests.support.cases import looped

TICK_S = 0.1
LOW_M = 0.05
TICKS_MAX = 6_000
DISTANCE_M, NEAR_M, TAKEOFF_M = 1.0, 0.2, 1.5
LEAST_M = DISTANCE_M - 2 * NEAR_M - 1e-6
SPEEDS_MS = 0.2, 4.0


@dataclass
class Flyer:
    """A vehicle that moves straight to its set point."""

    at: Point
    does: str = "stand"
    bound: Point | None = None
    speed: float = 2.0
    stalled: int = 0
    blown: int = 0
    gust: tuple[float, float] = (0.0, 0.0)


@dataclass
class Sky:
    """Vehicles, their traffic, and the smallest distance that two of them have had."""

    count: int
    chance: Random
    downwash: float = 1.0
    stalls: bool = False
    gust_m: float = 0.0
    nearest_m: float = math.inf
    now_s: float = 0.0
    flyers: dict[str, Flyer] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [f"v{number}" for number in range(self.count)]
        self.fleet = Fleet(
            {name: VehicleLink("udpin://0.0.0.0:1") for name in names},
            Fence((-6, -6, 0), (16, 16, 60)),
            near_m=NEAR_M,
            distance_m=DISTANCE_M,
            takeoff_m=TAKEOFF_M,
            downwash=self.downwash,
        )
        self.traffic = Traffic(self.fleet, lambda: self.now_s)
        self.flyers = {name: Flyer(at) for name, at in zip(names, self.places(0, 0), strict=True)}
        self.tell()

    def places(self, low: float, high: float) -> list[Point]:
        """Random places that keep the distance."""
        found: list[Point] = []
        while len(found) < self.count:
            place = (self.chance.uniform(0, 8), self.chance.uniform(0, 8), self.chance.uniform(low, high))
            if spacing([*found, place], self.downwash) >= DISTANCE_M:
                found.append(place)
        return found

    def fly(self) -> None:
        self.traffic.fly({name: VehicleTarget(at) for name, at in zip(self.flyers, self.places(1, 6), strict=True)})

    def tell(self) -> None:
        for name, one in self.flyers.items():
            self.traffic.update_place(name, one.at, in_air=one.at[2] > LOW_M and one.does != "lie")

    def tick(self) -> None:
        """Let a moment pass: vehicles tell where they are, take up what they may do, and move."""
        self.now_s += TICK_S
        self.tell()
        for name, one in self.chance.sample([*self.flyers.items()], self.count):
            if self.chance.random() < 0.7 and one.does not in {"land", "lie"}:
                self.take_up(name, one)
        for name, one in self.flyers.items():
            if one.does not in {"stand", "lie"}:
                self.move(one)
            if one.does == "land" and one.at[2] <= LOW_M:
                one.does = "lie"
                self.traffic.landed(name)
        self.nearest_m = min(self.nearest_m, spacing([one.at for one in self.flyers.values()], self.downwash))

    def take_up(self, name: str, one: Flyer) -> None:
        may = self.traffic.clearance(name)
        if one.does == "stand" and may.climbs:
            one.does, one.bound = "climb", (*one.at[:2], one.at[2] + TAKEOFF_M)
            self.traffic.climbing(name)
        elif one.does == "climb" and one.at[2] >= 0.9 * TAKEOFF_M:
            one.does = "fly"
            self.traffic.climbed(name)
        elif one.does in {"climb", "fly"} and may.lands:
            one.does, one.bound = "land", (*one.at[:2], 0.0)
            self.traffic.landing(name)
        elif one.does == "fly":
            one.bound = may.to or one.bound

    def move(self, one: Flyer) -> None:
        if self.stalls:
            one.stalled -= 1
            if one.stalled < 0 and self.chance.random() < 0.01:
                one.stalled = self.chance.randint(5, 100)
            if self.chance.random() < 0.02:
                one.speed = self.chance.uniform(*SPEEDS_MS)
        if one.bound and one.stalled <= 0:
            left, step = math.dist(one.at, one.bound), one.speed * TICK_S
            one.at = one.bound if left <= step else on_line(one.at, one.bound, step)
        if self.gust_m and one.does == "fly":
            one.blown -= 1
            if one.blown < -30 and self.chance.random() < 0.02:
                angle = self.chance.uniform(0, 2 * math.pi)
                one.blown = 5
                one.gust = self.gust_m / 5 * math.cos(angle), self.gust_m / 5 * math.sin(angle)
            if one.blown > 0:
                one.at = one.at[0] + one.gust[0], one.at[1] + one.gust[1], one.at[2]

    def until_there(self) -> None:
        """Go on until all are where they were sent."""
        self.until("fly", lambda: all(self.traffic.clearance(name).rests for name in self.flyers))

    def until_down(self) -> None:
        self.until("lie", lambda: True)

    def until(self, does: str, also: Callable[[], bool]) -> None:
        for _ in range(TICKS_MAX):
            self.tick()
            if all(one.does == does for one in self.flyers.values()) and also():
                return
        raise AssertionError(self.flyers)


def whole_flight(seed: int, count: int, *, orders: int = 2, settings: Mapping[str, float] | None = None) -> Sky:
    """A flight of several orders, the last of which comes on the way, and the landing of all."""
    chance = Random(seed)
    sky = Sky(count, chance, **(settings or {}))  # type: ignore[arg-type]
    sky.fly()
    for _ in range(orders):
        sky.until_there()
        sky.fly()
    for _ in range(chance.randint(5, 80)):
        sky.tick()
    sky.fly()
    sky.until_there()
    sky.traffic.bring_down()
    sky.until_down()
    return sky


@pytest.mark.parametrize("seed", range(2))
def test_vehicles_at_one_speed_keep_their_distance(seed: int) -> None:
    assert whole_flight(seed, 3, orders=1).nearest_m >= LEAST_M


@pytest.mark.slow
@pytest.mark.parametrize("settings", [{}, {"stalls": 1}, {"stalls": 1, "downwash": 2.0}], ids=str)
def test_vehicles_that_stall_at_random_keep_their_distance(settings: dict[str, float]) -> None:
    for seed in range(15):
        sky = whole_flight(seed, 2 + seed % 6, settings=settings)
        assert sky.nearest_m >= LEAST_M, (seed, sky.nearest_m)


@pytest.mark.slow
def test_vehicles_that_are_blown_keep_their_distance_but_for_how_far() -> None:
    for seed in range(15):
        sky = whole_flight(100 + seed, 2 + seed % 6, settings={"stalls": 1, "gust_m": NEAR_M})
        assert sky.nearest_m >= DISTANCE_M - 4 * NEAR_M, (seed, sky.nearest_m)


def hovering(*places: Point) -> Sky:
    """Vehicles that hover at places."""
    sky = Sky(len(places), Random(1))
    for name, (one, at) in zip(sky.flyers, zip(sky.flyers.values(), places, strict=True), strict=True):
        one.at = (*at[:2], 0.0)
        sky.traffic.update_place(name, one.at, in_air=False)
    sky.traffic.fly({name: VehicleTarget(at) for name, at in zip(sky.flyers, places, strict=True)})
    sky.until_there()
    return sky


def test_one_that_is_blown_stops_who_would_fly_into_it() -> None:
    sky = hovering((0, 0, 2), (6, 3, 2))
    blown = sky.flyers["v1"]
    sky.traffic.fly({"v0": VehicleTarget((6, 0, 2))})
    blown.at, blown.stalled = (3.0, 0.2, 2.0), 10_000
    for _ in range(int(STILL_S / TICK_S)):
        sky.tick()
    assert sky.traffic.clearance("v0").waits_for == "v1"
    assert sky.flyers["v0"].at[0] < 3 - (DISTANCE_M - 2 * NEAR_M)
    blown.stalled = 0
    sky.until_there()
    assert sky.flyers["v0"].at == (6, 0, 2)


def test_who_is_above_makes_room_for_one_that_rises() -> None:
    sky = hovering((0, 0, 2), (4, 0, 2))
    sky.traffic.fly({"v1": VehicleTarget((4, 0, 0), lands=True)})
    for _ in range(100):
        sky.tick()
    assert sky.flyers["v1"].at[2] <= LOW_M
    sky.traffic.fly({"v0": VehicleTarget((4, 0, 1.4))})
    for _ in range(100):
        sky.tick()
    assert sky.flyers["v0"].at == pytest.approx((4, 0, 1.4))
    sky.flyers["v1"].does = "stand"
    sky.traffic.fly({"v0": VehicleTarget((0, 0, 2)), "v1": VehicleTarget((4, 0, 2))})
    sky.until_there()
    assert sky.nearest_m >= LEAST_M


@looped("above_m", [-0.1, 0.0, 0.1])
def test_one_that_rises_past_its_place_goes_back_to_it(above_m: float) -> None:
    sky = hovering((0, 0, TAKEOFF_M + above_m))
    for _ in range(20):
        sky.tick()
    assert sky.flyers["v0"].at == pytest.approx((0, 0, TAKEOFF_M + above_m))


# What is refused


def ways(fence_m: float = 9.0, **standing: Point) -> RoutePlanner:
    fleet = Fleet({"a": VehicleLink("udpin://0.0.0.0:1")}, Fence((-1, -1, 0), (fence_m, fence_m, fence_m)))
    return RoutePlanner(fleet, standing, DISTANCE_M)


def test_who_cannot_rise_is_told() -> None:
    with pytest.raises(RouteError, match=r"a cannot rise to 2\.5 m: b is too near"):
        ways(b=(0.5, 0, 2)).legs({"a": (0, 0, 0)}, {"a": (4, 4, 2)}, {"a": 2.5})


def test_who_is_above_goes_away_before_another_one_rises() -> None:
    starts = {"a": (0.0, 0.0, 0.0), "b": (0.0, 0.0, 2.0)}
    legs = ways().legs(starts, {"a": (0, 0, 2), "b": (4, 0, 2)}, {"a": 2.5})
    assert [leg.name for leg in legs][:2] == ["b", "a"]


def test_places_that_are_too_near_are_told() -> None:
    with pytest.raises(RouteError, match=r"a and b would be 0\.50 m apart: less than 'distance', 1 m"):
        ways(b=(4, 4, 2)).check({"a": (4, 4, 2.5)})


def test_ways_stay_within_the_fence() -> None:
    legs = ways().legs({"a": (0, 0, 2), "b": (2, 0, 2)}, {"a": (2, 0, 2), "b": (0, 0, 2)}, {})
    assert all(-1 <= at <= 9 for leg in legs for at in leg.path.ravel())
    fleet = Fleet({"a": VehicleLink("udpin://0.0.0.0:1")}, Fence((0, 0, 0), (2, 0, 2)))
    with pytest.raises(RouteError, match=r"the only route found passes .*, outside the fence \(0, 0, 0 to 2, 0, 2\)"):
        RoutePlanner(fleet, {}, DISTANCE_M).legs({"a": (0, 0, 2), "b": (2, 0, 2)}, {"a": (2, 0, 2), "b": (0, 0, 2)}, {})


def test_lengths_along_lines() -> None:
    assert length_along((0, 0, 0), (0, 0, 4), (5, 0, 3)) == 3
    assert on_line((0, 0, 0), (0, 0, 4), 3) == (0, 0, 3)
    assert length_along((1, 1, 1), (1, 1, 1), (5, 0, 3)) == 0


def test_distances_of_lines_are_those_of_their_nearest_points() -> None:
    chance = np.random.default_rng(1)
    points = chance.normal(size=(100, 4, 3))
    points[::7, 1] = points[::7, 0]
    points[::5, 3] = points[::5, 2]
    points[::11, 3] = points[::11, 2] + points[::11, 1] - points[::11, 0]
    share = np.linspace(0, 1, 101)[:, None]
    first = points[:, 0, None] + share * (points[:, 1] - points[:, 0])[:, None]
    second = points[:, 2, None] + share * (points[:, 3] - points[:, 2])[:, None]
    sampled = np.sqrt(((first[:, :, None] - second[:, None]) ** 2).sum(-1)).min((1, 2))
    found = line_distances((points[:, 0], points[:, 1]), (points[:, 2], points[:, 3]))
    assert (found <= sampled + 1e-12).all()
    assert (found >= sampled - 0.01).all()
