"""Each row of the tables of a pilot: a flight that executes it, and the state that follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from robochoc.vehicles.autopilot import Telemetry
from robochoc.vehicles.fleet import AtEnd
from robochoc.vehicles.limits import CLIMB_S, END_S, GIVE_WAY_S, LANDING_S, MODE_S
from robochoc.vehicles.messages import VehicleTarget
from robochoc.vehicles.pilot import Pilot, Transition
from robochoc.vehicles.traffic import Clearance
from tests.support.played_autopilot import GROUND, THERE, Ordered, Played, arrived, flying, landed, steps

ROWS = (*Pilot.FLIGHT, *Pilot.RECOVERY, *Pilot.END)
IN_AIR = replace(GROUND, armed=True, in_air=True, mode="HOLD", place=(1, 1, 3))
OUTSIDE = VehicleTarget((50, 0, 0), lands=True)
BELOW = VehicleTarget((6, 0, 0), lands=True)
Flight = Callable[[Ordered, Played], None]


def sees(played: Played, **telemetry: object) -> None:
    played.seen = replace(played.seen, **telemetry)  # type: ignore[arg-type]


def nothing(_pilot: Ordered, _played: Played) -> None:
    pass


def not_connected(_pilot: Ordered, played: Played) -> None:
    played.connects, played.seen = False, Telemetry()


def wait(phase: Flight, seconds: float, count: int = 1) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        phase(pilot, played)
        steps(pilot, played, count, seconds)

    return flight


def ready(pilot: Ordered, played: Played) -> None:
    steps(pilot, played)


def with_order(target: VehicleTarget = THERE, **telemetry: object) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        sees(played, **telemetry)
        flying(pilot, target)

    return flight


def held_up(pilot: Ordered, _played: Played) -> None:
    """Give an order that another vehicle does not let the pilot follow yet."""
    flying(pilot)
    pilot.traffic.clearance = lambda name: Clearance(waits_for="B")  # type: ignore[method-assign]  # noqa: ARG005 - as traffic names it


def let_go(pilot: Ordered, played: Played) -> None:
    held_up(pilot, played)
    steps(pilot, played)
    del pilot.traffic.clearance


def climbing(pilot: Ordered, played: Played) -> None:
    flying(pilot)
    steps(pilot, played)


def climbing_low(pilot: Ordered, played: Played) -> None:
    climbing(pilot, played)
    sees(played, place=(0, 0, 0.5))


def on_the_way(pilot: Ordered, played: Played) -> None:
    climbing(pilot, played)
    steps(pilot, played)
    sees(played, place=(1.0, 1.0, 2.0))


def landing(pilot: Ordered, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, BELOW)
    steps(pilot, played, 2)


def on_ground_again(pilot: Ordered, played: Played) -> None:
    landing(pilot, played)
    landed(played)
    steps(pilot, played)


def out(pilot: Ordered, played: Played) -> None:
    arrived(pilot, played)
    sees(played, alarm="its battery is low")
    steps(pilot, played)


def then(first: Flight, **telemetry: object) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        first(pilot, played)
        sees(played, **telemetry)

    return flight


def ordered(first: Flight, target: VehicleTarget) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        first(pilot, played)
        pilot.fly(2, target)

    return flight


def ending(first: Flight, how: AtEnd = AtEnd.LAND, *, waits: bool = True, before: int = 0) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        first(pilot, played)
        pilot.end(how, waits=waits)
        if before:
            steps(pilot, played, before)

    return flight


def recovering(first: Flight) -> Flight:
    def flight(pilot: Ordered, played: Played) -> None:
        first(pilot, played)
        pilot.recover(AtEnd.LAND)

    return flight


def making_room(pilot: Ordered, played: Played) -> None:
    arrived(pilot, played)
    pilot.traffic.clearance = lambda name: Clearance((4.0, 2.0, 4.0))  # type: ignore[method-assign]  # noqa: ARG005 - as traffic names it


def climbs_and_lands(pilot: Ordered, played: Played) -> None:
    climbing(pilot, played)
    pilot.traffic.clearance = lambda name: Clearance(lands=True)  # type: ignore[method-assign]  # noqa: ARG005 - as traffic names it


def waits_its_turn(pilot: Ordered, played: Played) -> None:
    ending(arrived)(pilot, played)
    pilot.traffic.clearance = lambda name: Clearance((4.0, 2.0, 4.0))  # type: ignore[method-assign]  # noqa: ARG005 - as traffic names it


def refused_landing(pilot: Ordered, played: Played) -> None:
    arrived(pilot, played)
    played.refuses = {"land"}


FLIGHTS: dict[str, tuple[Flight, float]] = {
    "connected": (nothing, 0.1),
    "not connected": (wait(not_connected, 0.1), 11),
    "silent": (then(ready, silent_s=11.0), 0.1),
    "old place": (then(ready, place_age_s=11.0), 0.1),
    "taken over": (then(arrived, mode="POSCTL"), 0.1),
    "landing taken over": (wait(then(landing, mode="POSCTL"), 0.1), MODE_S + 1),
    "alarm": (then(arrived, alarm="its battery is low"), 0.1),
    "fence left": (then(arrived, place=(3.0, 11.0, 2.0)), 0.1),
    "motors stopped": (then(arrived, armed=False), MODE_S + 1),
    "mode left": (then(arrived, mode="HOLD"), MODE_S + 1),
    "order, but flown by others": (with_order(armed=True, in_air=True, mode="POSCTL"), 0.1),
    "order to land at once, in the air": (with_order(OUTSIDE, **vars(IN_AIR)), 0.1),
    "order in the air": (with_order(**vars(IN_AIR)), 0.1),
    "order to land, on the ground": (with_order(BELOW), 0.1),
    "order, but not ready": (with_order(healthy=False), 0.1),
    "order to take off": (with_order(), 0.1),
    "order to wait": (held_up, 0.1),
    "take-off after a wait": (let_go, 0.1),
    "order to land at once": (ordered(arrived, OUTSIDE), 0.1),
    "order on the way": (ordered(arrived, VehicleTarget((4, 2, 4))), 0.1),
    "climbed, lands": (climbs_and_lands, 0.1),
    "climbed": (climbing, 0.1),
    "climb too long": (climbing_low, CLIMB_S + 1),
    "landing": (wait(ordered(arrived, BELOW), 0.1), 0.1),
    "making room": (making_room, 0.1),
    "arrived": (wait(climbing, 0.1), 0.1),
    "on the way": (on_the_way, 0.1),
    "landed": (then(landing, armed=False, in_air=False), 0.1),
    "out of order": (out, GIVE_WAY_S + 1),
    "recovery: link open": (recovering(nothing), 0.1),
    "recovery: no link": (recovering(not_connected), 11),
    "recovery: left armed": (recovering(with_order(**vars(IN_AIR))), 0.1),
    "recovery: not armed": (recovering(ready), MODE_S + 1),
    "end: no wait": (ending(arrived, waits=False, before=1), 0.1),
    "end: landed": (then(ending(arrived, before=1), armed=False, in_air=False), 0.1),
    "end: landed out of order": (then(ending(wait(out, 0.1), before=1), armed=False, in_air=False), 0.1),
    "end: landing too long": (ending(arrived, before=1), LANDING_S + 1),
    "end: landing": (ending(arrived, before=1), 0.1),
    "end: never commanded": (ending(ready), 0.1),
    "end: flown by others": (then(ending(arrived), mode="POSCTL"), 0.1),
    "end: on the ground": (ending(on_ground_again), 0.1),
    "end: waiting its turn": (waits_its_turn, 0.1),
    "end: commanded to land": (ending(arrived), 0.1),
    "end: commanded to land out of order": (ending(out), GIVE_WAY_S + 1),
    "end: commanded to hold": (ending(arrived, AtEnd.HOLD), 0.1),
    "end: refused too long": (ending(refused_landing, before=1), END_S + 1),
}
"""A flight to each row, and the seconds until the step that executes it."""


@pytest.fixture
def executed(pilot: Ordered, monkeypatch: pytest.MonkeyPatch) -> list[Transition]:
    """The rows that the pilot has executed."""
    rows: list[Transition] = []
    execute: Callable[[Transition, Telemetry, str], None] = pilot._execute  # noqa: SLF001 - each row is observed

    def observed(row: Transition, seen: Telemetry, reason: str) -> None:
        rows.append(row)
        execute(row, seen, reason)

    monkeypatch.setattr(pilot, "_execute", observed)
    return rows


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_each_row_is_executed_and_leads_to_its_state(
    pilot: Ordered, played: Played, executed: list[Transition], row: Transition
) -> None:
    flight, after_s = FLIGHTS[row.name]
    flight(pilot, played)
    executed.clear()
    assert not pilot.ended
    state = steps(pilot, played, 1, after_s)
    assert [one.name for one in executed] == [row.name]
    assert row.next in {None, state.phase}
    assert pilot.ended is row.ends


def test_names_of_rows_are_distinct() -> None:
    assert len({row.name for row in ROWS}) == len(ROWS) == len(FLIGHTS)
