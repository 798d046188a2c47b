"""Derives changes of the problem from robots' reports: "read the robot situation" in the paper (Section 4.2).

If there is an obstacle, values are removed; they are added again when the obstacle is gone. If a drone can no longer
fly, its robot is removed from the team. The team itself is not modified.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import product
from typing import assert_never

from robochoc.flight.crafts import Craft, crafts_of
from robochoc.flight.layout import Point
from robochoc.flight.mission import Drone
from robochoc.flight.reports import (
    BatteryReport,
    BlockedReport,
    ClearedReport,
    DoneReport,
    OutOfOrderReport,
    PoseReport,
    Report,
)
from robochoc.formats.diagnostics import on_one_line, shortened
from robochoc.model.expression import Expression, Name, names
from robochoc.model.problem import AddValue, Assignment, Change, Domain, RemoveAgent, RemoveValue, Robot, Team, Topic
from robochoc.model.waypoints import coordinate
from robochoc.robots.fixed_decision import changes_of_fixed
from robochoc.system.lazy_dataclass import dataclass

_Cell = tuple[int, int, int]
_A_HAIR_MORE = 1 + 1e-9
"""A factor on distances, since a point just outside a cube may still be near because of rounding."""
BATTERY = 0.2
"""The default charge below which a drone is out of order."""
WITHIN = 0.5
"""The distance, in units, within which an obstacle blocks places."""
VALUES_MAX = 10_000
"""The size of the largest domain whose values are tried one by one."""
OBSTACLES_MAX = 10_000
"""The maximum number of stored obstacles."""
NOTES_MAX = 20
"""The maximum number of notes about reports that change nothing."""
FLIES, LIES = 0.5, 0.25
"""Heights above a drone's home, in units: above the first it is in the air, below the second on the ground."""
LIES_S, LIES_TIMES = 1.0, 3
"""The time in seconds, and the number of reports, on the ground after which a drone that has flown is out of order."""
_HAIR = 1e-6


@dataclass
class _PoseHistory:
    """The state of a drone, derived from its poses."""

    flew: bool = False
    lies_since: float = 0.0
    times: int = 0


class Situation:
    """Tracks obstacles and the state of drones.

    A drone is also out of order if its poses show that it has fallen: it was in the air (`FLIES`), and has now been on
    the ground (`LIES`) for at least `LIES_TIMES` reports over at least `LIES_S` seconds, although its robot is in the
    team and so should not land. The drone's distance from its goal is not used, since the drone may be on its way, wait
    for others to pass, or hover while the team decides.

    Args:
        drones: All drones that ever fly.
        scale: The length of a unit of the problem, in metres.
        battery: The charge, 0 to 1, below which a drone is out of order.
    """

    notes: list[str]
    """Sentences about reports that could not be used."""

    def __init__(self, drones: Sequence[Drone], scale: float, battery: float = BATTERY) -> None:
        namesakes = Counter(drone.name for drone in drones)
        self._drones = {drone.name: drone for drone in drones if namesakes[drone.name] == 1}
        self._homes = {(drone.robot, drone.name): _in_units(drone.home, scale) for drone in drones}
        self._scale = scale
        self._battery = battery
        self._seen: dict[str, _PoseHistory] = {}
        self._obstacles = PointIndex()
        self._removed: dict[tuple[str, int], set[Point]] = {}
        self.notes = []

    def changes(self, team: Team, report: Report) -> tuple[Change, ...]:
        """Return the changes to `team` caused by `report`; none if the drone's robot is not in the team."""
        drone = self._drones.get(report.drone)
        if drone is None or drone.robot not in team or isinstance(report, DoneReport):  # `done` needs the decision
            return ()
        match report:
            case BlockedReport(place=place):
                return self._blocked(team, _in_units(place, self._scale))
            case ClearedReport(place=place):
                return self._cleared(team, _in_units(place, self._scale))
            case OutOfOrderReport():
                return (RemoveAgent(drone.robot),)
            case BatteryReport(level=level):
                return (RemoveAgent(drone.robot),) if 0 <= level < self._battery else ()
            case PoseReport():
                return (RemoveAgent(drone.robot),) if self._is_down(drone, report) else ()
            case never:
                assert_never(never)

    def done(self, team: Team, report: DoneReport, values: Assignment) -> tuple[Change, ...]:
        """Return the changes by which a task remains done, if its robot leaves, too.

        The variable of the task keeps its value in `values`, the current decision. Values of other variables that a
        hard constraint forbids together with it are removed, such as doing the same task.
        """
        drone = self._drones.get(report.drone)
        name = report.task if report.task in values else f"{drone.robot if drone else ''}.{report.task}"
        if drone is None or team.owner.get(name) != drone.robot or not values.get(name):  # 0: not its task
            what = f"{shortened(report.drone)} reports a task as done that it does not have: {shortened(report.task)}"
            self._note(on_one_line(what))
            return ()
        return tuple(changes_of_fixed(team, name, values[name]))

    # Obstacles

    def _blocked(self, team: Team, place: Point) -> tuple[Change, ...]:
        if self._obstacles.any_near(place, _HAIR):
            return ()
        if len(self._obstacles) >= OBSTACLES_MAX:
            self._note(f"more than {OBSTACLES_MAX:,} places are blocked: further obstacles are ignored")
            return ()
        self._obstacles.add(place)
        noted = len(self.notes)
        found = tuple(self._removed_values(team, place))
        if not found and len(self.notes) == noted:
            self._note(f"no drone is ever sent to the obstacle at {_point_text(place)}: it changes nothing")
        return found

    def _cleared(self, team: Team, place: Point) -> tuple[Change, ...]:
        """Return the changes that add values again which no other obstacle blocks."""
        if not self._obstacles.remove_near(place, WITHIN + _HAIR):
            return ()
        free = [
            value
            for value, places in self._removed.items()
            if not any(self._obstacles.any_near(one, WITHIN + _HAIR) for one in places)
        ]
        for value in free:
            del self._removed[value]
        return tuple(
            AddValue(variable, value)
            for variable, value in free
            if variable in team.owner and value not in team.variables[variable].domain
        )

    def _removed_values(self, team: Team, place: Point) -> Iterator[RemoveValue]:
        """Yield, and record, the removal of values that would send a drone of `team` to `place`."""
        for robot in team.robots:
            gone = set()
            for number, craft in enumerate(crafts_of(robot, {})):
                for variable, value, there in self._values_at(robot, number, craft, place):
                    self._removed.setdefault((variable, value), set()).add(there)
                    gone.add((variable, value))
            yield from (RemoveValue(variable, value) for variable, value in sorted(gone))

    def _values_at(self, robot: Robot, number: int, craft: Craft, place: Point) -> Iterator[tuple[str, int, Point]]:
        """Yield the variable and each value that would send a drone near `place`, with the drone's exact place."""
        if not _may_reach(craft, self._homes.get((robot.name, craft.name)), place):
            return
        if len(craft.decided_by) != 1:
            by = " and ".join(craft.decided_by) or "no variable"
            self._note_unusable(craft, place, f"its place depends on {by}, so no single value can be removed")
            return
        variable = craft.decided_by[0]
        domain = next((own.domain for own in robot.variables if own.name == variable), None)
        values = _candidates(craft, variable, domain, place) if domain else ()
        if values is None:
            self._note_unusable(craft, place, f"{variable} has too many values to check (more than {VALUES_MAX:,})")
            return
        for value in values:
            there = self._place_of(crafts_of(robot, {variable: value})[number])
            if there is not None and _is_near(there, place):
                yield variable, value, there

    def _place_of(self, craft: Craft) -> Point | None:
        """Return the place to which a craft flies, in units. A craft without a cell flies above its home."""
        home = self._homes.get((craft.robot, craft.name))
        across = craft.cell or (home[:2] if home else None)
        return None if craft.level is None or across is None else (*across, craft.level)

    def _note_unusable(self, craft: Craft, place: Point, why: str) -> None:
        self._note(
            f"the obstacle at {_point_text(place)} may be in the way of {craft.name}, and changes nothing: {why}"
        )

    def _note(self, text: str) -> None:
        if text not in self.notes and len(self.notes) < NOTES_MAX:
            self.notes.append(text)

    # Poses

    def _is_down(self, drone: Drone, pose: PoseReport) -> bool:
        """Return whether the drone has fallen; see `Situation`."""
        seen = self._seen.setdefault(drone.name, _PoseHistory())
        height = (pose.place[2] - drone.home[2]) / self._scale
        if height >= FLIES:
            seen.flew = True
        if height >= LIES or not seen.flew:
            seen.times = 0
            return False
        if not seen.times:
            seen.lies_since = pose.at_s
        seen.times += 1
        down = seen.times >= LIES_TIMES and pose.at_s - seen.lies_since >= LIES_S
        if down:
            self._seen[drone.name] = _PoseHistory()
        return down


def _may_reach(craft: Craft, home: Point | None, place: Point) -> bool:
    """Return whether the fixed coordinates of a craft's place are near `place`."""
    topic = craft.topic
    across: list[float | None] = [None, None]
    if topic and topic.x is not None and topic.y is not None:
        across = [_fixed(topic.x, topic), _fixed(topic.y, topic)]
    elif craft.cell or home:
        across = [*(craft.cell or (home or ())[:2])]
    fixed = [*across, _fixed(topic.z, topic) if topic else None]
    return all(at is None or abs(at - there) <= WITHIN + _HAIR for at, there in zip(fixed, place, strict=True))


def _candidates(craft: Craft, variable: str, domain: Domain, place: Point) -> Iterable[int] | None:
    """Return the values in `domain` that might send the craft near `place`; None if there are too many to try."""
    topic = craft.topic
    given: list[Expression | None] = [topic.x, topic.y, topic.z] if topic else [None, None, None]
    if given[2] is None:
        given[2] = Name(variable)
    for expression, at in zip(given, place, strict=True):
        if expression == Name(variable) and not domain.real:
            around = range(math.ceil(at - WITHIN - _HAIR), math.floor(at + WITHIN + _HAIR) + 1)
            return [value for value in around if value in domain]
    return domain if sum(len(part) for part in domain.ranges) <= VALUES_MAX else None


def _fixed(expression: Expression | None, topic: Topic) -> float | None:
    """Return the coordinate `expression` of a topic; None if it contains a variable, or is undefined."""
    return None if expression is None or names(expression) else coordinate(expression, topic.places, {})


def _in_units(place: Point, scale: float) -> Point:
    x, y, z = place
    return x / scale, y / scale, z / scale


def _is_near(one: Point, other: Point) -> bool:
    return math.dist(one, other) <= WITHIN + _HAIR


def _point_text(place: Point) -> str:
    return ", ".join(f"{at:g}" for at in place)


class PointIndex:
    """Finds near points quickly, by grouping points into unit cubes.

    The same point may be added several times. Only cubes that contain points use memory.
    """

    def __init__(self) -> None:
        self._cubes: dict[_Cell, list[Point]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def cubes(self) -> int:
        """The number of cubes that contain points."""
        return len(self._cubes)

    def add(self, place: Point) -> None:
        """Add a point."""
        x, y, z = map(math.floor, place)
        self._cubes.setdefault((x, y, z), []).append(place)
        self._count += 1

    def any_near(self, place: Point, within: float) -> bool:
        """Return whether a point is within the distance `within` of `place`."""
        return any(
            math.dist(place, other) <= within for cell in self._around(place, within) for other in self._cubes[cell]
        )

    def remove_near(self, place: Point, within: float) -> bool:
        """Remove the points within the distance `within` of `place`; return whether there were any."""
        before = self._count
        for cell in self._around(place, within):
            points = self._cubes.pop(cell)
            far = [other for other in points if math.dist(place, other) > within]
            self._count -= len(points) - len(far)
            if far:
                self._cubes[cell] = far
        return self._count < before

    def _around(self, place: Point, within: float) -> Iterator[_Cell]:
        """Yield the cubes that contain points and are within the distance `within` of `place`."""
        reach = within * _A_HAIR_MORE
        spans = (range(math.floor(at - reach), math.floor(at + reach) + 1) for at in place)
        for x, y, z in product(*spans):
            if (x, y, z) in self._cubes:
                yield x, y, z
