"""An autopilot that does what it is told, at once, and the pilot that flies by it: no link, no library, no time."""

from __future__ import annotations

from dataclasses import replace

from robochoc.flight.layout import Point
from robochoc.vehicles.autopilot import OFFBOARD, Autopilot, RefusedError, Telemetry
from robochoc.vehicles.fleet import AtEnd, Fence, Fleet, VehicleLink, point_text
from robochoc.vehicles.messages import VehicleState, VehicleTarget
from robochoc.vehicles.pilot import Pilot
from robochoc.vehicles.traffic import Traffic

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

    def telemetry(self) -> Telemetry:
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


FLEET = Fleet({"A": VehicleLink("udpin://0.0.0.0:1")}, Fence((-1, -1, 0), (9, 9, 9)), distance_m=2)
"""With such a distance set points are far ahead: at the places themselves."""
THERE = VehicleTarget((3, 1, 2))


class Ordered(Pilot):
    """A pilot who gets orders as the guard gives them: ways are planned first."""

    def __init__(self, played: Played) -> None:
        self.traffic = Traffic(FLEET, lambda: played.now)
        super().__init__("A", played, FLEET, self.traffic, lambda: played.now)

    def fly(self, order: int, target: VehicleTarget) -> None:
        self.traffic.fly({"A": target})
        super().fly(order, target)

    def end(self, how: AtEnd, *, waits: bool) -> None:
        if how is AtEnd.LAND:
            self.traffic.bring_down()
        super().end(how, waits=waits)


def steps(pilot: Pilot, played: Played, count: int = 1, each_s: float = 0.1) -> VehicleState:
    for _ in range(count):
        played.now += each_s
        state = pilot.step()
    return state


def flying(pilot: Pilot, target: VehicleTarget = THERE) -> None:
    pilot.step()
    pilot.fly(1, target)


def arrived(pilot: Pilot, played: Played) -> None:
    """Fly to the first place."""
    flying(pilot)
    steps(pilot, played, 3)


def is_over(pilot: Pilot) -> bool:
    return pilot.ended


def landed(played: Played) -> None:
    played.seen = replace(played.seen, armed=False, in_air=False)
