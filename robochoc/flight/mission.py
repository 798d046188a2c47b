"""The mission: the goals of a team's drones, epoch by epoch, derived from the team's decisions.

In the paper, drones stand on the ground at first (Figure 5), and are at the places of the solution in the end (Figure
6). Epochs in between may send them elsewhere. Lengths are in metres, in a frame whose z axis points up. One unit of a
topic's coordinates is `scale` metres.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robochoc.flight.crafts import Craft, craft_of_variable, crafts_of, possible_crafts, row_and_column
from robochoc.flight.layout import BoxAxis, MissionLayout, Point, layout_of
from robochoc.maps.ground_map import ALL_SIDES, GroundMap
from robochoc.maps.walls import Walls, walls_of
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.priorities import natural_key
from robochoc.model.problem import AddAgent, Assignment, Robot, Team, Topic
from robochoc.system.lazy_dataclass import dataclass

_Array = npt.NDArray[np.float64]


UNIT_M = 1.0
"""The default length of a unit of coordinates, a little more than the width of a drone."""
VAST_M = 40.0
"""The default maximum length of a box."""
_DENSE_M = 0.025
"""The minimum length of a unit, since neighbours need some space; less if the box would be longer than `_FLOWN_M`."""
_FLOWN_M = 1_000.0
_FAR_BELOW = 40
"""Possible levels more than this far below all decided levels are not shown."""
_BLOCK_HIGH = 0.6
"""The height of a blocked cell's point above the ground, in cells. Drones at the lowest level must climb over it."""


@dataclass(frozen=True)
class Drone:
    """A drone of a mission, which starts from its `home`. Drones of the same `group` (a row) have the same colour."""

    name: str
    robot: str
    """The robot that decides about the drone; empty if only a variable is known."""
    topic: Topic | None
    """The topic of its waypoints."""
    home: Point
    group: int


class GoalStop(NamedTuple):
    """A place where a robot does a task, and the variable of the task."""

    at: Point
    task: str


@dataclass(frozen=True)
class Goal:
    """The goal of a drone: a place in the air, or on the ground if it `lands`."""

    at: Point
    lands: bool = False
    stops: tuple[GoalStop, ...] = ()
    """All places of a robot that does tasks one after the other, the first of which is `at`. Simulated flights ignore
    the others.
    """


@dataclass(frozen=True)
class Leg:
    """The drones' goals in an epoch, by drone number. Drones without a goal stay in place."""

    opened_by: str
    verdict: Verdict
    goals: Mapping[int, Goal]
    cost: Cost | None = field(default=None, compare=False)
    """The cost of the decision, which has no effect on the drones. None: unknown, or no cost."""


@dataclass(frozen=True)
class MissionBlock:
    """A blocked cell of the map. From leg `leg` on, routes keep their distance from the point `at`."""

    at: Point
    leg: int = 0
    is_cube: bool = False
    """True for a cell of a three-dimensional map with the centre `at`. Routes avoid only the map's voxels (`walls`)."""
    sides: int = ALL_SIDES
    """The visible sides of a cube, as in `Volume.sides`."""


@dataclass(frozen=True)
class Mission:
    """All legs of a run, and the drones that fly them. `axes` are the axes of the box around all places.

    With a map of the ground, drones first rise vertically (`rises`), and avoid `blocks` or `walls`. With a
    three-dimensional map (`has_volume`), drones start in the air.
    """

    team: str
    drones: tuple[Drone, ...]
    legs: tuple[Leg, ...]
    axes: tuple[BoxAxis, BoxAxis, BoxAxis]
    scale: float
    rises: bool = False
    blocks: tuple[MissionBlock, ...] = ()
    has_volume: bool = False
    walls: Walls | None = None

    @property
    def ground(self) -> float:
        """The height of the ground."""
        return self.axes[2].value(self.axes[2].ground) * self.scale


class MissionBuilder:
    """Builds the mission of a run epoch by epoch.

    Args:
        robots: All robots that ever take part, including those that join later.
        first: The first assignment.
        names: The names of variables and robots, if nothing else is known.
        others: Crafts at other times, which are also inside the box.
        leaving: The number of drones that will leave. None: all drones may leave.
        scale: The length of a unit, in metres. Default: the map's scale, or `UNIT_M`, or less if the box would be too
            large and no place depends on real variables.
        ground: A map of the ground. Robots without a waypoint in their files then stay in place. If the map has walls,
            withdrawn drones return to their homes.
        exact: True for places as in the topics, even if drones would collide there; only for drones that are not
            simulated.

    Raises:
        ValueError: The map has walls, and `scale` differs from its scale.
    """

    def __init__(
        self,
        robots: Iterable[Robot],
        first: Assignment,
        *,
        names: Iterable[str] = (),
        others: Iterable[Craft] = (),
        leaving: int | None = None,
        scale: float | None = None,
        ground: GroundMap | None = None,
        exact: bool = False,
    ) -> None:
        self._ground = ground
        self._exact = exact
        self.walls = walls_of(ground)
        check_scale(scale, ground)
        self._robots = {robot.name: robot for robot in robots}
        self._names = [*names]
        crafts = sorted(self._crafts(first), key=lambda craft: (natural_key(craft.name), craft.name))
        self._places = {(craft.robot, craft.name): number for number, craft in enumerate(crafts)}
        self._crafts_in_order = crafts
        self.layout: MissionLayout = layout_of(crafts, others, ground)
        given = ground.scale if scale is None and ground else scale
        usual = UNIT_M if any(craft.is_exact for craft in crafts) else _scale(self.layout.axes)
        self.scale = usual if given is None else given
        if ground and ground.scale is not None:
            self.layout = self.layout.in_metres(self.scale)
        self._edge = self.layout.edge(len(crafts) if leaving is None else leaving)
        self._landing_points: dict[int, Point] = {}
        self._seen: set[str] = set()
        self.drones = tuple(map(self._drone, crafts, self.layout.homes))

    def leg(self, epoch: EpochOutcome, withdrawn: Iterable[str] = ()) -> Leg:
        """Return the leg of the next `epoch`. A drone whose robot has left lands at the edge."""
        values: Assignment = {} if epoch.verdict == Verdict.NO_SOLUTION else epoch.assignment
        here = {*(epoch.robots if self._robots else values or self._seen)} - {*withdrawn}
        gone = (self._seen | {*withdrawn}) - here
        self._seen |= here
        crafts = [*self._crafts_in_order]
        for craft in self._crafts(values, here):
            crafts[self._places[craft.robot, craft.name]] = craft
        places = self.layout.places(
            [craft if _owner(craft) in here else replace(craft, level=None) for craft in crafts], exact=self._exact
        )
        goals: dict[int, Goal] = {}
        for number, (craft, place) in enumerate(zip(crafts, places, strict=True)):
            if place is not None:
                goals[number] = Goal(self._exact_metres(craft) or self._metres(place))
            elif _owner(craft) in gone:
                goals[number] = Goal(self._metres(self._landing_point(number)), lands=True)
        return Leg(epoch.opened_by, epoch.verdict, goals, epoch.cost)

    def mission(self, team: str, legs: Iterable[Leg]) -> Mission:
        """Return the mission with these legs."""
        blocks = tuple(self._blocks())
        ground = self._ground
        return Mission(
            team,
            self.drones,
            tuple(legs),
            self.layout.axes,
            self.scale,
            rises=self.rises,
            blocks=blocks,
            has_volume=ground is not None and ground.volume is not None,
            walls=self.walls,
        )

    @property
    def ground(self) -> float | None:
        """The height of the ground on a three-dimensional map, where drones start in the air; None on other maps."""
        levels = self.layout.axes[2]
        has_volume = self._ground is not None and self._ground.volume is not None
        return levels.value(levels.ground) * self.scale if has_volume else None

    @property
    def rises(self) -> bool:
        """True if drones take off vertically, since their places are known from a map."""
        return self._ground is not None

    def _blocks(self) -> Iterator[MissionBlock]:
        if self._ground is None:
            return
        rows, columns, levels = self.layout.axes
        for cell in self._ground.blocked:
            x, y = self._ground.x_and_y(cell.x, cell.y)
            spot = rows.at(x), columns.at(y), self.layout.ground + _BLOCK_HIGH
            yield MissionBlock(self._metres(spot), cell.epoch)
        volume = self._ground.volume
        if volume is None:
            return
        all_sides = volume.sides or (ALL_SIDES,) * len(volume.blocked)
        for (column, row, level), sides in zip(volume.blocked, all_sides, strict=True):
            x, y = self._ground.x_and_y(column, row)
            at = self._metres((rows.at(x), columns.at(y), levels.at(volume.z(level))))
            yield MissionBlock(at, is_cube=True, sides=sides)

    def _crafts(self, values: Assignment, here: Container[str] | None = None) -> Iterator[Craft]:
        """Yield the crafts of all robots, or of the robots in `here`."""
        for name, robot in self._robots.items():
            if here is None or name in here:
                for craft in crafts_of(robot, values):
                    stays = self._ground is not None and craft.topic is None
                    yield replace(craft, level=None) if stays else craft
        for name in self._names:
            if here is None or name in here:
                yield craft_of_variable(name, values) if name in values else Craft(name, row_and_column(name))

    def _drone(self, craft: Craft, home: Point) -> Drone:
        row = craft.cell[0] if craft.cell and not self._ground else self.layout.axes[0].value(home[0])
        return Drone(craft.name, craft.robot, craft.topic, self._metres(home), round(row))

    def _landing_point(self, number: int) -> Point:
        if number not in self._landing_points:
            self._landing_points[number] = (
                self.layout.homes[number] if self.walls else self._on_ground(next(self._edge))
            )
        return self._landing_points[number]

    def _on_ground(self, point: Point) -> Point:
        """Return a landing point at the height 0 if places are published exactly, and none is below 0."""
        levels = self.layout.axes[2]
        if not self._exact or self._ground is not None or levels.first < 0:
            return point
        return point[0], point[1], levels.at(0)

    def _exact_metres(self, craft: Craft) -> Point | None:
        """Return the place of a craft over real variables, without rounding to the axes; None for other crafts."""
        if not craft.is_exact or craft.cell is None or craft.level is None:
            return None
        return craft.cell[0] * self.scale, craft.cell[1] * self.scale, craft.level * self.scale

    def _metres(self, point: Point) -> Point:
        x, y, z = (axis.value(cell) * self.scale for axis, cell in zip(self.layout.axes, point, strict=True))
        return x, y, z


def check_scale(scale: float | None, ground: GroundMap | None) -> None:
    """Raise `ValueError` if a map has walls, and `scale` differs from its scale."""
    walled = ground and (ground.walls or (ground.volume and ground.volume.walls))
    if ground and walled and scale not in {None, ground.scale}:
        raise ValueError(
            f"the scale is {scale:g} m, but the map with walls has the scale {ground.scale:g} m: omit the scale"
        )


def mission_of(
    outcome: Outcome,
    team: Team | None = None,
    scale: float | None = None,
    ground: GroundMap | None = None,
    *,
    exact: bool = False,
) -> Mission:
    """Return the mission of `outcome`.

    Args:
        outcome: The outcome of a run.
        team: The team as defined in its files, before its scenario. Without a team, only names are known.
        scale: The length of a unit, in metres; see `MissionBuilder`.
        ground: A map of the ground, if there is one.
        exact: True for places as in the topics; see `MissionBuilder`.

    Raises:
        ValueError: See `MissionBuilder`.
    """
    epochs = outcome.epochs or (
        EpochOutcome(
            outcome.verdict, robots=team.order if team else (), assignment=outcome.assignment, cost=outcome.cost
        ),
    )
    decided = [epoch.assignment for epoch in epochs if epoch.verdict != Verdict.NO_SOLUTION]
    first: dict[str, int] = {}
    for values in decided:
        first = {**values, **first}
    if team is not None:
        robots, names = all_robots(team), []
        sent = robots if ground is None else [robot for robot in robots if robot.topics]
        others = [craft for values in decided for robot in sent for craft in crafts_of(robot, values)]
        others += _lowest(sent, others)
    else:
        robots, names = [], [*first, *outcome.withdrawn]
        others = [craft_of_variable(name, values) for values in decided for name in values]
    builder = MissionBuilder(
        robots,
        first,
        names=names,
        others=others,
        leaving=_leaving(epochs, outcome),
        scale=scale,
        ground=ground,
        exact=exact,
    )
    legs = [builder.leg(epoch) for epoch in epochs[:-1]]
    return builder.mission(outcome.team, [*legs, builder.leg(epochs[-1], outcome.withdrawn)])


def all_robots(team: Team) -> list[Robot]:
    """Return all robots that ever take part: the robots in the team, and those added by its scenario."""
    added = [change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent)]
    return [*{robot.name: robot for robot in (*team.robots, *added)}.values()]


def _lowest(robots: Iterable[Robot], decided: Iterable[Craft]) -> list[Craft]:
    """Return the lowest possible craft, unless it is far below all `decided`, so that all runs have the same ground."""
    possible = [craft for robot in robots for craft in possible_crafts(robot) if craft.level is not None]
    if not possible:
        return []
    lowest = min(possible, key=lambda craft: craft.level or 0)
    highest = max((craft.level for craft in decided if craft.level is not None), default=0)
    return [Craft("", level=lowest.level)] if highest - (lowest.level or 0) < _FAR_BELOW else []


def _leaving(epochs: Sequence[EpochOutcome], outcome: Outcome) -> int:
    """Return an estimate of the number of drones that leave before the end; a robot may have several drones."""
    stay = {*epochs[-1].robots} - {*outcome.withdrawn}
    return len({*outcome.withdrawn, *(name for epoch in epochs for name in epoch.robots)} - stay)


def _owner(craft: Craft) -> str:
    """Return the name of a craft's robot, or the name of the craft if its robot is not known."""
    return craft.robot or craft.name


def _scale(axes: Sequence[BoxAxis]) -> float:
    longest = max(1, *(axis.last - axis.first for axis in axes))
    dense = _DENSE_M if longest * _DENSE_M <= _FLOWN_M else 0.0
    return min(UNIT_M, max(VAST_M / longest, dense))


def in_cells(mission: Mission, metres: _Array) -> _Array:
    """Convert points (..., 3) from metres to cells of the mission's box."""
    parts = [_cells(axis, metres[..., number] / mission.scale) for number, axis in enumerate(mission.axes)]
    return np.stack(parts, axis=-1)


def _cells(axis: BoxAxis, values: _Array) -> _Array:
    """Return `BoxAxis.at` for an array of values."""
    span = axis.last - axis.first
    return axis.low + (values - axis.first) * ((axis.high - axis.low) / span if span else 1.0)
