"""A flight log prepared for playback: positions of drones over time, epochs on the timeline, and events.

Lengths are in cells, as in `scene`; times in seconds from the beginning.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import StrEnum

import numpy as np
import numpy.typing as npt

from robochoc.flight.layout import Point
from robochoc.flight.log import FlightEvent, FlightLog
from robochoc.flight.mission import Leg, Mission, in_cells
from robochoc.model.outcome import Verdict
from robochoc.system.lazy_dataclass import dataclass

_HITS_GROUND = "hits the ground"
"""The last event of a drone that falls."""

_Array = npt.NDArray[np.float64]


class DroneState(StrEnum):
    """The state of a drone, shown by its colour: the colour of its row, grey, or red."""

    FLIES = "flies"
    WITHDRAWN = "withdrawn"
    FALLEN = "fallen"


@dataclass(frozen=True)
class Chapter:
    """An epoch: the beginning of its flight, the event that opened the epoch, and its result."""

    begins_s: float
    opened_by: str
    result: str


@dataclass(frozen=True)
class EventMark:
    """An event of a drone (by number)."""

    at_s: float
    drone: int
    text: str


@dataclass(frozen=True, eq=False)
class Playback:
    """The data for showing a flight, with T samples of N drones.

    `states` has the state changes of each drone in order: the time, and the new state.
    """

    times: _Array
    positions: _Array
    """(T, N, 3): positions, in cells."""
    attitudes: _Array
    """(T, N, 4): unit quaternions x, y, z, w."""
    states: tuple[tuple[tuple[float, DroneState], ...], ...]
    chapters: tuple[Chapter, ...] = ()
    marks: tuple[EventMark, ...] = ()
    obstacles: tuple[tuple[float, Point], ...] = ()
    """The time at which each obstacle was first seen, and its position."""

    @property
    def duration_s(self) -> float:
        """The duration, in seconds."""
        return float(self.times[-1]) if len(self.times) else 0.0


def playback_of(mission: Mission, flown: FlightLog) -> Playback:
    """Return the playback of `flown`, the flight of a mission, in cells of the mission's box."""
    marks = [EventMark(event.at_s, event.drone, event.what) for event in flown.events]
    obstacles = [in_cells(mission, np.array(place)) for place in flown.obstacles]
    return Playback(
        flown.times,
        in_cells(mission, flown.positions),
        flown.attitudes,
        tuple(tuple(_states(number, mission, flown)) for number in range(len(mission.drones))),
        tuple(_chapters(mission, flown)),
        tuple(sorted(marks, key=lambda mark: mark.at_s)),
        tuple(
            (seen_s, (float(x), float(y), float(z)))
            for seen_s, (x, y, z) in zip(flown.seen_s or [0.0] * len(obstacles), obstacles, strict=True)
        ),
    )


def fallen_drones(flown: FlightLog) -> dict[int, FlightEvent]:
    """Return the fallen drones by number, with the cause: the drone's last event before it hit the ground."""
    events: dict[int, list[FlightEvent]] = {}
    for event in flown.events:
        if np.isnan(flown.errors_m[event.drone]):
            events.setdefault(event.drone, []).append(event)
    for own in events.values():
        if len(own) > 1 and own[-1].what == _HITS_GROUND:
            own.pop()
    return {number: own[-1] for number, own in events.items()}


def _states(number: int, mission: Mission, flown: FlightLog) -> Iterator[tuple[float, DroneState]]:
    fallen = fallen_drones(flown).get(number)
    falls_s = fallen.at_s if fallen else np.inf
    now = DroneState.FLIES
    for leg, begins_s in _flown_legs(mission, flown):
        goal = leg.goals.get(number)
        then = now if goal is None else DroneState.WITHDRAWN if goal.lands else DroneState.FLIES
        if then is not now and begins_s < falls_s:
            yield begins_s, then
            now = then
    if fallen:
        yield falls_s, DroneState.FALLEN


def _flown_legs(mission: Mission, flown: FlightLog) -> list[tuple[Leg, float]]:
    """Return the flown legs, each with its start time."""
    return [(leg, times.begins_s) for leg, times in zip(mission.legs, flown.legs, strict=False)]


def _chapters(mission: Mission, flown: FlightLog) -> Iterator[Chapter]:
    flying: set[int] = set()
    for leg, begins_s in _flown_legs(mission, flown):
        for number, goal in leg.goals.items():
            (flying.discard if goal.lands else flying.add)(number)
        yield Chapter(begins_s, leg.opened_by, f"{_words(leg.verdict)}, {_flying(flying, leg)}")


def _words(verdict: Verdict) -> str:
    return verdict.value.replace("-", " ")


def _flying(flying: set[int], leg: Leg) -> str:
    if not flying:
        return "no drone flies"
    stay = leg.verdict in {Verdict.NO_SOLUTION, Verdict.UNKNOWN}
    return f"{len(flying)} {'hover on' if stay else 'fly'}"
