"""The scene of an outcome: data on the drones, their flight, and the box around them.

Lengths are in cells: one cell is one row, one column or one level. Scenes are drawn by `drawing`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robochoc.flight.layout import BoxAxis, Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Goal, Mission, in_cells
from robochoc.formats.headline import describe_outcome
from robochoc.maps.ground_map import ALL_SIDES
from robochoc.model.cost_units import cost_shown
from robochoc.model.outcome import Outcome
from robochoc.system.lazy_dataclass import dataclass
from robochoc.view.playback import Playback, fallen_drones, playback_of
from robochoc.view.walls import DrawnWalls, Faces, wall_faces, wall_footprints


@dataclass(frozen=True)
class DrawnDrone:
    """A drone that starts at `home`, on the ground.

    The drone ends at its `place` in the air, or at its `landing`, or stays at home.
    """

    name: str
    group: int
    """The drone's row: drones in the same row have the same colour."""
    home: Point
    place: Point | None = None
    landing: Point | None = None

    @property
    def end(self) -> Point:
        """The final position."""
        return self.place or self.landing or self.home


@dataclass(frozen=True)
class DrawnBlock:
    """A cell that is blocked from second `since_s` on: a block on the ground with the centre of its top at `top`.

    On a three-dimensional map, it is a cube around `top` with visible `sides`, as in `Volume.sides`.
    """

    top: Point
    since_s: float = 0.0
    is_cube: bool = False
    sides: int = ALL_SIDES


@dataclass(frozen=True)
class Scene:
    """One run, to be drawn. `facts` is the caption: pairs of a label and a text.

    Without a `playback`, drones are at their final places.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    drones: tuple[DrawnDrone, ...]
    axes: tuple[BoxAxis, BoxAxis, BoxAxis]
    playback: Playback | None = None
    blocks: tuple[DrawnBlock, ...] = ()
    walls: DrawnWalls | None = None
    faces: Faces | None = None
    """The walls of a three-dimensional map; None: the map's blocked cells are drawn."""

    @property
    def ground(self) -> float:
        """The height of the ground: one level below the lowest place."""
        return self.axes[2].ground


def scene_of(
    outcome: Outcome,
    mission: Mission,
    flown: FlightLog | None = None,
    *,
    flown_mission: Mission | None = None,
    why_not: str = "",
    weighted: bool | None = None,
) -> Scene:
    """Return the scene of `outcome`. Without a flight, the drones are at their final places.

    Args:
        outcome: The outcome of a run.
        mission: The mission of the outcome.
        flown: The log of the mission's flight.
        flown_mission: The flown mission, if it is `mission` with cells of another size. Distances are then not to
            scale, and are omitted in the scene.
        why_not: The reason why nothing was flown, for the caption.
        weighted: True if robots differ in weight; None: unknown.
    """
    flown_mission = flown_mission or mission
    drones = tuple(_drones(flown_mission))
    title = f"{outcome.team}: {_headline(outcome, mission, drones, weighted=weighted)}"
    flight = _flight_facts(flown, why_not, is_to_scale=flown_mission is mission)
    playback = playback_of(flown_mission, flown) if flown else None
    blocks = tuple(_blocks(flown_mission, flown))
    walls, faces = wall_footprints(flown_mission), wall_faces(flown_mission)
    if faces is not None:
        blocks = tuple(block for block in blocks if not block.is_cube)
    return Scene(title, (*_facts(outcome, mission), *flight), drones, mission.axes, playback, blocks, walls, faces)


def _headline(outcome: Outcome, mission: Mission, drones: Sequence[DrawnDrone], *, weighted: bool | None) -> str:
    """Return the headline, with numbers of robots, or of drones if robots have several drones or are unknown."""
    robots = {drone.robot for drone in mission.drones if drone.robot}
    if len(robots) == len(drones):
        return describe_outcome(outcome, len(robots), weighted=weighted)
    flying = sum(drone.place is not None for drone in drones)
    return describe_outcome(outcome, len(drones), flying=flying, noun="drone")


def _drones(mission: Mission) -> Iterator[DrawnDrone]:
    """Yield each drone, with its last goal."""
    last: dict[int, Goal] = {}
    for leg in mission.legs:
        last.update(leg.goals)
    for number, drone in enumerate(mission.drones):
        goal = last.get(number)
        end = _cell(mission, goal.at) if goal else None
        home = _cell(mission, drone.home)
        if goal and goal.lands:
            yield DrawnDrone(drone.name, drone.group, home, landing=end)
        else:
            yield DrawnDrone(drone.name, drone.group, home, place=end)


def _blocks(mission: Mission, flown: FlightLog | None) -> Iterator[DrawnBlock]:
    """Yield each block. A block in a later leg appears when this leg begins, or never if the leg is not flown."""
    for block in mission.blocks:
        if flown is None or not block.leg:
            yield DrawnBlock(_cell(mission, block.at), is_cube=block.is_cube, sides=block.sides)
        elif block.leg < len(flown.legs):
            yield DrawnBlock(_cell(mission, block.at), flown.legs[block.leg].begins_s)


def _cell(mission: Mission, metres: Point) -> Point:
    x, y, z = in_cells(mission, np.array(metres, dtype=np.float64)).tolist()
    return x, y, z


def _flight_facts(flown: FlightLog | None, why_not: str, *, is_to_scale: bool) -> Iterator[tuple[str, str]]:
    """Yield facts about the flight, with distances only if they are to scale, or the reason why there was no flight."""
    if flown is None:
        if why_not:
            yield "flight", f"none: {why_not}"
        return
    yield "flown", f"{flown.times[-1]:.1f} s{'' if is_to_scale else ', not to scale'}"
    if flown.nearest_wall and is_to_scale:
        yield "from walls", f"{flown.nearest_wall.distance_m:.2f} m (set: {flown.nearest_wall.set_m:.2g} m)"
    if flown.nearest and is_to_scale:
        yield "separation", f"{flown.nearest.distance_m:.2f} m (set: {flown.distance:.2g} m)"
    for number, event in fallen_drones(flown).items():
        yield "fallen", f"{flown.names[number]} ({event.what})"
    if flown.nearest_fallen and is_to_scale:
        yield "from fallen", f"{flown.nearest_fallen.distance_m:.2f} m"


def _facts(outcome: Outcome, mission: Mission) -> tuple[tuple[str, str], ...]:
    checked = ", checked" if outcome.verified else ""
    facts = [("verdict", f"{outcome.verdict}{checked}"), ("protocol", outcome.protocols)]
    if outcome.withdrawn_alive:
        known = f"no solution for all {len(mission.drones)}" if outcome.deadline is None else outcome.verdict
        facts[0] = ("verdict", f"{known}{checked}")
        facts.append(("withdrawn", f"{len(outcome.withdrawn_alive)}"))
    if outcome.lost:
        facts.append(("lost", ", ".join(outcome.lost)))
    if outcome.cost:
        facts.append(("cost", cost_shown(outcome.cost)))
    facts.append(("messages", f"{sum(outcome.metrics.messages.values()):,}"))
    return tuple(facts)
