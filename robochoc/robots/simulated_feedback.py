"""Feedback from a simulated flight: decisions are flown, and obstacles and failures are reported."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from itertools import islice

import numpy as np

from robochoc.flight.flight import Flight
from robochoc.flight.layout import Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Drone, Goal, Leg, MissionBuilder
from robochoc.flight.quadrotor.conditions import FlightConditions, MotorFailure
from robochoc.flight.reports import OutOfOrderReport, Report
from robochoc.formats.diagnostics import on_one_line
from robochoc.robots.closed_loop import TOGETHER_S, Feedback
from robochoc.robots.mission_publisher import FlightBroadcast, nanoseconds
from robochoc.system.errors import RobochocError
from robochoc.system.lazy_dataclass import dataclass

NAMES_MAX = 12
"""The maximum number of drones named in an error."""
FAILS_S = 2.0
"""The default time of a failure, at which the drone is in the air, in seconds."""


class CannotFlyError(RobochocError):
    """The decision cannot be flown. The message has the reason."""


class UnknownDroneError(RobochocError):
    """A drone that should fail does not exist. The message names the existing drones."""


@dataclass(frozen=True)
class FlightSettings:
    """The conditions of a simulated flight, before its mission is known.

    `failures` are names of robots or drones, with the time in seconds at which a motor stops; for a robot, its first
    drone fails. `obstacles` are in units of the problem. The other attributes are those of `FlightConditions`.
    """

    distance: float | None = None
    wind: Point = (0.0, 0.0, 0.0)
    gusts: float = 0.0
    seed: int = 0
    downwash: float = 1.0
    failures: tuple[tuple[str, float], ...] = ()
    obstacles: tuple[Point, ...] = ()

    def check(self, drones: Sequence[Drone]) -> None:
        """Raise `UnknownDroneError` for a drone that does not exist, and `ValueError` for impossible conditions."""
        self.conditions(drones, 1.0)

    def conditions(self, drones: Sequence[Drone], scale: float) -> FlightConditions:
        """Return the conditions for a flight of `drones`, in metres. Raises `UnknownDroneError` and `ValueError`."""
        return FlightConditions(
            distance=self.distance,
            wind=self.wind,
            gusts=self.gusts,
            seed=self.seed,
            downwash=self.downwash,
            failures=tuple(MotorFailure(_drone_named(drones, name), at_s) for name, at_s in self.failures),
            obstacles=tuple((x * scale, y * scale, z * scale) for x, y, z in self.obstacles),
        )


def _drone_named(drones: Sequence[Drone], name: str) -> str:
    """Return `name` if it is a drone's name, or the name of the first drone of the robot `name`."""
    found = [drone for drone in drones if drone.name == name] or [drone for drone in drones if drone.robot == name]
    if not found:
        known = [drone.name for drone in drones]
        more = f" and {len(known) - NAMES_MAX} more" * (len(known) > NAMES_MAX)
        raise UnknownDroneError(f"there is no drone {name!r} to fail: choose {', '.join(known[:NAMES_MAX])}{more}")
    return found[0].name


@dataclass
class SimulatedFeedback(Feedback):
    """Flies each decision in the simulation. A decision is complete when all drones have reached their places.

    A report ends the leg early: all other drones slow down and hover, and continue if the report has no effect. Nothing
    is reported twice. Time begins at 0 with the first leg. Each decision is a leg in the log, even if it was outdated
    before a drone could follow it. The team decides while all drones hover, and only after all reports on an event, so
    a recording of the reports leads to the same run.
    """

    settings: FlightSettings
    simulated: bool = True
    _flight: Flight | None = None
    _leg: Leg | None = None
    _is_unfinished: bool = False
    """True if the latest decision has not been flown completely."""
    _calls: list[int] = field(default_factory=list)
    """The number of calls of `Flight.fly` for each decision."""
    _waiting: deque[Report] = field(default_factory=deque)
    _known: set[Report] = field(default_factory=set)
    _now_s: float = 0.0
    _broadcast: FlightBroadcast = field(default_factory=FlightBroadcast)

    def now_ns(self) -> int:
        """Return the time of the flight, in nanoseconds."""
        return nanoseconds(self._now_s)

    def on_decision(self, builder: MissionBuilder, leg: Leg, left_s: float | None) -> None:  # noqa: ARG002 - it is fast
        """Store a decision, which `next` flies."""
        if self._flight is None:
            homes = np.array([drone.home for drone in builder.drones], dtype=float).reshape(-1, 3)
            try:
                conditions = self.settings.conditions(builder.drones, builder.scale)
                names = [drone.name for drone in builder.drones]
                self._flight = Flight(
                    names,
                    homes,
                    conditions,
                    lambda _: self.idle(),
                    rises=builder.rises,
                    ground=builder.ground,
                    walls=builder.walls,
                )
            except ValueError as refused:
                raise CannotFlyError(on_one_line(str(refused))) from refused
        elif not self._calls[-1] and self._leg is not None:
            self._fly_leg(self._flight, self._leg, {})
        self._leg = leg
        self._is_unfinished = True
        self._calls.append(0)

    def next(self, until_s: float | None) -> Report | None:
        """Return the next report; see `Feedback.next`."""
        while not self._waiting and until_s is None and self._is_unfinished and self._leg and self._flight:
            self._fly(self._flight, self._leg)
        if not self._waiting or (until_s is not None and self._waiting[0].at_s > until_s):
            return None
        return self._waiting.popleft()

    def log(self) -> FlightLog | None:
        """Return the flight log, with a leg for each decision; None if nothing was flown. Raises `CannotFlyError`."""
        if self._flight is None or self._leg is None:
            return None
        if not self._calls[-1]:
            self._fly_leg(self._flight, self._leg, self._leg.goals)
        flown = self._flight.log()
        stages = iter(flown.legs)
        parts = [list(islice(stages, calls)) for calls in self._calls]
        return replace(
            flown, legs=tuple(replace(first, ends_s=[first, *others][-1].ends_s) for first, *others in parts)
        )

    def _fly(self, flight: Flight, leg: Leg) -> None:
        """Fly until a drone makes a new report, or all drones have reached their goals."""
        reports = self._fly_leg(flight, leg, leg.goals, stop_on_report=True)
        new = self._not_yet_reported(reports)
        if reports and not new:
            self._fly_leg(flight, leg, leg.goals)
        self._is_unfinished = bool(new)
        flown = flight.log()
        new += self._not_yet_reported(self._fallen(flown))
        while new and flown.times[-1] <= max(report.at_s for report in new) + TOGETHER_S:
            self._fly_leg(flight, leg, {})
            flown = flight.log()
            new += self._not_yet_reported(self._fallen(flown))
        self._waiting.extend(new)
        self._publish(flown, new)

    def _fly_leg(
        self, flight: Flight, leg: Leg, goals: Mapping[int, Goal], *, stop_on_report: bool = False
    ) -> tuple[Report, ...]:
        self._calls[-1] += 1
        try:
            return flight.fly(leg.opened_by, goals, stop_on_report=stop_on_report)
        except ValueError as refused:
            raise CannotFlyError(on_one_line(f"the decision cannot be flown: {refused}")) from refused

    def _fallen(self, flown: FlightLog) -> list[Report]:
        """Return reports for drones that have fallen without a report."""
        known = {report.drone for report in self._known if isinstance(report, OutOfOrderReport)}
        lost = [flown.names[number] for number in np.flatnonzero(np.isnan(flown.errors_m))]
        return [OutOfOrderReport(name, "has fallen", float(flown.times[-1])) for name in lost if name not in known]

    def _not_yet_reported(self, reports: Sequence[Report]) -> list[Report]:
        """Return the new reports, sorted by time."""
        new = sorted((one for one in reports if _without_time(one) not in self._known), key=lambda report: report.at_s)
        self._known.update(map(_without_time, new))
        return new

    def _publish(self, flown: FlightLog, reports: Sequence[Report]) -> None:
        """Publish the flight since the last call, with `reports`."""
        self._now_s = float(flown.times[-1]) if len(flown.times) else self._now_s
        if self.publishers:
            self._broadcast.publish(self.publishers, flown, reports, self._now_s)


def _without_time(report: Report) -> Report:
    """Return `report` without its time."""
    return replace(report, at_s=0.0)
