"""Traffic: clearances of vehicles for their next steps. The plan gives only their order; telemetry gives their places.

`RoutePlanner` plans, `steps_of` derives which steps wait for which. A vehicle gets a set point on its straight line, a
short way ahead of its place, and never beyond the last step that need not wait. So if a vehicle is late or stops, those
that need its place wait, and the others fly on.

A vehicle that is blown off its line may come near to others, also on its way back. The others then do not fly towards
it (`_in_the_way`). When no vehicle can move, all routes are planned again from the present places.

The distance between two vehicles is therefore `distance`, less the deviation of each from its line: a vehicle within
`tolerance_m` of its line (`Fleet`) counts as on it, and others stop for a vehicle farther off.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np

from robochoc.flight.layout import Point
from robochoc.maps.routes.distances import SLACK_M, line_distances, squashed
from robochoc.vehicles.craft import Clearance, Craft
from robochoc.vehicles.fleet import Fleet
from robochoc.vehicles.messages import Target
from robochoc.vehicles.route_planner import PlannedLeg, RouteError, RoutePlanner, spacing
from robochoc.vehicles.steps import Step, StepKind, length_along, on_line, steps_of

STILL_S = 3.0
"""The time for which vehicles may block each other before ways are planned anew, in seconds."""
_AHEAD_M = 4.0
"""A set point is so far ahead, or twice the distance, if that is more."""
_NEARER_M = 0.02
"""A way leads nearer to another vehicle if it does by more than this."""
_ALL_BUT = 0.999
Line = tuple[Point, Point]


class Traffic:
    """Keeps the vehicles of `fleet` apart. Its methods may be called by several threads."""

    def __init__(self, fleet: Fleet, clock: Callable[[], float] = time.monotonic) -> None:
        self._fleet = fleet
        self._clock = clock
        self._lock = threading.RLock()
        self._crafts = {name: Craft(name, rank) for rank, name in enumerate(fleet.vehicles)}
        self._planned_s = -math.inf
        self._ahead_m = max(_AHEAD_M, 2 * fleet.distance_m)
        self._keep_m = fleet.distance_m - 2 * fleet.tolerance_m - SLACK_M
        self._ends = False

    # What happens

    def see(self, name: str, place: Point | None, *, in_air: bool) -> None:
        """Record the place of a vehicle."""
        with self._lock:
            craft = self._crafts[name]
            craft.place = place or craft.place
            if place and not in_air and not craft.flies:
                craft.ground_m = place[2]
            came_down = craft.gone and craft.in_air and not in_air
            craft.in_air = in_air
            if came_down:
                self._replan()

    def fly(self, targets: Mapping[str, Target]) -> None:
        """Plan ways to `targets`. Raises `RouteError`, and all stay where they were bound for."""
        with self._lock:
            before = {name: self._crafts[name].target for name in targets}
            for name, target in targets.items():
                self._crafts[name].target = target
            try:
                self._plan()
            except RouteError:
                for name, earlier in before.items():
                    self._crafts[name].target = earlier
                raise

    def climbing(self, name: str) -> None:
        """Record that a vehicle takes off."""
        with self._lock:
            craft = self._crafts[name]
            craft.flies = True
            if craft.step:
                craft.setpoint, craft.released = craft.step.end, craft.done + 1

    def climbed(self, name: str) -> None:
        """Record that a vehicle has taken off."""
        with self._lock:
            craft = self._crafts[name]
            if craft.step and craft.step.kind is StepKind.CLIMB:
                craft.done += 1

    def landing(self, name: str) -> None:
        """Record that a vehicle lands where it is."""
        with self._lock:
            craft = self._crafts[name]
            craft.lands = True
            if craft.place:
                craft.setpoint = craft.ground(craft.place)

    def landed(self, name: str) -> None:
        """Record that a vehicle is on the ground."""
        with self._lock:
            craft = self._crafts[name]
            craft.flies = craft.lands = False
            craft.setpoint, craft.done = craft.place, len(craft.steps)
            if craft.target and not craft.target.lands and not self._ends:
                self._replan()  # it was sent elsewhere while it landed
            else:
                craft.target = None

    def lose(self, name: str) -> None:
        """Record that a vehicle is out of control: the others keep clear of it and of the space below it."""
        with self._lock:
            craft = self._crafts[name]
            if not craft.gone:
                craft.gone, craft.target = True, None
                self._replan()

    # What may be done

    def clearance(self, name: str) -> Clearance:
        """Return the clearance of a vehicle for its next step."""
        with self._lock:
            craft = self._crafts[name]
            self._advance(craft)
            step = craft.step
            if step is None or craft.place is None:
                return Clearance(craft.setpoint, rests=True)
            wanted = step.end if step.kind is not StepKind.FLY else self._ahead(craft)
            waits_for = self._waits_for(step)
            blocked = "" if waits_for else self._in_the_way(craft, wanted)
            if blocked:
                return self._stopped(craft, blocked)
            craft.blocked_s = None
            if waits_for:
                return Clearance(craft.setpoint, waits_for=waits_for)
            if step.kind is StepKind.FLY and self._is_due(craft, step):
                craft.setpoint = wanted
            return Clearance(craft.setpoint, climbs=step.kind is StepKind.CLIMB, lands=step.kind is StepKind.LAND)

    def _is_due(self, craft: Craft, step: Step) -> bool:
        """Return whether a vehicle is to get a new set point: the one before is near, or not on its line."""
        before, place = craft.setpoint, craft.place
        if before is None or place is None or math.dist(place, before) <= self._fleet.kind.rules.renews_m:
            return True
        end = craft.steps[max(craft.released - 1, craft.done)].end
        reached = length_along(step.begin, end, before)
        is_on = 0 <= reached <= math.dist(step.begin, end)
        return not is_on or math.dist(before, on_line(step.begin, end, reached)) > _NEARER_M

    def is_clear_below(self, name: str) -> bool:
        """Return whether no vehicle that flies by our command is right below a vehicle."""
        with self._lock:
            craft = self._crafts[name]
            if craft.place is None:
                return True
            column = craft.place, craft.ground(craft.place)
            others = (one for one in self._crafts.values() if one is not craft and one.flies and one.place)
            return all(self._apart(column, (one.place or one.rest,) * 2) >= self._keep_m for one in others)

    def _advance(self, craft: Craft) -> None:
        """Count the steps that a vehicle has done, and those that it may do."""
        while (step := craft.step) and step.kind is StepKind.FLY:
            if craft.done == craft.released:
                if self._waits_for(step):
                    return
                craft.released += 1
            if craft.place is None or not self._is_through(step, craft.place):
                break
            craft.done += 1
            if craft.done == len(craft.steps):  # near may be where it stops for another reason, as above its take-off
                craft.setpoint = step.end
        following = craft.steps[craft.done : craft.released]
        is_corner = bool(following) and following[-1].is_corner
        while craft.released < len(craft.steps) and not is_corner:
            step = craft.steps[craft.released]
            if step.kind is not StepKind.FLY or self._waits_for(step):
                return
            craft.released += 1
            is_corner = step.is_corner

    def _is_through(self, step: Step, place: Point) -> bool:
        near = self._fleet.tolerance_m
        length = math.dist(step.begin, step.end)
        if step.is_corner or not length:
            return math.dist(place, step.end) <= near
        reached = length_along(step.begin, step.end, place)
        return reached >= length and math.dist(place, on_line(step.begin, step.end, reached)) <= near

    def _ahead(self, craft: Craft) -> Point:
        """Return the point on its line that a vehicle may head for."""
        step, place = craft.step, craft.place
        if step is None or place is None or craft.released <= craft.done:
            return craft.rest
        end = craft.steps[craft.released - 1].end
        length = math.dist(step.begin, end)
        if not length:
            return end
        reached = max(length_along(step.begin, end, place), 0.0) + self._ahead_m
        return end if reached >= length else on_line(step.begin, end, reached)

    def _waits_for(self, step: Step) -> str:
        for name, count in step.needs.items():
            other = self._crafts[name]
            if other.done < count and not other.gone:
                return name
        return ""

    def _stopped(self, craft: Craft, blocked: str) -> Clearance:
        """Return that a vehicle stays where it is. If that lasts, plan anew."""
        now = self._clock()
        if craft.blocked_s is None:
            craft.blocked_s = now
            if craft.flies and craft.step and craft.step.kind is not StepKind.CLIMB:
                craft.setpoint = craft.place
        elif now - max(craft.blocked_s, self._planned_s) > STILL_S:
            self._replan()
        return Clearance(craft.setpoint, waits_for=blocked)

    def _in_the_way(self, craft: Craft, to: Point) -> str:
        """Return the name of a vehicle to which the way would lead too near, from where both are; empty if none."""
        if craft.place is None:
            return ""
        mine = craft.place, to
        reach = math.dist(*mine) + self._keep_m * self._fleet.downwash + _NEARER_M
        for other in self._crafts.values():
            if other is craft or other.place is None:
                continue
            for line, counts in self._lines(other, craft):
                if counts and math.dist(craft.place, line[0]) <= reach + math.dist(*line):
                    now_m = self._apart((craft.place, craft.place), line)
                    if self._apart(mine, line) < min(self._keep_m, now_m - _NEARER_M):
                        return other.name
        return ""

    def _lines(self, other: Craft, craft: Craft) -> Iterator[tuple[Line, bool]]:
        """Yield where another vehicle may be, and whether `craft` has to mind it."""
        place = other.place or other.rest
        yield (place, place), True
        if other.in_air and (other.gone or other.lands):
            yield (place, other.ground(place)), True
        elif other.flies and other.blocked_s is None and other.setpoint:
            strays = self._strays(other) or self._strays(craft)
            yield (place, other.setpoint), strays and other.rank < craft.rank

    def _strays(self, craft: Craft) -> bool:
        """Return whether a vehicle is off its way."""
        if craft.place is None or craft.setpoint is None:
            return False
        begin = craft.step.begin if craft.step else craft.setpoint
        reached = max(0.0, min(length_along(begin, craft.setpoint, craft.place), math.dist(begin, craft.setpoint)))
        return math.dist(craft.place, on_line(begin, craft.setpoint, reached)) > self._fleet.tolerance_m

    def _apart(self, first: Line, second: Line) -> float:
        flat = [squashed(np.array(line), self._fleet.downwash) for line in (first, second)]
        return float(line_distances((flat[0][0], flat[0][1]), (flat[1][0], flat[1][1])))

    # Plans

    def _replan(self) -> None:
        """Plan anew from where all are. Where that is not possible, those who fly stay where they are."""
        self._planned_s = self._clock()
        try:
            if self._ends:
                self.bring_down()
            else:
                self._plan()
        except RouteError:
            return

    def _plan(self) -> None:
        """Plan ways from where all are bound for. Raises `RouteError`."""
        self._planned_s = self._clock()
        crafts = [one for one in self._crafts.values() if one.place]
        standing = {one.name: self._standing(one) for one in crafts if not self._moves(one)}
        moving = [one for one in crafts if one.name not in standing]
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
        self._take(steps_of([*first, *legs], lifted | {*climbing}, landing, distance_m, self._fleet.downwash))
        for name in lifted:
            self._crafts[name].released = 1

    def _take(self, steps: Mapping[str, list[Step]]) -> None:
        for craft in self._crafts.values():
            if craft.gone or not craft.lands:
                craft.steps, craft.done, craft.released = steps.get(craft.name, []), 0, 0
                craft.blocked_s = None

    def _moves(self, craft: Craft) -> bool:
        """Return whether a vehicle has a part in a plan. Others stay, or land by themselves."""
        if craft.gone or craft.lands:
            return False
        if craft.flies:
            return True
        return craft.target is not None and (craft.in_air or not craft.target.lands)

    def _standing(self, craft: Craft) -> Point:
        at = craft.place or craft.rest
        return craft.ground(at) if craft.in_air and (craft.gone or craft.lands) else at

    def _goals(self, moving: list[Craft]) -> dict[str, Point]:
        """Return where vehicles are to go: not below one that comes down by itself, as long as it does."""
        found = {one.name: self._goal(one) for one in moving}
        falling = [one.place for one in self._crafts.values() if one.gone and one.in_air and one.place]
        for name, goal in found.items():
            above = [at for at in falling if math.dist(at[:2], goal[:2]) < self._fleet.distance_m and at[2] >= goal[2]]
            if above:
                others = [at for other, at in found.items() if other != name]
                found[name] = (
                    RoutePlanner(self._fleet, {}, self._fleet.distance_m).spot(goal, [*falling, *others]) or goal
                )
        return found

    def _goal(self, craft: Craft) -> Point:
        target = craft.target
        if target is None:
            return craft.rest
        if target.lands and not self._fleet.fence.holds_above(target.at):
            return craft.ground(craft.rest)
        return target.at

    def _present_distance(self, points: Iterable[Point]) -> float:
        """Return the distance to plan with: less than in the fleet file where vehicles are nearer already."""
        least = spacing([*points], self._fleet.downwash)
        wanted = self._fleet.distance_m
        return wanted if least >= wanted else max(least * _ALL_BUT, wanted / 2)

    def bring_down(self) -> None:
        """Plan how all that fly land: where they are, the lowest first. One that is above another's place gives way."""
        with self._lock:
            self._ends = True
            flying = [
                one for one in self._crafts.values() if one.flies and not one.gone and not one.lands and one.place
            ]
            flying.sort(key=lambda one: one.rest[2])
            for one in flying:
                one.target, one.setpoint = None, one.place
            standing = {
                one.name: self._standing(one) for one in self._crafts.values() if one.place and one not in flying
            }
            rests = {one.name: one.rest for one in flying}
            grounds = {one.name: one.ground(one.rest)[2] for one in flying}
            distance_m = self._present_distance([*rests.values(), *standing.values()])
            ways = RoutePlanner(self._fleet, standing, distance_m)
            try:
                legs = ways.descents(rests, grounds)
                steps = steps_of(legs, (), {one.name for one in flying}, distance_m, self._fleet.downwash)
            except RouteError:
                steps = {one.name: [Step(StepKind.LAND, one.rest, one.ground(one.rest), True)] for one in flying}
            self._take(steps)
            self._planned_s = self._clock()
