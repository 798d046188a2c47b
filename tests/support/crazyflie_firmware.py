"""The firmware of a played Crazyflie: its supervisor, which arms it, and its high-level commander, which flies it.

A set point of low level takes over from that commander, and one without thrust lets a Crazyflie fall, as it does in the
firmware. All times of the firmware are divided by `haste`, but for the one that it gives to whoever is armed and does
not take off: that is for people, and a busy machine needs some of it. Places are in metres, from where each was
switched on.

Source: the firmware's supervisor.c, planner.c and crtp_commander_high_level.c, protocol version 12.
"""

from __future__ import annotations

import math
import struct
import time
from dataclasses import dataclass, field

Place = tuple[float, float, float]
PREFLIGHT_S, LANDED_S, THRUST_S = 30.0, 3.0, 2.0
"""The firmware's: armed without a flight; landed and still armed; since the last thrust."""
NEAR_M = 0.02
REFUSED = 1


@dataclass
class Crazyfly:
    """A Crazyflie: what it is told to be, and what has become of it. Tests read and set the fields while it lives."""

    port: int
    at: Place = (0.0, 0.0, 0.0)
    haste: float = 20.0
    battery: float = 1.0
    drain: float = 0.0
    """The charge that it uses in a second of flight."""
    arms_itself: bool = False
    version: int = 12
    refuses: set[str] = field(default_factory=set)
    """Of "arm", "takeoff", "goto", "land": commands that are denied."""
    deaf: set[str] = field(default_factory=set)
    """Of the same: commands that are obeyed, and whose first answer is lost."""
    lacks: set[str] = field(default_factory=set)
    """Log variables that its firmware does not have."""
    silent: bool = False
    """True: neither sends nor hears, as without radio."""
    missed: int = 0
    """The packets that have come while it was silent."""
    silent_above: float = math.inf
    """The height from which on it is silent, in metres."""
    gone: bool = False
    """True: nobody is at its port, as when a simulator has ended."""
    low_power: bool = False
    """Whether its power management tells a low voltage."""
    noise: list[bytes] = field(default_factory=list)
    """What it sends besides, once."""
    tumbled: bool = False
    flown_by_hand: bool = False
    """Somebody else sends it set points."""
    hand_after: str = ""
    """The entry of the log from which on it is flown by hand."""
    planner: str = "idle"
    armed: bool = False
    locked: bool = False
    log: list[str] = field(default_factory=list)
    """What has happened to it, in order."""
    paths: list[tuple[Place, float, bool]] = field(default_factory=list)
    """Where it was sent to, in how many seconds, and whether in a straight line."""

    @property
    def flies(self) -> bool:
        return self.at[2] > NEAR_M

    @property
    def is_down(self) -> bool:
        """Return whether it has landed, as it should."""
        return (
            not self.flies
            and self.planner == "idle"
            and "fell" not in self.log
            and (self.arms_itself or not self.armed)
        )

    @property
    def is_safe(self) -> bool:
        """Return whether it is on the ground, hovers by itself, or lands."""
        return "fell" not in self.log and (self.is_down or (self.planner in {"flying", "landing"}))

    @property
    def state(self) -> str:
        """Return in words what it does and where it is."""
        return f"{self.planner} armed={self.armed} at {self.at}: {self.log}"


class Firmware:
    """What a Crazyflie does with what it is told. Commands of the high-level commander return its answer."""

    def __init__(self, vehicle: Crazyfly) -> None:
        self.vehicle = vehicle
        self._from = self._to = vehicle.at
        self._begun = self._armed_at = self._down_at = 0.0
        self._lasts = 0.001
        self._straight = False
        self._thrust_at = -math.inf

    def say(self, what: str) -> None:
        vehicle = self.vehicle
        vehicle.log.append(what)
        if what == vehicle.hand_after:
            vehicle.flown_by_hand, vehicle.planner = True, "idle"

    def live(self, now: float, passed: float) -> None:
        """Let time go by."""
        vehicle = self.vehicle
        if vehicle.planner in {"flying", "landing"}:
            self._move(now)
        if vehicle.flown_by_hand or (vehicle.planner != "idle" and (vehicle.flies or self._to[2] > NEAR_M)):
            self._thrust_at = now
        elif vehicle.flies:
            self._fall()
        if vehicle.flies:
            vehicle.battery = max(0.0, vehicle.battery - vehicle.drain * passed)
        self._supervise(now)

    def arm(self, *, on: bool) -> bool:
        """Arm, or disarm, if that is allowed; return whether it is."""
        vehicle = self.vehicle
        allowed = "arm" not in vehicle.refuses and (not on or not (vehicle.locked or vehicle.tumbled))
        if not allowed:
            self.say("refused arm")
        elif on != vehicle.armed:
            vehicle.armed = on
            self._armed_at = self._down_at = time.monotonic()
            self.say("armed" if on else "disarmed")
        return allowed

    @property
    def is_armed(self) -> bool:
        return self.vehicle.armed or self.vehicle.arms_itself

    @property
    def can_fly(self) -> bool:
        return self.is_armed and not self.vehicle.locked and not self.vehicle.tumbled

    def bits(self) -> int:
        vehicle, now = self.vehicle, time.monotonic()
        fit = not vehicle.locked and not vehicle.tumbled
        return sum(
            1 << bit
            for bit, holds in enumerate(
                (
                    *(fit and not self.is_armed, self.is_armed, vehicle.arms_itself, self.can_fly),
                    *(self._is_flying(now), vehicle.tumbled, vehicle.locked, False),
                    *(vehicle.planner != "idle", self._is_finished(now), False, False),
                )
            )
            if holds
        )

    def stop_planner(self, why: str) -> None:
        """Follow no path any more."""
        self.vehicle.planner = "idle"
        self.say(why)

    def stop(self, _content: bytes) -> int:
        self.stop_planner("stop")
        return 0

    def take_off(self, content: bytes) -> int:
        if self.vehicle.planner != "idle":
            return REFUSED
        height, _, own_yaw, lasts = struct.unpack("<ff?f", content)
        assert own_yaw
        self._path((*self.vehicle.at[:2], height), lasts, "flying", "takeoff", straight=False)
        return 0

    def land(self, content: bytes) -> int:
        if self.vehicle.planner == "landing":
            return REFUSED
        height, _, own_yaw, lasts = struct.unpack("<ff?f", content)
        assert own_yaw
        self._path((*self.vehicle.at[:2], height), lasts, "landing", "land", straight=False)
        return 0

    def go_to(self, content: bytes) -> int:
        relative, straight, x, y, z, yaw, lasts = struct.unpack("<BBfffff", content)
        if relative:
            x, y, z = (a + b for a, b in zip(self.vehicle.at, (x, y, z), strict=True))
        else:
            assert math.isclose(yaw, math.pi / 2, rel_tol=1e-6)  # it keeps its heading
        what = "hold" if relative else f"goto {x:g},{y:g},{z:g}"
        self._path((x, y, z), lasts, "flying", what, straight=bool(straight))
        return 0

    def _path(self, to: Place, lasts: float, planner: str, what: str, *, straight: bool) -> None:
        vehicle = self.vehicle
        self._from, self._to, self._begun, self._straight = vehicle.at, to, time.monotonic(), straight
        self._lasts = lasts / vehicle.haste
        vehicle.planner = planner
        vehicle.paths.append((to, lasts, straight))
        self.say(what)

    def _move(self, now: float) -> None:
        vehicle = self.vehicle
        part = min((now - self._begun) / self._lasts, 1.0)
        if not self._straight:
            part = part**4 * (35 - 84 * part + 70 * part**2 - 20 * part**3)
        x, y, z = (a + (b - a) * part for a, b in zip(self._from, self._to, strict=True))
        vehicle.at = (x, y, z)
        if self._is_finished(now) and vehicle.planner == "landing":
            vehicle.planner = "idle"
            self.say("landed")

    def _supervise(self, now: float) -> None:
        """Disarm as the firmware does: after a landing, and when nobody takes off."""
        vehicle = self.vehicle
        if self._is_flying(now) or not vehicle.armed or vehicle.arms_itself:
            self._down_at = now
            return
        flew = math.isfinite(self._thrust_at) and self._thrust_at > self._armed_at
        if now - self._down_at > (LANDED_S / vehicle.haste if flew else PREFLIGHT_S):
            vehicle.armed = False
            self.say("disarmed by itself")

    def _fall(self) -> None:
        vehicle = self.vehicle
        vehicle.at, vehicle.locked, vehicle.armed, vehicle.planner = (*vehicle.at[:2], 0.0), True, False, "idle"
        self.say("fell")

    def _is_finished(self, now: float) -> bool:
        return now - self._begun >= self._lasts

    def _is_flying(self, now: float) -> bool:
        return now - self._thrust_at < THRUST_S / self.vehicle.haste
