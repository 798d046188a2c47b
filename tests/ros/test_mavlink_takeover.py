"""A person, or a failsafe, takes a vehicle over: the pilot never fights them, and tells of it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.ros.autopilots.autopilot import OFFBOARD, Telemetry
from robochoc.ros.autopilots.fleet import AtEnd
from robochoc.ros.autopilots.limits import MODE_S
from robochoc.ros.autopilots.messages import Phase, Target
from robochoc.ros.autopilots.pilot import Pilot
from tests.support.played_autopilot import GROUND, Played, flying, is_over, steps


@pytest.mark.parametrize("within", [1, 3])
@pytest.mark.parametrize(
    ("mode", "told"),
    [
        ("POSCTL", "posctl (a person flies it)"),
        ("RETURN_TO_LAUNCH", "return to launch (a person flies it, or its own failsafe)"),
    ],
)
def test_whom_a_person_has_taken_over_gets_no_command_any_more(
    pilot: Pilot, played: Played, within: int, mode: str, told: str
) -> None:
    flying(pilot)
    steps(pilot, played, within)
    played.seen = replace(played.seen, mode=mode, place=(0, 0, 1))
    done = [*played.done]
    assert steps(pilot, played, 1, 2 * MODE_S).why == f"it no longer follows set points: its mode is {told}"
    played.seen = replace(played.seen, mode=OFFBOARD)
    steps(pilot, played, 3)
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == done


def test_a_take_over_counts_at_once_when_the_vehicle_has_obeyed_before(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 2)
    played.seen = replace(played.seen, mode="ALTCTL")
    done = [*played.done]
    assert steps(pilot, played).phase is Phase.OUT
    steps(pilot, played, 100)
    assert played.done == done


@pytest.mark.parametrize("mode", ["HOLD", "LAND"])
def test_who_leaves_our_mode_with_a_good_link_is_left_alone(pilot: Pilot, played: Played, mode: str) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    played.seen = replace(played.seen, mode=mode)
    done = [*played.done]
    told = f"its mode is {mode.lower()} (a person flies it, or its own failsafe)"
    assert told in steps(pilot, played, 1, 2 * MODE_S).why
    steps(pilot, played, 100)
    assert played.done == done


def test_a_person_who_takes_over_while_it_lands_at_the_end_is_not_fought(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    played.refuses = {"land"}
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    played.seen = replace(played.seen, mode="POSCTL")
    done = [*played.done]
    steps(pilot, played, 20)
    assert played.done == done
    assert is_over(pilot)


def test_a_person_who_takes_over_while_it_lands_on_the_way_is_told(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is Phase.LANDING
    played.seen = replace(played.seen, mode="POSCTL")
    assert steps(pilot, played).phase is Phase.LANDING
    assert (
        steps(pilot, played, 2, MODE_S).why == "it no longer follows set points: its mode is posctl (a person flies it)"
    )
    assert played.done[-1] == "land"


def test_whom_a_person_flies_is_not_taken_from_him(pilot: Pilot, played: Played) -> None:
    played.seen = replace(GROUND, armed=True, in_air=True, mode="POSCTL", place=(1, 1, 3))
    flying(pilot)
    assert steps(pilot, played).why == "its mode is posctl (a person flies it)"
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == []


def test_a_mode_that_was_told_before_is_no_reason(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played)
    played.seen = replace(played.seen, mode="MANUAL")
    pilot.end(AtEnd.LAND, waits=False)
    steps(pilot, played, 2)
    assert played.done[-1] == "land"
    assert is_over(pilot)


@pytest.mark.parametrize("seen", [GROUND, replace(GROUND, armed=True, in_air=True, mode="POSCTL")])
def test_who_stands_or_is_flown_by_a_person_is_left_alone(pilot: Pilot, played: Played, seen: Telemetry) -> None:
    played.seen = seen
    pilot.recover(AtEnd.LAND)
    steps(pilot, played, 3)
    assert not is_over(pilot)
    steps(pilot, played, 2, MODE_S)
    assert is_over(pilot)
    assert played.done == []
