"""The state of a vehicle in traffic, and its clearance."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from robochoc.flight.layout import Point
from robochoc.vehicles.messages import Target
from robochoc.vehicles.steps import Step


@dataclass(frozen=True)
class Clearance:
    """The permission of a vehicle for its next step."""

    to: Point | None = None
    """Its set point; None before it has one."""
    climbs: bool = False
    lands: bool = False
    rests: bool = False
    """True once the vehicle has arrived at its target, or as near to it as there is a way."""
    waits_for: str = ""
    """The name of another vehicle; empty if it need not wait."""


@dataclass
class Craft:
    """A vehicle."""

    name: str
    rank: int
    place: Point | None = None
    in_air: bool = False
    ground_m: float = 0.0
    """The height at which it was last on the ground."""
    flies: bool = False
    """True while the vehicle is in the air by our command."""
    lands: bool = False
    """True while the vehicle's autopilot lands it."""
    gone: bool = False
    target: Target | None = None
    setpoint: Point | None = None
    steps: list[Step] = field(default_factory=list)
    done: int = 0
    released: int = 0
    blocked_s: float | None = None

    @property
    def step(self) -> Step | None:
        """Return its current step; None after the last."""
        return self.steps[self.done] if self.done < len(self.steps) else None

    @property
    def rest(self) -> Point:
        """Return its destination by its newest set point."""
        return self.setpoint or self.place or (math.nan,) * 3

    def ground(self, at: Point) -> Point:
        """Return the point on the ground below `at`."""
        return (*at[:2], min(self.ground_m, at[2]))
