"""Flights that were never flown: what tests of the picture show, made without a simulation."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import umsgpack

from robochoc.flight.layout import Point
from robochoc.flight.log import ClosestApproach, FlightEvent, FlightLog, LegTimes
from robochoc.flight.mission import Mission, mission_of
from robochoc.flight.preview import preview_of
from robochoc.generators.queens3d import queens3d
from robochoc.maps.ground_map import GroundMap
from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import Domain, Robot, Team, Variable
from robochoc.view import scene as scenes
from robochoc.view.scene import Scene
from tests.support.outcomes import outcome_of

FPS = 30
LEG_S = 2
"""How long each leg takes."""
TILT = 0.1
"""Radians, by which everybody leans when under way."""


def scene_of(outcome: Outcome, team: Team | None = None, *, mission: Mission | None = None) -> Scene:
    """Return the scene of a preview flight, as the command line makes it."""
    mission = mission or mission_of(outcome, team)
    preview = preview_of(mission)
    return scenes.scene_of(outcome, mission, preview.flown, flown_mission=preview.mission, why_not=preview.why_not)


def straight(
    mission: Mission, *, falls: Mapping[int, float] | None = None, obstacles: tuple[Point, ...] = ()
) -> FlightLog:
    """Everybody goes straight to each goal, all at the same time; who `falls` (since when) drops to the ground."""
    here = np.array([drone.home for drone in mission.drones], dtype=np.float64).reshape(-1, 3)
    positions = [here[None]]
    for leg in mission.legs:
        there = here.copy()
        for number, goal in leg.goals.items():
            there[number] = goal.at
        part = np.arange(1, FPS * LEG_S + 1) / (FPS * LEG_S)
        positions.append(here + (part * part * (3 - 2 * part))[:, None, None] * (there - here))
        here = there
    flown = _record(mission, np.concatenate(positions), obstacles)
    for number, since in (falls or {}).items():
        flown = _fallen(flown, number, since, mission.ground)
    return flown


def _record(mission: Mission, positions: np.ndarray, obstacles: tuple[Point, ...]) -> FlightLog:
    times = np.arange(len(positions)) / FPS
    lean = TILT / 2 * np.sin(np.pi * times / LEG_S) ** 2
    attitudes = np.zeros((*positions.shape[:2], 4))
    attitudes[..., 0], attitudes[..., 3] = np.sin(lean)[:, None], np.cos(lean)[:, None]
    return FlightLog(
        names=tuple(drone.name for drone in mission.drones),
        times=times,
        positions=positions,
        attitudes=attitudes,
        legs=tuple(
            LegTimes(leg.opened_by, LEG_S * number, LEG_S * (number + 1)) for number, leg in enumerate(mission.legs)
        ),
        events=(),
        errors_m=np.zeros(positions.shape[1]),
        nearest=ClosestApproach(0.98, 0, 1, 1.0),
        nearest_fallen=None,
        distance=0.5,
        obstacles=obstacles,
        wall_s=0.0,
    )


def _fallen(flown: FlightLog, number: int, since: float, ground: float) -> FlightLog:
    positions, errors = flown.positions.copy(), flown.errors_m.copy()
    after = flown.times >= since
    height = positions[after][0, number, 2] - 4.9 * (flown.times[after] - since) ** 2
    positions[after, number] = positions[after][0, number]
    positions[after, number, 2] = np.maximum(height, ground)
    errors[number] = np.nan
    stopped = FlightEvent(since, number, "motor 2 stopped")
    return replace(flown, positions=positions, errors_m=errors, events=(*flown.events, stopped))


def five() -> Team:
    """A team of five, one drone each."""
    domain = Domain("D", (range(1, 6),))
    return Team("watch", tuple(Robot(f"R{place}.1", (Variable(f"V{place}.1", domain),)) for place in range(1, 6)))


def epochs_of_three(team: str = "watch") -> Outcome:
    """What `five` decide: the first knows no place yet; the fifth leaves, and there is no solution; then there is."""
    everybody = five().order
    places = {f"V{place}.1": place for place in range(2, 6)}
    last = {"V1.1": 1, "V2.1": 4, "V3.1": 3, "V4.1": 4}
    epochs = (
        EpochOutcome(Verdict.SOLUTION, robots=everybody, assignment=places),
        EpochOutcome(Verdict.NO_SOLUTION, robots=everybody[:4], opened_by="-R5.1"),
        EpochOutcome(Verdict.SOLUTION, robots=everybody[:4], opened_by="V2.1 without <2>", assignment=last),
    )
    return outcome_of(last, team=team, protocol="dynabt", epochs=epochs)


def mission_to(team: Team, ground: GroundMap, cells: Sequence[int], withdrawn: tuple[str, ...]) -> Mission:
    """Return the mission of robots that go to the cells of these numbers, unless they are `withdrawn`."""
    values = {f"V{number}": cell for number, cell in enumerate(cells, 1)}
    names = tuple(robot.name for robot in team.robots)
    epochs = (EpochOutcome(Verdict.SOLUTION, robots=names, assignment=values),) if withdrawn else ()
    return mission_of(outcome_of(values, team=team.name, withdrawn=withdrawn, epochs=epochs), team, ground=ground)


def planar(n: int, *away: str) -> Mission:
    """The mission of a solution made by hand: 3 i + 5 j, modulo n. Who is `away` has withdrawn."""
    team = queens3d(n)
    heights = {
        variable.name: sum(
            factor * int(part) for factor, part in zip((3, 5), variable.name[1:].split("."), strict=True)
        )
        for robot in team.robots
        if robot.name not in away
        for variable in robot.variables
    }
    values = {name: height % n + 1 for name, height in heights.items()}
    return mission_of(outcome_of(values, team=team.name, withdrawn=away), team)


def commands_of(html: bytes) -> list[dict[str, Any]]:
    """Meshcat's commands in a scene's page."""
    block = re.search(rb'<script id="commands"[^>]*>([^<]*)</script>', html)
    assert block
    return [umsgpack.unpackb(base64.b64decode(line)) for line in block[1].split()]
