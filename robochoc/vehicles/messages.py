"""Messages between robochoc and the guard process: one a line, in JSON."""

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
    """Out of order, for the reason in `why`. The vehicle is brought to the ground if that is possible."""


class VehicleTarget(msgspec.Struct, frozen=True):
    """The target of a vehicle, in the team's frame; it `lands` there, or stays in the air."""

    at: Point
    lands: bool = False


class GuardSetup(msgspec.Struct, frozen=True, tag=True):
    """To the guard, as the first message."""

    fleet: Fleet


class Permit(msgspec.Struct, frozen=True, tag=True):
    """To the guard: vehicles may be armed. Before this message no vehicle is commanded."""


class Fly(msgspec.Struct, frozen=True, tag=True):
    """To the guard: fly to these places. Orders are numbered; a later order replaces an earlier one."""

    order: int
    targets: Mapping[str, VehicleTarget]


class End(msgspec.Struct, frozen=True, tag=True):
    """To the guard: end all flights. With `waits` it continues until landing vehicles are on the ground."""

    how: AtEnd
    waits: bool


class Recover(msgspec.Struct, frozen=True, tag=True):
    """To the guard: end the flights of vehicles that a lost guard has left armed."""

    how: AtEnd


class VehicleState(msgspec.Struct, frozen=True, tag=True):
    """From the guard: the state of a vehicle, several times a second."""

    vehicle: str
    phase: FlightPhase
    order: int = 0
    """The newest order that it has accepted."""
    place: Point | None = None
    """In the team's frame; None: not reported yet."""
    battery: float | None = None
    """1 is full; None: not measured."""
    healthy: bool = False
    """Whether the autopilot would allow arming."""
    in_air: bool = False
    commanded: bool = False
    """Whether it was ever commanded."""
    why: str = ""
    waits_for: str = ""
    """Another vehicle, which has to move out of the way first."""


class GuardEnded(msgspec.Struct, frozen=True, tag=True):
    """From the guard, as the last message: all flights have ended."""


class NoRoutes(msgspec.Struct, frozen=True, tag=True):
    """From the guard: an order is not flown, since no routes were found that keep vehicles apart."""

    why: str


class GuardFailed(msgspec.Struct, frozen=True, tag=True):
    """From the guard: it has failed."""

    why: str


ToGuard = GuardSetup | Permit | Fly | End | Recover
FromGuard = VehicleState | NoRoutes | GuardEnded | GuardFailed
LINE_MAX = 4096
"""The guard sends no longer lines: a pipe accepts shorter ones completely, or not at all (PIPE_BUF)."""


def line_of(message: ToGuard | FromGuard) -> bytes:
    """Return a message as a line."""
    return msgspec.json.encode(message) + b"\n"
