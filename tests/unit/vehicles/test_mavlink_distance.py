"""Vehicles keep their distance, however fast or slow each is: measured where they are played, not by robochoc."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import Random

import pytest

pytest.importorskip("mavsdk")

from robochoc.flight.layout import Point
from robochoc.vehicles.fleet import read_fleet
from robochoc.vehicles.guard_client import GuardClient, GuardError
from robochoc.vehicles.messages import FlightPhase, VehicleTarget
from tests.support.limits import HANG_S, wait_until
from tests.support.mavlink_teams import NAMES, fleet_file, udp_ports
from tests.support.mavlink_vehicles import GUST_S, Vehicle, Vehicles

DISTANCE_M, NEAR_M = 1.0, 0.2
LEAST_M = DISTANCE_M - 2 * NEAR_M
"""What docs/guides/autopilots.md promises: two vehicles may each be `near` beside their ways."""
STANDS = ((0.0, 0.0), (2.0, 0.0), (0.0, 2.0), (2.0, 2.0))
PLACES: Sequence[Point] = tuple((x, y, 2.0) for x, y in STANDS)


@contextmanager
def field(folder: Path, count: int = 4, **settings: object) -> Iterator[tuple[Vehicles, GuardClient]]:
    """Vehicles that stand in a square, and a guard that has heard them and may arm them."""
    ports, names = udp_ports(count), NAMES[:count]
    vehicles = [Vehicle(port, at=(*at, 0.0), speed=6.0) for port, at in zip(ports, STANDS, strict=False)]
    settings = {"near": NEAR_M, "distance": DISTANCE_M, **settings}
    fleet = read_fleet(fleet_file(folder, dict(zip(names, ports, strict=True)), **settings))
    with Vehicles(vehicles) as played:
        guard = GuardClient(fleet)
        try:
            assert guard.wait_for(lambda: is_all(guard, names, FlightPhase.READY), HANG_S), played.state()
            guard.permit()
            yield played, guard
        finally:
            guard.close()
        played.wait_until_landed()


def is_all(guard: GuardClient, names: Sequence[str], phase: FlightPhase) -> bool:
    return [guard.states[name].phase for name in names if name in guard.states] == [phase] * len(names)


def fly(guard: GuardClient, places: Sequence[Point]) -> None:
    """Send vehicles to places, and wait until they are there."""
    targets = targets_of(places)
    guard.fly(targets)
    assert guard.wait_for(lambda: all(map(guard.is_done, targets)), HANG_S), guard.states


def targets_of(places: Sequence[Point]) -> Mapping[str, VehicleTarget]:
    return {name: VehicleTarget(at) for name, at in zip(NAMES, places, strict=False)}


@pytest.mark.more
def test_vehicles_that_change_places_keep_their_distance(tmp_path: Path) -> None:
    with field(tmp_path, 2) as (vehicles, guard):
        fly(guard, PLACES[:2])
        fly(guard, PLACES[1::-1])
        assert vehicles[0].is_near(PLACES[1])
        assert vehicles[1].is_near(PLACES[0])
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.slow
@pytest.mark.parametrize("blown_ms", [0.0, 2 * NEAR_M / GUST_S])
@pytest.mark.parametrize("seed", range(3))
def test_vehicles_at_random_speeds_that_stall_and_are_blown_keep_their_distance(
    tmp_path: Path, seed: int, blown_ms: float
) -> None:
    chance = Random(seed)
    with field(tmp_path) as (vehicles, guard):
        for number, vehicle in enumerate(vehicles):
            vehicle.chance, vehicle.blown_ms = Random(10 * seed + number), blown_ms / 2
        for _ in range(3):
            fly(guard, chance.sample(PLACES, len(PLACES)))
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.slow
def test_places_that_change_on_the_way_are_flown_to_from_there(tmp_path: Path) -> None:
    with field(tmp_path) as (vehicles, guard):
        fly(guard, PLACES)
        for vehicle in vehicles:
            vehicle.speed = 2.0
        guard.fly(targets_of([*reversed(PLACES)]))
        wait_until(lambda: not vehicles[0].is_near(PLACES[0], 0.5), vehicles.state)
        fly(guard, [*PLACES[2:], *PLACES[:2]])
        assert vehicles[0].is_near(PLACES[2])
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.slow
def test_where_one_stands_still_the_others_wait(tmp_path: Path) -> None:
    with field(tmp_path, 2) as (vehicles, guard):
        fly(guard, PLACES[:2])
        vehicles[0].stalls = True
        guard.fly(targets_of(PLACES[1::-1]))
        assert guard.wait_for(lambda: guard.states["RB"].waits_for == "RA", HANG_S), vehicles.state()
        assert not guard.wait_for(lambda: guard.is_done("RB"), 1)
        vehicles[0].stalls = False
        assert guard.wait_for(lambda: guard.is_done("RA") and guard.is_done("RB"), HANG_S), vehicles.state()
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.slow
def test_at_the_end_who_is_above_another_lands_beside_it(tmp_path: Path) -> None:
    with field(tmp_path, 2) as (vehicles, guard):
        fly(guard, [(0, 0, 1.5), (0, 0, 3.5)])
        assert vehicles[1].is_near((0, 0, 3.5))
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.slow
def test_who_is_lost_above_another_comes_down_when_that_one_has_made_room(tmp_path: Path) -> None:
    with field(tmp_path, 2) as (vehicles, guard):
        fly(guard, [(0, 0, 1.5), (0, 0, 3.5)])
        vehicles[1].armed = True
        vehicles[1].refuses = {"land"}
        guard.fly({NAMES[1]: VehicleTarget((0, 0, 0), lands=True)})
        assert guard.wait_for(lambda: guard.states[NAMES[1]].phase is FlightPhase.OUT, HANG_S)
        vehicles[1].refuses = set()
        wait_until(lambda: not vehicles[1].flies, vehicles.state)
        assert vehicles[0].flies
    assert vehicles.nearest_m >= LEAST_M


@pytest.mark.more
def test_places_that_are_too_near_are_not_flown_to(tmp_path: Path) -> None:
    with field(tmp_path, 2) as (vehicles, guard):
        guard.fly(targets_of([(0, 0, 2), (0.5, 0, 2)]))
        told = "the decision is not flown: RA and RB would be 0.50 m apart: less than 'distance', 1 m"
        with pytest.raises(GuardError, match=told):
            guard.wait_for(lambda: False, HANG_S)
        assert [vehicle.log for vehicle in vehicles] == [[], []]


@pytest.mark.slow
def test_when_no_ways_are_found_in_the_air_all_land(tmp_path: Path) -> None:
    with field(tmp_path, 2, fence="[[-0.1, -0.1, 0], [2.1, 0.1, 2.1]]") as (vehicles, guard):
        fly(guard, PLACES[:2])
        guard.fly(targets_of(PLACES[1::-1]))
        with pytest.raises(GuardError, match="the decision is not flown: the only route found passes"):
            guard.wait_for(lambda: False, HANG_S)
    assert vehicles.nearest_m >= LEAST_M
