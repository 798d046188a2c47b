"""Plays the vehicles of a fleet file, for the guide on autopilots: `python -m tests.support.fleet_players FILE`.

They stand on the ground in rows, within the fence and farther apart than the fleet's distance. What becomes of each is
said on standard output, until Ctrl-C.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from robochoc.flight.layout import Point
from robochoc.vehicles.fleet import Fleet, read_fleet
from tests.support.mavlink_vehicles import Vehicle, Vehicles
from tests.support.wgs84 import Geodetic, geodetic_of

_LINK = re.compile(r"udpin://.+:(\d+)", re.ASCII)
_SPEED_MS = 3.0
_LOOK_S = 0.1
_ROOM = 1.5
"""They stand so many distances apart."""


def places(fleet: Fleet) -> Iterator[Point]:
    """Yield places on the ground, in rows within the fence."""
    (x_low, y_low, z_low), (x_high, y_high, _) = fleet.fence.low, fleet.fence.high
    step = _ROOM * fleet.distance_m
    for row in range(int((y_high - y_low) / step)):
        for column in range(int((x_high - x_low) / step)):
            yield x_low + (column + 0.5) * step, y_low + (row + 0.5) * step, max(z_low, 0.0)


def players(fleet: Fleet) -> dict[str, Vehicle]:
    """Return who plays each vehicle, by the drones' names.

    Raises:
        ValueError: A link is not one that can be played, or the fence has no room for all.
    """
    found: dict[str, Vehicle] = {}
    room = places(fleet)
    for name, link in fleet.vehicles.items():
        port, place = _LINK.fullmatch(link.url), next(room, None)
        if port is None:
            raise ValueError(f"{name}: {link.url} cannot be played, only udpin://HOST:PORT")
        if place is None:
            raise ValueError(f"{name} has no room to stand in the fence; make it larger, or 'distance' smaller")
        if fleet.origin:
            home = geodetic_of(place, Geodetic(fleet.origin.latitude, fleet.origin.longitude, fleet.origin.altitude_m))
            found[name] = Vehicle(int(port[1]), home=home, speed=_SPEED_MS)
        else:
            x, y, z = (at - own for at, own in zip(place, link.at, strict=True))
            found[name] = Vehicle(int(port[1]), at=(x, y, z), speed=_SPEED_MS)
    return found


def main(path: Path) -> None:
    """Play the fleet in the file at `path` until Ctrl-C."""
    played = players(read_fleet(path))
    told = dict.fromkeys(played, 0)
    with Vehicles([*played.values()]), suppress(KeyboardInterrupt):
        sys.stdout.write(f"{len(played)} vehicles are played until Ctrl-C\n")
        while True:
            for name, one in played.items():
                for entry in one.log[told[name] :]:
                    told[name] += 1
                    sys.stdout.write(f"{name}: {entry}\n")
            sys.stdout.flush()
            time.sleep(_LOOK_S)


if __name__ == "__main__":
    words = argparse.ArgumentParser(prog="python -m tests.support.fleet_players", description=__doc__)
    words.add_argument("file", type=Path, metavar="FILE", help="a fleet file of vehicles that speak MAVLink")
    main(words.parse_args().file)
