"""Traffic control: gives vehicles clearance for their next steps, using the order in a plan and places from telemetry.

`RoutePlanner` plans routes, and `steps_of` derives the dependencies between their steps. A vehicle gets a set point on
its straight line, a short distance ahead, but not beyond the last step that need not wait. So if a vehicle is late or
stops, vehicles that need its place wait, and the others continue.

A vehicle that is blown off its line may come near to others, also on its way back. The others then do not fly towards
this vehicle (`_vehicle_in_the_way`). When no vehicle can move, all routes are planned again from the present places.

The distance between two vehicles is therefore at least `distance`, less the deviations of both from their lines. A
vehicle within `tolerance_m` (`Fleet`) of its line counts as on the line; others stop for a vehicle farther off.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field

import numpy as np

from robochoc.flight.layout import Point
from robochoc.maps.routes.distances import SLACK_M, line_distances, squashed
from robochoc.system.lazy_dataclass import dataclass
from robochoc.vehicles.fleet import Fleet
from robochoc.vehicles.messages import VehicleTarget
from robochoc.vehicles.route_planner import PlannedLeg, RouteError, RoutePlanner, spacing
from robochoc.vehicles.steps import RouteStep, StepKind, length_along, on_line, steps_of

STILL_S = 3.0
"""The time for which vehicles may block each other before routes are planned again, in seconds."""
_AHEAD_M = 4.0
"""The distance from a vehicle to its set point, in metres; or twice the distance between vehicles, if that is more."""
_NEARER_M = 0.02
"""Smaller approaches to another vehicle are ignored, in metres."""
_ALL_BUT = 0.999
Line = tuple[Point, Point]


class Traffic:
    """Keeps the vehicles in `fleet` apart. Methods may be called from several threads."""

    def __init__(self, fleet: Fleet, clock: Callable[[], float] = time.monotonic) -> None:
        self._fleet = fleet
        self._clock = clock
        self._lock = threading.RLock()
        self._vehicles = {name: TrackedVehicle(name, rank) for rank, name in enumerate(fleet.vehicles)}
        self._planned_s = -math.inf
        self._ahead_m = max(_AHEAD_M, 2 * fleet.distance_m)
        self._keep_m = fleet.distance_m - 2 * fleet.tolerance_m - SLACK_M
        self._ends = False

    # Events

    def update_place(self, name: str, place: Point | None, *, in_air: bool) -> None:
        """Record the place of a vehicle."""
        with self._lock:
            vehicle = self._vehicles[name]
            vehicle.place = place or vehicle.place
            if place and not in_air and not vehicle.flies:
                vehicle.ground_m = place[2]
            came_down = vehicle.gone and vehicle.in_air and not in_air
            vehicle.in_air = in_air
            if came_down:
                self._replan()

    def fly(self, targets: Mapping[str, VehicleTarget]) -> None:
        """Plan routes to `targets`.

        Raises:
            RouteError: No routes were found; all vehicles keep their earlier targets.
        """
        with self._lock:
            before = {name: self._vehicles[name].target for name in targets}
            for name, target in targets.items():
                self._vehicles[name].target = target
            try:
                self._plan()
            except RouteError:
                for name, earlier in before.items():
                    self._vehicles[name].target = earlier
                raise

    def climbing(self, name: str) -> None:
        """Record that a vehicle takes off."""
        with self._lock:
            vehicle = self._vehicles[name]
            vehicle.flies = True
            if vehicle.step:
                vehicle.setpoint, vehicle.released = vehicle.step.end, vehicle.done + 1

    def climbed(self, name: str) -> None:
        """Record that a vehicle has taken off."""
        with self._lock:
            vehicle = self._vehicles[name]
            if vehicle.step and vehicle.step.kind is StepKind.CLIMB:
                vehicle.done += 1

    def landing(self, name: str) -> None:
        """Record that a vehicle lands in place."""
        with self._lock:
            vehicle = self._vehicles[name]
            vehicle.lands = True
            if vehicle.place:
                vehicle.setpoint = vehicle.ground(vehicle.place)

    def landed(self, name: str) -> None:
        """Record that a vehicle is on the ground."""
        with self._lock:
            vehicle = self._vehicles[name]
            vehicle.flies = vehicle.lands = False
            vehicle.setpoint, vehicle.done = vehicle.place, len(vehicle.steps)
            if vehicle.target and not vehicle.target.lands and not self._ends:
                self._replan()  # the vehicle got a new target while landing
            else:
                vehicle.target = None

    def lose(self, name: str) -> None:
        """Record that a vehicle is out of control; others keep clear of this vehicle and the space below."""
        with self._lock:
            vehicle = self._vehicles[name]
            if not vehicle.gone:
                vehicle.gone, vehicle.target = True, None
                self._replan()

    # Clearances

    def clearance(self, name: str) -> Clearance:
        """Return a vehicle's clearance for its next step."""
        with self._lock:
            vehicle = self._vehicles[name]
            self._advance(vehicle)
            step = vehicle.step
            if step is None or vehicle.place is None:
                return Clearance(vehicle.setpoint, rests=True)
            next_place = step.end if step.kind is not StepKind.FLY else self._ahead(vehicle)
            waits_for = self._waits_for(step)
            blocked = "" if waits_for else self._vehicle_in_the_way(vehicle, next_place)
            if blocked:
                return self._stopped(vehicle, blocked)
            vehicle.blocked_s = None
            if waits_for:
                return Clearance(vehicle.setpoint, waits_for=waits_for)
            if step.kind is StepKind.FLY and self._is_due(vehicle, step):
                vehicle.setpoint = next_place
            return Clearance(vehicle.setpoint, climbs=step.kind is StepKind.CLIMB, lands=step.kind is StepKind.LAND)

    def _is_due(self, vehicle: TrackedVehicle, step: RouteStep) -> bool:
        """Return whether a vehicle needs a new set point, because the last one is near, or not on its line."""
        before, place = vehicle.setpoint, vehicle.place
        if before is None or place is None or math.dist(place, before) <= self._fleet.kind.rules.renews_m:
            return True
        end = vehicle.steps[max(vehicle.released - 1, vehicle.done)].end
        reached = length_along(step.begin, end, before)
        is_on = 0 <= reached <= math.dist(step.begin, end)
        return not is_on or math.dist(before, on_line(step.begin, end, reached)) > _NEARER_M

    def is_clear_below(self, name: str) -> bool:
        """Return whether no vehicle flying by our command is directly below the vehicle `name`."""
        with self._lock:
            vehicle = self._vehicles[name]
            if vehicle.place is None:
                return True
            column = vehicle.place, vehicle.ground(vehicle.place)
            others = (one for one in self._vehicles.values() if one is not vehicle and one.flies and one.place)
            return all(self._apart(column, (one.place or one.rest,) * 2) >= self._keep_m for one in others)

    def _advance(self, vehicle: TrackedVehicle) -> None:
        """Update the completed steps of a vehicle, and release the steps that need not wait."""
        while (step := vehicle.step) and step.kind is StepKind.FLY:
            if vehicle.done == vehicle.released:
                if self._waits_for(step):
                    return
                vehicle.released += 1
            if vehicle.place is None or not self._is_through(step, vehicle.place):
                break
            vehicle.done += 1
            if vehicle.done == len(
                vehicle.steps
            ):  # the vehicle may stop nearby for another reason, such as the end of its take-off
                vehicle.setpoint = step.end
        following = vehicle.steps[vehicle.done : vehicle.released]
        is_corner = bool(following) and following[-1].is_corner
        while vehicle.released < len(vehicle.steps) and not is_corner:
            step = vehicle.steps[vehicle.released]
            if step.kind is not StepKind.FLY or self._waits_for(step):
                return
            vehicle.released += 1
            is_corner = step.is_corner

    def _is_through(self, step: RouteStep, place: Point) -> bool:
        near = self._fleet.tolerance_m
        length = math.dist(step.begin, step.end)
        if step.is_corner or not length:
            return math.dist(place, step.end) <= near
        reached = length_along(step.begin, step.end, place)
        return reached >= length and math.dist(place, on_line(step.begin, step.end, reached)) <= near

    def _ahead(self, vehicle: TrackedVehicle) -> Point:
        """Return the point on its line to which the vehicle may fly."""
        step, place = vehicle.step, vehicle.place
        if step is None or place is None or vehicle.released <= vehicle.done:
            return vehicle.rest
        end = vehicle.steps[vehicle.released - 1].end
        length = math.dist(step.begin, end)
        if not length:
            return end
        reached = max(length_along(step.begin, end, place), 0.0) + self._ahead_m
        return end if reached >= length else on_line(step.begin, end, reached)

    def _waits_for(self, step: RouteStep) -> str:
        for name, count in step.needs.items():
            other = self._vehicles[name]
            if other.done < count and not other.gone:
                return name
        return ""

    def _stopped(self, vehicle: TrackedVehicle, blocked: str) -> Clearance:
        """Return a clearance to stay in place. If the vehicle has been blocked for some time, plan all routes again."""
        now = self._clock()
        if vehicle.blocked_s is None:
            vehicle.blocked_s = now
            if vehicle.flies and vehicle.step and vehicle.step.kind is not StepKind.CLIMB:
                vehicle.setpoint = vehicle.place
        elif now - max(vehicle.blocked_s, self._planned_s) > STILL_S:
            self._replan()
        return Clearance(vehicle.setpoint, waits_for=blocked)

    def _vehicle_in_the_way(self, vehicle: TrackedVehicle, to: Point) -> str:
        """Return the name of a vehicle too near to the straight line `to` a point; empty if no vehicle is."""
        if vehicle.place is None:
            return ""
        mine = vehicle.place, to
        reach = math.dist(*mine) + self._keep_m * self._fleet.downwash + _NEARER_M
        for other in self._vehicles.values():
            if other is vehicle or other.place is None:
                continue
            for line, counts in self._lines(other, vehicle):
                if counts and math.dist(vehicle.place, line[0]) <= reach + math.dist(*line):
                    now_m = self._apart((vehicle.place, vehicle.place), line)
                    if self._apart(mine, line) < min(self._keep_m, now_m - _NEARER_M):
                        return other.name
        return ""

    def _lines(self, other: TrackedVehicle, vehicle: TrackedVehicle) -> Iterator[tuple[Line, bool]]:
        """Yield the lines on which the `other` vehicle may be, and whether `vehicle` must keep away from each line."""
        place = other.place or other.rest
        yield (place, place), True
        if other.in_air and (other.gone or other.lands):
            yield (place, other.ground(place)), True
        elif other.flies and other.blocked_s is None and other.setpoint:
            strays = self._strays(other) or self._strays(vehicle)
            yield (place, other.setpoint), strays and other.rank < vehicle.rank

    def _strays(self, vehicle: TrackedVehicle) -> bool:
        """Return whether a vehicle is off its line."""
        if vehicle.place is None or vehicle.setpoint is None:
            return False
        begin = vehicle.step.begin if vehicle.step else vehicle.setpoint
        reached = max(
            0.0, min(length_along(begin, vehicle.setpoint, vehicle.place), math.dist(begin, vehicle.setpoint))
        )
        return math.dist(vehicle.place, on_line(begin, vehicle.setpoint, reached)) > self._fleet.tolerance_m

    def _apart(self, first: Line, second: Line) -> float:
        flat = [squashed(np.array(line), self._fleet.downwash) for line in (first, second)]
        return float(line_distances((flat[0][0], flat[0][1]), (flat[1][0], flat[1][1])))

    # Plans

    def _replan(self) -> None:
        """Plan all routes again from the present places. If that fails, flying vehicles stay in place."""
        self._planned_s = self._clock()
        try:
            if self._ends:
                self.bring_down()
            else:
                self._plan()
        except RouteError:
            return

    def _plan(self) -> None:
        """Plan routes to the present destinations. Raises `RouteError`."""
        self._planned_s = self._clock()
        vehicles = [one for one in self._vehicles.values() if one.place]
        standing = {one.name: self._standing(one) for one in vehicles if not self._moves(one)}
        moving = [one for one in vehicles if one.name not in standing]
        first = [PlannedLeg(one.name, np.array([one.place, one.rest])) for one in moving if one.flies]
        starts = {one.name: one.rest for one in moving}
        goals = self._goals(moving)
        climbing = {one.name: one.rest[2] + self._fleet.takeoff_m for one in moving if not one.flies and not one.in_air}
        distance_m = self._fleet.distance_m
        RoutePlanner(self._fleet, standing, distance_m).check(goals)
        if any(one.flies for one in moving):
            distance_m = self._present_distance([*starts.values(), *standing.values()])
        legs = RoutePlanner(self._fleet, standing, distance_m).legs(starts, goals, climbing)
        lifted = {one.name for one in moving if one.flies and one.step and one.step.kind is StepKind.CLIMB}
        first.sort(key=lambda leg: leg.name not in lifted)
        landing = {one.name for one in moving if one.target and one.target.lands}
        self._assign_steps(steps_of([*first, *legs], lifted | {*climbing}, landing, distance_m, self._fleet.downwash))
        for name in lifted:
            self._vehicles[name].released = 1

    def _assign_steps(self, steps: Mapping[str, list[RouteStep]]) -> None:
        for vehicle in self._vehicles.values():
            if vehicle.gone or not vehicle.lands:
                vehicle.steps, vehicle.done, vehicle.released = steps.get(vehicle.name, []), 0, 0
                vehicle.blocked_s = None

    def _moves(self, vehicle: TrackedVehicle) -> bool:
        """Return whether routes are planned for a vehicle. Other vehicles stay, or land by themselves."""
        if vehicle.gone or vehicle.lands:
            return False
        if vehicle.flies:
            return True
        return vehicle.target is not None and (vehicle.in_air or not vehicle.target.lands)

    def _standing(self, vehicle: TrackedVehicle) -> Point:
        at = vehicle.place or vehicle.rest
        return vehicle.ground(at) if vehicle.in_air and (vehicle.gone or vehicle.lands) else at

    def _goals(self, moving: list[TrackedVehicle]) -> dict[str, Point]:
        """Return the goals of vehicles, none of them below a vehicle that is out of control and still in the air."""
        found = {one.name: self._goal(one) for one in moving}
        falling = [one.place for one in self._vehicles.values() if one.gone and one.in_air and one.place]
        for name, goal in found.items():
            above = [at for at in falling if math.dist(at[:2], goal[:2]) < self._fleet.distance_m and at[2] >= goal[2]]
            if above:
                others = [at for other, at in found.items() if other != name]
                found[name] = (
                    RoutePlanner(self._fleet, {}, self._fleet.distance_m).free_spot(goal, [*falling, *others]) or goal
                )
        return found

    def _goal(self, vehicle: TrackedVehicle) -> Point:
        target = vehicle.target
        if target is None:
            return vehicle.rest
        if target.lands and not self._fleet.fence.covers(target.at):
            return vehicle.ground(vehicle.rest)
        return target.at

    def _present_distance(self, points: Iterable[Point]) -> float:
        """Return the distance for planning, which is less than in the fleet file if vehicles are already nearer."""
        least = spacing([*points], self._fleet.downwash)
        next_place = self._fleet.distance_m
        return next_place if least >= next_place else max(least * _ALL_BUT, next_place / 2)

    def bring_down(self) -> None:
        """Plan the landing of all flying vehicles, the lowest first: in place, or beside a place that is not free."""
        with self._lock:
            self._ends = True
            flying = [
                one for one in self._vehicles.values() if one.flies and not one.gone and not one.lands and one.place
            ]
            flying.sort(key=lambda one: one.rest[2])
            for one in flying:
                one.target, one.setpoint = None, one.place
            standing = {
                one.name: self._standing(one) for one in self._vehicles.values() if one.place and one not in flying
            }
            rests = {one.name: one.rest for one in flying}
            grounds = {one.name: one.ground(one.rest)[2] for one in flying}
            distance_m = self._present_distance([*rests.values(), *standing.values()])
            planner = RoutePlanner(self._fleet, standing, distance_m)
            try:
                legs = planner.descents(rests, grounds)
                steps = steps_of(legs, (), {one.name for one in flying}, distance_m, self._fleet.downwash)
            except RouteError:
                steps = {one.name: [RouteStep(StepKind.LAND, one.rest, one.ground(one.rest), True)] for one in flying}
            self._assign_steps(steps)
            self._planned_s = self._clock()


@dataclass(frozen=True)
class Clearance:
    """A permission for the next step of a vehicle."""

    to: Point | None = None
    """The set point of the vehicle; None before the first one."""
    climbs: bool = False
    lands: bool = False
    rests: bool = False
    """True once the vehicle has arrived at the end of its route."""
    waits_for: str = ""
    """The name of the vehicle to wait for; empty if no wait is necessary."""


@dataclass
class TrackedVehicle:
    """The state of a vehicle in traffic."""

    name: str
    rank: int
    place: Point | None = None
    in_air: bool = False
    ground_m: float = 0.0
    """The height of the ground at the vehicle's last place on the ground."""
    flies: bool = False
    """True while the vehicle is in the air by our command."""
    lands: bool = False
    """True while the vehicle's autopilot lands it."""
    gone: bool = False
    target: VehicleTarget | None = None
    setpoint: Point | None = None
    steps: list[RouteStep] = field(default_factory=list)
    done: int = 0
    released: int = 0
    blocked_s: float | None = None

    @property
    def step(self) -> RouteStep | None:
        """The current step; None after the last."""
        return self.steps[self.done] if self.done < len(self.steps) else None

    @property
    def rest(self) -> Point:
        """The destination according to the newest set point."""
        return self.setpoint or self.place or (math.nan,) * 3

    def ground(self, at: Point) -> Point:
        """Return the point on the ground below `at`."""
        return (*at[:2], min(self.ground_m, at[2]))
