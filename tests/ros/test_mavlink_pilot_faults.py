"""A pilot meets what goes wrong: refusals, vehicles that do not fly as told, and those that are not heard."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.ros.autopilots.autopilot import Telemetry
from robochoc.ros.autopilots.fleet import AtEnd
from robochoc.ros.autopilots.limits import CLIMB_S, END_S, LANDING_S, MODE_S, SILENCE_S
from robochoc.ros.autopilots.messages import Phase, Target
from robochoc.ros.autopilots.pilot import Pilot
from tests.support.played_autopilot import FLEET, GROUND, Played, flying, is_over, steps


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (replace(GROUND, healthy=False), "its autopilot is not ready to arm"),
        (replace(GROUND, place=(50, 0, 0)), "it stands at 50, 0, 0, outside of the fence (-1, -1, 0 to 9, 9, 9)"),
    ],
)
def test_nothing_is_armed_that_is_not_ready(pilot: Pilot, played: Played, seen: Telemetry, why: str) -> None:
    played.seen = seen
    flying(pilot)
    assert steps(pilot, played).why == why
    assert played.done == []


@pytest.mark.parametrize("refused", ["arm", "rise"])
def test_who_refuses_is_out_and_is_not_left_armed(pilot: Pilot, played: Played, refused: str) -> None:
    played.refuses = {refused, "land"}
    flying(pilot)
    assert steps(pilot, played).phase is Phase.OUT
    steps(pilot, played)
    assert not played.seen.armed
    assert played.done[-2:] == ["land", "disarm"]


def test_who_refuses_set_points_at_first_is_asked_again(pilot: Pilot, played: Played) -> None:
    played.refuses = {"go"}
    flying(pilot)
    assert steps(pilot, played, 4).phase is Phase.CLIMBING
    played.refuses = set()
    assert steps(pilot, played).phase is Phase.FLYING


def test_who_refuses_set_points_for_good_is_out(pilot: Pilot, played: Played) -> None:
    played.refuses = {"go"}
    flying(pilot)
    assert steps(pilot, played, 4, CLIMB_S / 2).why == "it did not go (3, 1, 2)"


def test_a_take_off_that_never_ends(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played)
    played.seen = replace(played.seen, place=(0, 0, 0.5))
    assert steps(pilot, played, 4, CLIMB_S / 2).why == "it has not reached the height of its take-off within 30 s"


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        ({"silent_s": 11.0}, "its link has been silent for 10 s"),
        ({"place_age_s": 11.0}, "it has not told its place for 10 s"),
        ({"place": (3.0, 11.0, 2.0)}, "it has left the fence, at 3, 11, 2"),
        ({"place": (3.0, 1.0, 10.5)}, "it has left the fence, at 3, 1, 10.5"),
        ({"armed": False}, "its motors have stopped"),
        (
            {"mode": "HOLD", "silent_s": SILENCE_S + 1},
            "it no longer follows set points: its mode is hold",
        ),
        ({"alarm": "its battery is low"}, "its battery is low"),
    ],
)
def test_who_does_not_fly_as_told_is_out_and_lands(
    pilot: Pilot, played: Played, seen: dict[str, object], why: str
) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    steps(pilot, played, 1, 2 * MODE_S)
    played.seen = replace(played.seen, **seen)  # type: ignore[arg-type]
    assert steps(pilot, played).why == why
    steps(pilot, played, 3)
    assert played.done[-1] == "land"
    assert played.done.count("land") == 1
    pilot.fly(2, Target((4, 2, 4)))
    assert steps(pilot, played, 3).phase is Phase.OUT
    assert played.done[-1] == "land"


def test_an_end_that_is_refused_is_asked_for_again_and_given_up_at_last(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    played.refuses = {"land"}
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played, 3, 1.0)
    assert played.done[-3:] == ["land"] * 3
    assert not is_over(pilot)
    assert steps(pilot, played, 1, 2 * END_S).why == "it has not answered at the end, for 10 s"
    assert is_over(pilot)


def test_a_landing_that_never_ends_is_not_waited_for_for_ever(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played, 2, LANDING_S).why == "it has not landed within 90 s"
    assert is_over(pilot)


def test_who_is_not_heard_in_time_is_out(pilot: Pilot, played: Played) -> None:
    played.connects, played.seen = False, Telemetry()
    assert steps(pilot, played, 9, 1.0).phase is Phase.CONNECTING
    assert steps(pilot, played, 3, 1.0).why == "it is not heard on udpin://0.0.0.0:1 within 10 s"


def test_the_time_that_it_takes_to_open_a_link_is_no_silence(pilot: Pilot, played: Played) -> None:
    played.connects, played.seen, played.opens_s = False, Telemetry(), 20.0
    assert steps(pilot, played, 9, 1.0).phase is Phase.CONNECTING
    assert steps(pilot, played, 3, 1.0).phase is Phase.OUT


def test_motors_of_a_vehicle_that_is_not_heard_are_not_said_to_have_stopped(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    played.seen = replace(played.seen, armed=False, silent_s=SILENCE_S + 1)
    assert steps(pilot, played, 2, MODE_S).phase in {Phase.FLYING, Phase.ARRIVED}
    played.seen = replace(played.seen, silent_s=FLEET.patience_s + 1)
    assert steps(pilot, played).why == "its link has been silent for 10 s"


def test_motors_of_a_vehicle_that_is_not_heard_do_not_say_that_it_has_landed(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played).phase is Phase.LANDING
    played.seen = replace(played.seen, armed=False, in_air=False, silent_s=SILENCE_S + 1)
    assert steps(pilot, played, 2, MODE_S).phase is Phase.LANDING
    assert not is_over(pilot)
    played.seen = replace(played.seen, silent_s=0.5)
    assert steps(pilot, played).phase is Phase.LANDED
    assert is_over(pilot)


def test_who_tells_no_place_is_out(pilot: Pilot, played: Played) -> None:
    played.seen = replace(GROUND, place=None)
    assert steps(pilot, played, 12, 1.0).why == "it has told no place on udpin://0.0.0.0:1 within 10 s"


def test_who_is_not_heard_is_not_waited_for_for_ever(pilot: Pilot, played: Played) -> None:
    played.connects = False
    pilot.recover(AtEnd.LAND)
    steps(pilot, played, 12, 1.0)
    assert is_over(pilot)
