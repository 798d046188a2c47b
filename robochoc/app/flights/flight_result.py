"""How a flight went, as `robochoc fly --json` tells it; or why it could not be flown."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from robochoc.app.runs.run import Run
from robochoc.app.sketch.words import listed
from robochoc.app.texts import say

FLOWN = "flight.json"
_ARRIVED_M = 0.1
"""As `robochoc fly` has it: who is further away has not arrived."""
_MOST_TOLD = 6
_MAX_BYTES = 64 << 20


class _Happening(msgspec.Struct, frozen=True):
    at_s: float
    drone: str
    what: str


class _Drone(msgspec.Struct, frozen=True):
    name: str
    error_m: float | None = None


class FlightResult(msgspec.Struct, frozen=True):
    """How a flight went.

    Attributes:
        as_planned: Whether all have arrived, and kept their distance.
        refused: Why it was not flown. Empty: it was.
        drones: Where they are in the end.
        happenings: What happened on the way.
    """

    as_planned: bool = True
    refused: str = ""
    drones: tuple[_Drone, ...] = ()
    happenings: tuple[_Happening, ...] = ()


def refused(why: str) -> bytes:
    """Return the content of a file that says why nothing was flown."""
    return msgspec.json.encode({"as_planned": False, "refused": why})


def flight_result_of(run: Run) -> FlightResult | None:
    """Return how the flight of a run went; None: that is not known."""
    file = run.artefact(FLOWN)
    try:
        if file is None or file.stat().st_size > _MAX_BYTES:
            return None
        return msgspec.json.decode(file.read_bytes(), type=FlightResult)
    except (OSError, msgspec.DecodeError, RecursionError):
        return None


def flight_words(flown: FlightResult) -> list[str]:
    """Return what is to be told of a flight, in sentences: nothing of one in which all went well."""
    return [*_words(flown)]


def _words(flown: FlightResult) -> Iterator[str]:
    if flown.refused:
        yield say("fly.refused", why=flown.refused.rstrip("."))
        return
    late = [drone.name for drone in flown.drones if drone.error_m is not None and drone.error_m > _ARRIVED_M]
    fallen = [drone.name for drone in flown.drones if drone.error_m is None]
    if fallen:
        yield say("fly.fallen", names=listed(fallen))
    if late:
        yield say("fly.late", names=listed(late))
    if not (flown.as_planned or late or fallen):
        yield say("fly.near")
    for one in flown.happenings[:_MOST_TOLD]:
        yield say("fly.happened", seconds=f"{one.at_s:.1f}", robot=one.drone, what=one.what)
