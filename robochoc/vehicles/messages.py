"""Messages between robochoc and the guard process: one a line, in JSON."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import msgspec

from robochoc.flight.layout import Point
from robochoc.vehicles.fleet import AtEnd, Fleet


class Phase(StrEnum):
    """The phase of a vehicle's flight."""

    CONNECTING = "connecting"
    READY = "ready"
    CLIMBING = "climbing"
    FLYING = "flying"
    ARRIVED = "arrived"
    LANDING = "landing"
    LANDED = "landed"
    OUT = "out"
    """Out of order: `why` says for what reason. It is brought to the ground if that is possible."""


class Target(msgspec.Struct, frozen=True):
    """The target of a vehicle, in the team's frame; it `lands` there, or stays in the air."""

    at: Point
    lands: bool = False


class Setup(msgspec.Struct, frozen=True, tag=True):
    """To the guard, first of all."""

    fleet: Fleet


class Permit(msgspec.Struct, frozen=True, tag=True):
    """To the guard: vehicles may be armed. Without it no vehicle is commanded."""


class Fly(msgspec.Struct, frozen=True, tag=True):
    """To the guard: fly to these places. Orders are numbered; a later one takes the place of an earlier one."""

    order: int
    targets: Mapping[str, Target]


class End(msgspec.Struct, frozen=True, tag=True):
    """To the guard: bring all to an end. With `waits` it stays until those that land are on the ground."""

    how: AtEnd
    waits: bool


class Recover(msgspec.Struct, frozen=True, tag=True):
    """To the guard: bring to an end what another guard, which was lost, has left armed."""

    how: AtEnd


class State(msgspec.Struct, frozen=True, tag=True):
    """From the guard: the state of a vehicle, several times a second."""

    vehicle: str
    phase: Phase
    order: int = 0
    """The newest order that it has taken up."""
    place: Point | None = None
    """In the team's frame; None: not known yet."""
    battery: float | None = None
    """1 is full; None: not measured."""
    healthy: bool = False
    """Whether the autopilot would allow arming."""
    in_air: bool = False
    commanded: bool = False
    """Whether it was ever commanded."""
    why: str = ""
    waits_for: str = ""
    """Another vehicle, which has to be out of the way first."""


class Ended(msgspec.Struct, frozen=True, tag=True):
    """From the guard, last of all: every vehicle has been brought to an end."""


class NoWays(msgspec.Struct, frozen=True, tag=True):
    """From the guard: an order is not flown, as no ways were found that keep vehicles apart."""

    why: str


class Failed(msgspec.Struct, frozen=True, tag=True):
    """From the guard: it cannot do its work."""

    why: str


ToGuard = Setup | Permit | Fly | End | Recover
FromGuard = State | NoWays | Ended | Failed
LINE_MAX = 4096
"""Longer lines are not sent by the guard: a pipe takes shorter ones whole, or not at all (PIPE_BUF)."""


def line_of(message: ToGuard | FromGuard) -> bytes:
    """Return a message as a line."""
    return msgspec.json.encode(message) + b"\n"
