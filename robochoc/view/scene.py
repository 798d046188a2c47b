"""What there is to see of an outcome, as data: the drones, how they flew, and the box around them.

Lengths are in cells: one cell is one row, one column or one level. Nothing here draws; `stage` does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from robochoc.flight.flight import fly
from robochoc.flight.layout import Axis, Point
from robochoc.flight.mission import Goal, Mission, mission_of
from robochoc.flight.quadrotor.flown import Flown
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.view.film import Film, fell, film_of, in_cells, roomy

_NO_FLIGHT = (ValueError, ArithmeticError, MemoryError)
"""What makes a flight impossible: places too close to each other, no way between them, numbers beyond all bounds. That
is no reason not to show the rest."""
_MOST_DRONES = 500
"""More than that are not flown here: to find their ways takes minutes."""
_MOST_FLIGHTS = 2_000
"""Of all drones, in all epochs, likewise."""
_MOST_LEGS = 60
"""However few drones: each takes a fifth of a second."""


@dataclass(frozen=True)
class Drone:
    """Begins at `home`, on the ground. It ends at its `place` in the air, or `aside`, or (neither) stays there."""

    name: str
    group: int
    """Its row: drones of a row look alike."""
    home: Point
    place: Point | None = None
    aside: Point | None = None

    @property
    def end(self) -> Point:
        """Where it is to be in the end."""
        return self.place or self.aside or self.home


@dataclass(frozen=True)
class Scene:
    """One run, ready to be drawn. `facts` is the caption: pairs of a label and what it says, in plain text.

    Without a `film`, drones are where they are to be in the end.
    """

    title: str
    facts: tuple[tuple[str, str], ...]
    drones: tuple[Drone, ...]
    axes: tuple[Axis, Axis, Axis]
    film: Film | None = None

    @property
    def ground(self) -> float:
        """The height on which drones stand: one level below the lowest place."""
        return self.axes[2].ground


def scene_of(
    outcome: Outcome,
    team: Team | None = None,
    *,
    mission: Mission | None = None,
    flown: Flown | None = None,
    progress: Callable[[str], None] | None = None,
) -> Scene:
    """The scene of `outcome`. With its `team` also robots that stay behind are shown, and topics say where to fly.

    `team` is as its files have it, before its scenario. `mission` is what the outcome asks of the drones, where that
    is known already, and `flown` how they flew that; without one they are flown here, in calm air, of
    which `progress` hears (`flight/flight.py`).

    Never raises for want of a place: a robot whose coordinates are missing or undefined is placed by the two
    numbers its name ends in (row and column), and failing that in a tidy grid, at the height of its first value. Nor
    for want of a way: then the drones are where they are to be, and the caption says why.
    """
    mission = mission or mission_of(outcome, team)
    axes, why_not, is_to_scale = mission.axes, "", True
    if flown is None:
        asked, mission = mission, roomy(mission)
        is_to_scale = mission is asked
        flown, why_not = _flown(mission, progress)
    drones = tuple(_drones(mission))
    withdrawn = {*outcome.withdrawn}
    aside = sum(drone.robot in withdrawn or drone.name in withdrawn for drone in mission.drones)
    flying = sum(drone.place is not None for drone in drones)
    title = f"{outcome.team}: {_ending(outcome, flying, aside)}"
    facts = (*_facts(outcome, flying, aside), *_flight_facts(flown, why_not, is_to_scale=is_to_scale))
    return Scene(title, facts, drones, axes, film_of(mission, flown) if flown else None)


def _flown(mission: Mission, progress: Callable[[str], None] | None) -> tuple[Flown | None, str]:
    """How the drones fly their mission in calm air; if they do not, why, unless nobody is to fly."""
    drones, legs = len(mission.drones), len(mission.legs)
    if not any(leg.goals for leg in mission.legs):
        return None, ""
    if drones > _MOST_DRONES or drones * legs > _MOST_FLIGHTS or legs > _MOST_LEGS:
        return None, f"{_counted(drones, 'drone')} in {_counted(legs, 'epoch')} are more than are flown for a picture"
    try:
        return fly(mission, progress=progress), ""
    except _NO_FLIGHT as error:
        return None, str(error) or type(error).__name__


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _drones(mission: Mission) -> Iterator[Drone]:
    """Each drone, and where the last leg that says something of it wants it to be."""
    last: dict[int, Goal] = {}
    for leg in mission.legs:
        last.update(leg.goals)
    for number, drone in enumerate(mission.drones):
        goal = last.get(number)
        end = _cell(mission, goal.at) if goal else None
        home = _cell(mission, drone.home)
        if goal and goal.lands:
            yield Drone(drone.name, drone.group, home, aside=end)
        else:
            yield Drone(drone.name, drone.group, home, place=end)


def _cell(mission: Mission, metres: Point) -> Point:
    x, y, z = in_cells(mission, np.array(metres, dtype=np.float64)).tolist()
    return x, y, z


def _flight_facts(flown: Flown | None, why_not: str, *, is_to_scale: bool) -> Iterator[tuple[str, str]]:
    """How the flight went, distances only where they are to scale; or why there was none."""
    if flown is None:
        if why_not:
            yield "flight", f"none: {why_not}"
        return
    yield "flown", f"{flown.times[-1]:.1f} s{'' if is_to_scale else ', not to scale'}"
    if flown.nearest and is_to_scale:
        yield "nearest", f"{flown.nearest.distance_m:.2f} m (set: {flown.distance:.2g} m)"
    for number, happening in fell(flown).items():
        yield "fallen", f"{flown.names[number]} ({happening.what})"
    if flown.nearest_fallen and is_to_scale:
        yield "to others", f"{flown.nearest_fallen.distance_m:.2f} m at the nearest"


def _ending(outcome: Outcome, flying: int, aside: int) -> str:
    if outcome.aside and flying:
        others = "no better team could" if outcome.verdict is Verdict.OPTIMAL else f"{aside} withdrew"
        return f"{flying} fly, {others}"
    left = " for those that are left" if outcome.lost else ""
    match outcome.verdict:
        case Verdict.SOLUTION:
            return f"a solution{left}"
        case Verdict.OPTIMAL:
            return "an optimal solution"
        case Verdict.NO_SOLUTION if any(epoch.assignment for epoch in outcome.epochs):
            return f"no solution{left} in the end"
        case Verdict.NO_SOLUTION:
            return f"no solution{left}, everybody stays on the ground"
        case Verdict.UNKNOWN:
            return "a limit was reached without a verdict"


def _facts(outcome: Outcome, flying: int, aside: int) -> tuple[tuple[str, str], ...]:
    checked = ", checked" if outcome.verified else ""
    verdict = f"{outcome.verdict}{checked}"
    if outcome.aside:
        verdict = f"no solution for all {flying + aside}; {flying} placed{checked}"
    facts = [("verdict", verdict), ("protocol", outcome.protocols)]
    if outcome.lost:
        facts.append(("lost", ", ".join(outcome.lost)))
    if outcome.cost:
        facts.append(("cost", f"{outcome.cost:,g}"))
    facts.append(("messages", f"{sum(outcome.metrics.messages.values()):,}"))
    return tuple(facts)
