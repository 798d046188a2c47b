"""Describes a flight in words: the flying robots, the others, and the result (the output of `robochoc fly --json`)."""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from robochoc.app.flights.flight_map import changed_to
from robochoc.app.runs.result import RunResult
from robochoc.app.runs.run import Run
from robochoc.app.sketch.sentences import listed
from robochoc.app.sketch.sketch import DecisionKind, Sketch
from robochoc.app.texts import say

SENT_BY = frozenset({DecisionKind.LEVEL, DecisionKind.PLACE})
"""The kinds of decisions that are robots' positions."""


def flying_robots_words(run: Run) -> list[str]:
    """Return sentences about the flying robots and the others; empty if no robot flies, or this is unknown.

    Raises the exceptions of `Run.sketch`.
    """
    before = run.sketch
    after = changed_to(run) or before
    if run.result is None or not run.result.assignment or not before.decisions:
        return []
    return [*_sentences(before, after, run.result)]


def _sentences(before: Sketch, after: Sketch, result: RunResult) -> Iterator[str]:
    names = [robot.name for robot in after.robots]
    left = [robot.name for robot in before.robots if robot.name not in {*names}]
    sent = {
        name for decision in after.decisions if decision.kind in SENT_BY for name in after.deciders(decision)
        if result.value(name, decision.name) is not None
    }  # fmt: skip
    aside = [name for name in names if name in {*result.withdrawn}]
    still = [name for name in names if name not in sent and name not in {*aside}]
    flying = len(names) - len(aside) - len(still)
    if not flying:
        return
    if not (aside or still or left):
        yield say("fly.who.all", count=flying) if flying > 1 else say("fly.who.one", name=names[0])
        return
    yield say("fly.who.some", flying=flying, count=len(names) + len(left))
    for key, who in (("aside", aside), ("left", left), ("still", still)):
        if who:
            yield say(f"fly.who.{key}", names=listed(who))


FLOWN = "flight.json"
_ARRIVED_M = 0.1
"""The tolerance of `robochoc fly` in metres: a drone farther from its goal has not arrived."""
_MOST_TOLD = 6
_MAX_BYTES = 64 << 20


class _Happening(msgspec.Struct, frozen=True):
    at_s: float
    drone: str
    what: str


class _Drone(msgspec.Struct, frozen=True):
    name: str
    error_m: float | None = None


class FlightResult(msgspec.Struct, frozen=True):
    """The result of a flight.

    Attributes:
        as_planned: True if all drones arrived and kept their distances.
        refused: The reason why there was no flight. Empty: there was a flight.
        drones: The drones at the end of the flight.
        happenings: The events during the flight.
    """

    as_planned: bool = True
    refused: str = ""
    drones: tuple[_Drone, ...] = ()
    happenings: tuple[_Happening, ...] = ()


def refused(why: str) -> bytes:
    """Return the content of a result file that contains only the reason why there was no flight."""
    return msgspec.json.encode({"as_planned": False, "refused": why})


def flight_result_of(run: Run) -> FlightResult | None:
    """Return the result of a run's flight, or None if it is unknown."""
    file = run.artefact(FLOWN)
    try:
        if file is None or file.stat().st_size > _MAX_BYTES:
            return None
        return msgspec.json.decode(file.read_bytes(), type=FlightResult)
    except (OSError, msgspec.DecodeError, RecursionError):
        return None


def flight_words(flown: FlightResult) -> list[str]:
    """Return the problems of a flight in sentences; empty if the flight went as planned."""
    return [*_words(flown)]


def _words(flown: FlightResult) -> Iterator[str]:
    if flown.refused:
        yield say("fly.refused", why=flown.refused.rstrip("."))
        return
    late = [drone.name for drone in flown.drones if drone.error_m is not None and drone.error_m > _ARRIVED_M]
    fallen = [drone.name for drone in flown.drones if drone.error_m is None]
    if fallen:
        yield say("fly.fallen", names=listed(fallen))
    if late:
        yield say("fly.late", names=listed(late))
    if not (flown.as_planned or late or fallen):
        yield say("fly.near")
    for one in flown.happenings[:_MOST_TOLD]:
        yield say("fly.happened", seconds=f"{one.at_s:.1f}", robot=one.drone, what=one.what)
