"""Messages between robochoc and the guard process: JSON, one message per line."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import msgspec

from robochoc.flight.layout import Point
from robochoc.vehicles.fleet import AtEnd, Fleet


class FlightPhase(StrEnum):
    """The phase of a vehicle's flight."""

    CONNECTING = "connecting"
    READY = "ready"
    CLIMBING = "climbing"
    FLYING = "flying"
    ARRIVED = "arrived"
    LANDING = "landing"
    LANDED = "landed"
    OUT = "out"
    """Out of order, for the reason in `why`. The vehicle is landed if possible."""


class VehicleTarget(msgspec.Struct, frozen=True):
    """The target of a vehicle in the team's frame, where it `lands` or stays in the air."""

    at: Point
    lands: bool = False


class GuardSetup(msgspec.Struct, frozen=True, tag=True):
    """To the guard, as the first message: the fleet."""

    fleet: Fleet


class Permit(msgspec.Struct, frozen=True, tag=True):
    """To the guard: vehicles may be armed. No vehicle is commanded before this message."""


class Fly(msgspec.Struct, frozen=True, tag=True):
    """To the guard: fly to these places. Orders are numbered; a later order replaces an earlier one."""

    order: int
    targets: Mapping[str, VehicleTarget]


class End(msgspec.Struct, frozen=True, tag=True):
    """To the guard: end all flights. With `waits`, the guard continues until landing vehicles are on the ground."""

    how: AtEnd
    waits: bool


class Recover(msgspec.Struct, frozen=True, tag=True):
    """To the guard: end the flights of vehicles left armed by a lost guard."""

    how: AtEnd


class VehicleState(msgspec.Struct, frozen=True, tag=True):
    """From the guard: the state of a vehicle, several times a second."""

    vehicle: str
    phase: FlightPhase
    order: int = 0
    """The number of the newest order accepted by the vehicle."""
    place: Point | None = None
    """The place in the team's frame; None: not reported yet."""
    battery: float | None = None
    """The charge of the battery; 1 is full. None: not measured."""
    healthy: bool = False
    """True if the autopilot would allow arming."""
    in_air: bool = False
    commanded: bool = False
    """True if the vehicle was ever commanded."""
    why: str = ""
    waits_for: str = ""
    """The name of another vehicle that has to move out of the way first."""


class GuardEnded(msgspec.Struct, frozen=True, tag=True):
    """From the guard, as the last message: all flights have ended."""


class NoRoutes(msgspec.Struct, frozen=True, tag=True):
    """From the guard: an order is not flown, since no routes keep the vehicles apart."""

    why: str


class GuardFailed(msgspec.Struct, frozen=True, tag=True):
    """From the guard: the guard has failed."""

    why: str


ToGuard = GuardSetup | Permit | Fly | End | Recover
FromGuard = VehicleState | NoRoutes | GuardEnded | GuardFailed
LINE_MAX = 4096
"""The maximum length of a line from the guard: a pipe accepts lines up to this length atomically (PIPE_BUF)."""


def line_of(message: ToGuard | FromGuard) -> bytes:
    """Return a message as a line."""
    return msgspec.json.encode(message) + b"\n"
