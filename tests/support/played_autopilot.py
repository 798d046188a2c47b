"""An autopilot that does what it is told, at once: no link, no library, no time."""

from __future__ import annotations

from dataclasses import replace

from robochoc.flight.layout import Point
from robochoc.ros.autopilots.autopilot import OFFBOARD, Autopilot, RefusedError, Telemetry
from robochoc.ros.autopilots.fleet import point_text

GROUND = Telemetry((0, 0, 0), 1.0, "HOLD", healthy=True)


class Played(Autopilot):
    """Does what it is told, at once, and keeps what that was."""

    url = "udpin://0.0.0.0:1"

    def __init__(self) -> None:
        self.now = 0.0
        self.seen = GROUND
        self.done: list[str] = []
        self.refuses: set[str] = set()
        self.connects = True
        self.opens_s = 0.0
        """The time that it takes to open the link."""

    def take(self, what: str, **after: object) -> None:
        self.done.append(what)
        if what.split(maxsplit=1)[0] in self.refuses:
            raise RefusedError(f"it did not {what}")
        self.seen = replace(self.seen, **after)  # type: ignore[arg-type]

    def connect(self) -> bool:
        self.now, self.opens_s = self.now + self.opens_s, 0.0
        return self.connects

    def look(self) -> Telemetry:
        return self.seen

    def arm(self) -> None:
        self.take("arm", armed=True)

    def disarm(self) -> None:
        self.take("disarm", armed=False)

    def take_off(self, height_m: float) -> None:
        self.take(f"rise {height_m:g}", in_air=True, mode="TAKEOFF", place=(0.0, 0.0, height_m))

    def go_to(self, place: Point) -> None:
        self.take(f"go ({point_text(place)})", mode=OFFBOARD, place=place)

    def hold(self) -> None:
        self.take("hold", mode="HOLD")

    def land(self) -> None:
        self.take("land", mode="LAND")

    def close(self) -> None:
        pass
