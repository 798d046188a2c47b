"""The mission: what a team's decisions ask of its drones, epoch by epoch.

The paper's drones stand on the ground in the beginning (Figure 5), and are at the places of the solution in the end
(Figure 6). In between, an epoch may have sent them elsewhere. Lengths are in metres, in a frame whose z is up. One unit
of a topic's coordinates is `scale` metres.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from robochoc.flight.crafts import Craft, craft_of_variable, crafts_of, possible_crafts, row_and_column
from robochoc.flight.layout import Axis, Layout, Point, layout_of
from robochoc.maps.ground_map import ALL_SIDES, GroundMap
from robochoc.maps.walls import Walls, walls_of
from robochoc.model.cost_units import Cost
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.priorities import natural_key
from robochoc.model.problem import AddAgent, Assignment, Robot, Team, Topic

_Array = npt.NDArray[np.float64]


UNIT_M = 1.0
"""The default length of a unit of coordinates: drones are a little narrower."""
VAST_M = 40.0
"""By default, a box is no longer than that."""
_DENSE_M = 0.025
"""A unit is no shorter, unless the box would be longer than `_FLOWN_M`: neighbours need some room."""
_FLOWN_M = 1_000.0
_FAR_BELOW = 40
"""Levels below all decided ones that are not shown."""
_BLOCK_HIGH = 0.6
"""The height of a blocked cell's point above the ground, in cells: a drone at the lowest level has to go over it."""


@dataclass(frozen=True)
class Drone:
    """A drone of a mission. It stands at `home` in the beginning. Drones of a `group`, a row, have the same colour."""

    name: str
    robot: str
    """The robot that decides about it; empty where only a variable is known."""
    topic: Topic | None
    """The topic of its waypoints."""
    home: Point
    group: int


@dataclass(frozen=True)
class Goal:
    """The goal of a drone: a place in the air, or on the ground if it `lands`."""

    at: Point
    lands: bool = False


@dataclass(frozen=True)
class Leg:
    """The goals of the drones in an epoch, by drone number. A drone without a goal stays where it is."""

    opened_by: str
    verdict: Verdict
    goals: Mapping[int, Goal]
    cost: Cost | None = field(default=None, compare=False)
    """The cost of the decision, which changes nothing for drones. None: it is not known, or there is none."""


@dataclass(frozen=True)
class Block:
    """A blocked cell of the map: routes keep their distance from the point `at`, from a leg on."""

    at: Point
    leg: int = 0
    is_cube: bool = False
    """True for a cell of a three-dimensional map, with its middle at `at`. Routes keep from its voxels (`walls`)."""
    sides: int = ALL_SIDES
    """From which sides a cube is seen, as `Volume.sides` has them."""


@dataclass(frozen=True)
class Mission:
    """All legs of a run, and the drones that fly them. `axes` are the sides of the box around all places.

    With a map of the ground, drones rise from where they stand before they fly elsewhere (`rises`), and there are
    `blocks` to be avoided, or `walls`. With a three-dimensional one (`has_volume`), they are in the air in the
    beginning.
    """

    team: str
    drones: tuple[Drone, ...]
    legs: tuple[Leg, ...]
    axes: tuple[Axis, Axis, Axis]
    scale: float
    rises: bool = False
    blocks: tuple[Block, ...] = ()
    has_volume: bool = False
    walls: Walls | None = None

    @property
    def ground(self) -> float:
        """The height of the ground."""
        return self.axes[2].value(self.axes[2].ground) * self.scale


class MissionBuilder:
    """Builds the mission of a run whose epochs come one after the other.

    Args:
        robots: All robots that ever take part, those that join later among them.
        first: Where they go first.
        names: Names of variables and of robots, where nothing else is known.
        others: Crafts at other times; the box holds them, too.
        leaving: How many drones will leave; None: any may.
        scale: Metres a unit; by default the map's, or else `UNIT_M`, or less where the box would be vast.
        ground: A map of the ground. Robots whose files name no waypoint then stay where they stand. Where it has walls,
            drones that withdraw go back to where they have been.

    Raises:
        ValueError: The map has walls, and another `scale` is asked for.
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
    ) -> None:
        self._ground = ground
        self.walls = walls_of(ground)
        check_scale(scale, ground)
        self._robots = {robot.name: robot for robot in robots}
        self._names = [*names]
        crafts = sorted(self._crafts(first), key=lambda craft: (natural_key(craft.name), craft.name))
        self._places = {(craft.robot, craft.name): number for number, craft in enumerate(crafts)}
        self._crafts_in_order = crafts
        self.layout: Layout = layout_of(crafts, others, ground)
        given = ground.scale if scale is None and ground else scale
        self.scale = _scale(self.layout.axes) if given is None else given
        if ground and ground.scale is not None:
            self.layout = self.layout.in_metres(self.scale)
        self._edge = self.layout.edge(len(crafts) if leaving is None else leaving)
        self._aside: dict[int, Point] = {}
        self._seen: set[str] = set()
        self.drones = tuple(map(self._drone, crafts, self.layout.homes))

    def leg(self, epoch: EpochOutcome, withdrawn: Iterable[str] = ()) -> Leg:
        """Return what `epoch`, the next one, asks of the drones. A drone whose robot has left lands at the edge."""
        values: Assignment = {} if epoch.verdict == Verdict.NO_SOLUTION else epoch.assignment
        here = {*(epoch.robots if self._robots else values or self._seen)} - {*withdrawn}
        gone = (self._seen | {*withdrawn}) - here
        self._seen |= here
        crafts = [*self._crafts_in_order]
        for craft in self._crafts(values, here):
            crafts[self._places[craft.robot, craft.name]] = craft
        places = self.layout.places(
            [craft if _owner(craft) in here else replace(craft, level=None) for craft in crafts]
        )
        goals: dict[int, Goal] = {}
        for number, (craft, place) in enumerate(zip(crafts, places, strict=True)):
            if place is not None:
                goals[number] = Goal(self._metres(place))
            elif _owner(craft) in gone:
                goals[number] = Goal(self._metres(self._spot(number)), lands=True)
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
        """The height of the ground on a three-dimensional map, where drones are in the air in the beginning."""
        levels = self.layout.axes[2]
        has_volume = self._ground is not None and self._ground.volume is not None
        return levels.value(levels.ground) * self.scale if has_volume else None

    @property
    def rises(self) -> bool:
        """Return whether drones leave the ground straight up: where they stand is known from a map."""
        return self._ground is not None

    def _blocks(self) -> Iterator[Block]:
        if self._ground is None:
            return
        rows, columns, levels = self.layout.axes
        for cell in self._ground.blocked:
            x, y = self._ground.x_and_y(cell.x, cell.y)
            spot = rows.at(x), columns.at(y), self.layout.ground + _BLOCK_HIGH
            yield Block(self._metres(spot), cell.epoch)
        volume = self._ground.volume
        if volume is None:
            return
        all_sides = volume.sides or (ALL_SIDES,) * len(volume.blocked)
        for (column, row, level), sides in zip(volume.blocked, all_sides, strict=True):
            x, y = self._ground.x_and_y(column, row)
            at = self._metres((rows.at(x), columns.at(y), levels.at(volume.z(level))))
            yield Block(at, is_cube=True, sides=sides)

    def _crafts(self, values: Assignment, here: Container[str] | None = None) -> Iterator[Craft]:
        """Yield the crafts of all robots, or of those that are `here`."""
        for name, robot in self._robots.items():
            if here is None or name in here:
                for craft in crafts_of(robot, values):
                    stays = self._ground is not None and craft.topic is None
                    yield replace(craft, level=None) if stays else craft
        for name in self._names:
            if here is None or name in here:
                yield craft_of_variable(name, values) if name in values else Craft(name, row_and_column(name))

    def _drone(self, craft: Craft, home: Point) -> Drone:
        group = craft.cell[0] if craft.cell and not self._ground else round(self.layout.axes[0].value(home[0]))
        return Drone(craft.name, craft.robot, craft.topic, self._metres(home), group)

    def _spot(self, number: int) -> Point:
        if number not in self._aside:
            self._aside[number] = self.layout.homes[number] if self.walls else next(self._edge)
        return self._aside[number]

    def _metres(self, point: Point) -> Point:
        x, y, z = (axis.value(cell) * self.scale for axis, cell in zip(self.layout.axes, point, strict=True))
        return x, y, z


def check_scale(scale: float | None, ground: GroundMap | None) -> None:
    """Raise `ValueError` where a map has walls, and its scale is not the one that is asked for."""
    walled = ground and (ground.walls or (ground.volume and ground.volume.walls))
    if ground and walled and scale not in {None, ground.scale}:
        raise ValueError(f"the map has walls, and a unit is {ground.scale:g} m on it, not {scale:g} m")


def mission_of(
    outcome: Outcome, team: Team | None = None, scale: float | None = None, ground: GroundMap | None = None
) -> Mission:
    """Return what `outcome` asks of the drones.

    Args:
        outcome: What was decided.
        team: The team as its files have it, before its scenario. Without it, only names are known.
        scale: Metres a unit; by default the map's, or else `UNIT_M`, or less where the box would be vast.
        ground: A map of the ground, if there is one.

    Raises:
        ValueError: See `MissionBuilder`.
    """
    epochs = outcome.epochs or (
        EpochOutcome(outcome.verdict, robots=team.order if team else (), assignment=outcome.assignment),
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
        robots, first, names=names, others=others, leaving=_leaving(epochs, outcome), scale=scale, ground=ground
    )
    legs = [builder.leg(epoch) for epoch in epochs[:-1]]
    return builder.mission(outcome.team, [*legs, builder.leg(epochs[-1], outcome.withdrawn)])


def all_robots(team: Team) -> list[Robot]:
    """Return all robots that ever take part: those of the beginning, and those that the scenario adds."""
    added = [change.robot for event in team.scenario for change in event.changes if isinstance(change, AddAgent)]
    return [*{robot.name: robot for robot in (*team.robots, *added)}.values()]


def _lowest(robots: Iterable[Robot], decided: Iterable[Craft]) -> list[Craft]:
    """Return the lowest possible crafts, unless they are far below all `decided`.

    They give all runs the same ground.
    """
    possible = [craft for robot in robots for craft in possible_crafts(robot) if craft.level is not None]
    if not possible:
        return []
    lowest = min(possible, key=lambda craft: craft.level or 0)
    highest = max((craft.level for craft in decided if craft.level is not None), default=0)
    return [Craft("", level=lowest.level)] if highest - (lowest.level or 0) < _FAR_BELOW else []


def _leaving(epochs: Sequence[EpochOutcome], outcome: Outcome) -> int:
    """Return about how many drones leave before the end: a robot may fly several."""
    stay = {*epochs[-1].robots} - {*outcome.withdrawn}
    return len({*outcome.withdrawn, *(name for epoch in epochs for name in epoch.robots)} - stay)


def _owner(craft: Craft) -> str:
    """Return the name by which a craft is known to take part: its robot's, or its own."""
    return craft.robot or craft.name


def _scale(axes: Sequence[Axis]) -> float:
    longest = max(1, *(axis.last - axis.first for axis in axes))
    dense = _DENSE_M if longest * _DENSE_M <= _FLOWN_M else 0.0
    return min(UNIT_M, max(VAST_M / longest, dense))


def in_cells(mission: Mission, metres: _Array) -> _Array:
    """Return points (..., 3), given in metres, in the cells of the mission's box."""
    parts = [_cells(axis, metres[..., number] / mission.scale) for number, axis in enumerate(mission.axes)]
    return np.stack(parts, axis=-1)


def _cells(axis: Axis, values: _Array) -> _Array:
    """Return `Axis.at` of many values."""
    span = axis.last - axis.first
    return axis.low + (values - axis.first) * ((axis.high - axis.low) / span if span else 1.0)
