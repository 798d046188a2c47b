"""The interface of an autopilot: its telemetry and commands. Places are in the team's frame."""

from __future__ import annotations

from abc import ABC, abstractmethod

from robochoc.flight.layout import Point
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass
from robochoc.vehicles.limits import SILENCE_S

OFFBOARD = "OFFBOARD"
"""The mode in which an autopilot follows our set points."""
MANUAL = frozenset({"MANUAL", "ALTCTL", "POSCTL", "ACRO", "STABILIZED", "RATTITUDE"})
"""Modes in which a person flies, by remote control."""
AWAY = frozenset({"RETURN_TO_LAUNCH", "MISSION", "FOLLOW_ME"})
"""Modes in which an autopilot flies by itself at the request of a person or its failsafe, never at ours."""


class RefusedError(RobochocError):
    """The autopilot has denied or not answered a command. The message has the command and the reason."""


@dataclass(frozen=True)
class Telemetry:
    """The reported state of a vehicle."""

    place: Point | None = None
    battery: float | None = None
    mode: str = ""
    armed: bool = False
    in_air: bool = False
    healthy: bool = False
    problem: str = ""
    """The reason why the autopilot is not healthy, if reported."""
    alarm: str = ""
    """The reason to land at once, if the autopilot does not land by itself."""
    connecting: bool = False
    """True from the first message until all data required for flying have been reported."""
    silent_s: float = 0.0
    """The time since the last heartbeat, in seconds."""
    place_age_s: float = 0.0
    """The time since the last position report, in seconds: a connected vehicle may have lost its position."""

    @property
    def has_heartbeat(self) -> bool:
        """True if heartbeats arrive. Without them, MAVSDK reports stopped motors."""
        return self.silent_s <= SILENCE_S

    @property
    def not_ready(self) -> str:
        """The reason why the autopilot refuses to arm; empty if it would arm."""
        return "" if self.healthy else self.problem or "its autopilot is not ready to arm"

    @property
    def is_flown_by_others(self) -> bool:
        """True if a person flies the vehicle, or its autopilot flies without our commands."""
        return self.armed and self.mode in MANUAL | AWAY

    @property
    def mode_and_pilot(self) -> str:
        """The mode of a vehicle that is not flown by us, and the possible pilot, in words."""
        who = "a person flies it" if self.mode in MANUAL else "a person flies it, or its own failsafe"
        return f"{self.mode_in_words} ({who})"

    @property
    def mode_in_words(self) -> str:
        """The mode in lower case."""
        return self.mode.lower().replace("_", " ")


class Autopilot(ABC):
    """A vehicle's autopilot. Commands wait at most a few seconds for the answer, and raise `RefusedError`."""

    url: str
    """The link, for messages."""

    @abstractmethod
    def connect(self) -> bool:
        """Return whether the vehicle has answered; the first call opens the link. Raises `RefusedError`."""

    @abstractmethod
    def telemetry(self) -> Telemetry:
        """Return the newest telemetry. Does not wait."""

    @abstractmethod
    def arm(self) -> None:
        """Arm the motors."""

    @abstractmethod
    def disarm(self) -> None:
        """Disarm the motors, which is refused in the air."""

    @abstractmethod
    def take_off(self, height_m: float) -> None:
        """Rise to a height above the present place, and hold there."""

    @abstractmethod
    def go_to(self, place: Point) -> None:
        """Fly straight to `place`, by set points that are repeated until the next command.

        Called repeatedly on the way; waits for an answer only after another command.
        """

    @abstractmethod
    def hold(self) -> None:
        """Hold the present place, without further set points."""

    @abstractmethod
    def land(self) -> None:
        """Land at the present place, without further commands."""

    @abstractmethod
    def close(self) -> None:
        """Close the link without sending a command."""
