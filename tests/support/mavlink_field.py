"""A field of four played vehicles that speak MAVLink, for the team of `mavlink_teams`, and their fleet file."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.support.mavlink_teams import NAMES, fleet_file, team_folder, udp_ports
from tests.support.mavlink_vehicles import HOME, Vehicle, Vehicles
from tests.support.program import robochoc_within
from tests.support.wgs84 import geodetic_of

STANDS = tuple((2.0 * n, 0.0, 0.0) for n in range(len(NAMES)))
ON_EARTH = f"[{HOME.lat}, {HOME.lon}, {HOME.alt}]"
"""The setting `origin` of a team on the earth."""


@contextmanager
def mavlink_field(
    folder: Path, speed: float = 20.0, *, is_ardupilot: bool = False, **settings: object
) -> Iterator[tuple[Vehicles, Path]]:
    """Four vehicles below their places. They share one frame, or have places on the earth if `origin` is set."""
    ports = udp_ports(len(NAMES))
    vehicles = [Vehicle(port, at=at, speed=speed) for port, at in zip(ports, STANDS, strict=True)]
    for vehicle, at in zip(vehicles, STANDS, strict=True):
        if is_ardupilot:
            vehicle.is_ardupilot, vehicle.mode = True, "stabilize"
        if "origin" in settings:
            vehicle.home, vehicle.at = geodetic_of(at, HOME), (0.0, 0.0, 0.0)
    with Vehicles(vehicles) as played:
        yield played, fleet_file(folder, dict(zip(NAMES, ports, strict=True)), **settings)


def solve(folder: Path, fleet: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Let the vehicles of `fleet` fly the decision of the four drones."""
    return robochoc_within("solve", team_folder(folder), "--runtime", "simulator", "--ros", f"mavlink:{fleet}", *words)
