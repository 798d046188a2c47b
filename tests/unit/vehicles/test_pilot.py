"""A pilot flies one vehicle: orders, the end, faults, and people who take over. Autopilot and clock are played."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.vehicles.autopilot import OFFBOARD, Telemetry
from robochoc.vehicles.fleet import AtEnd
from robochoc.vehicles.limits import CLIMB_S, END_S, LANDING_S, MODE_S, SILENCE_S
from robochoc.vehicles.messages import FlightPhase, VehicleState, VehicleTarget
from robochoc.vehicles.pilot import Pilot
from tests.support.played_autopilot import (
    FLEET,
    GROUND,
    THERE,
    Ordered,
    Played,
    arrived,
    flying,
    is_over,
    landed,
    steps,
)


def test_a_vehicle_arms_takes_off_flies_and_lands_at_the_end(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    phases = [steps(pilot, played).phase for _ in range(3)]
    assert phases == [FlightPhase.CLIMBING, FlightPhase.FLYING, FlightPhase.ARRIVED]
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played).phase is FlightPhase.LANDING
    assert not is_over(pilot)
    landed(played)
    assert steps(pilot, played) == VehicleState(
        "A", FlightPhase.LANDED, 1, (3, 1, 2), 1.0, healthy=True, commanded=True
    )
    assert is_over(pilot)
    assert played.done == ["arm", "rise 2.5", "go (3, 1, 2)", "land"]


def test_a_vehicle_without_an_order_is_never_commanded(pilot: Pilot, played: Played) -> None:
    assert steps(pilot, played, 20).phase is FlightPhase.READY
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == []


def test_a_new_order_takes_the_place_of_the_one_before(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 2)
    pilot.fly(2, VehicleTarget((4, 2, 4)))
    assert steps(pilot, played).order == 2
    assert played.done[-1] == "go (4, 2, 4)"
    assert steps(pilot, played).phase is FlightPhase.ARRIVED


def test_who_is_to_land_flies_above_the_point_first(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is FlightPhase.LANDING
    assert played.done[-2:] == ["go (6, 0, 2)", "land"]
    landed(played)
    assert steps(pilot, played).phase is FlightPhase.LANDED


def test_who_is_to_land_outside_of_the_fence_lands_where_it_is(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((50, 0, 0), lands=True))
    assert steps(pilot, played).phase is FlightPhase.LANDING
    assert played.done[-1] == "land"


def test_who_has_landed_is_not_commanded_at_the_end(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((6, 0, 0), lands=True))
    steps(pilot, played, 2)
    landed(played)
    steps(pilot, played)
    done = [*played.done]
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == done


def test_who_is_to_land_and_stands_on_the_ground_does_nothing(pilot: Pilot, played: Played) -> None:
    flying(pilot, VehicleTarget((6, 0, 0), lands=True))
    assert steps(pilot, played).phase is FlightPhase.LANDED
    assert played.done == []


def test_who_has_landed_takes_off_again(pilot: Pilot, played: Played) -> None:
    flying(pilot, VehicleTarget((6, 0, 0), lands=True))
    steps(pilot, played)
    pilot.fly(2, THERE)
    assert steps(pilot, played, 3).phase is FlightPhase.ARRIVED


def test_who_is_sent_elsewhere_while_it_lands_takes_off_again(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is FlightPhase.LANDING
    pilot.fly(3, THERE)
    steps(pilot, played)
    played.seen = replace(played.seen, armed=False, in_air=False, place=(6, 0, 0))
    assert steps(pilot, played, 5) == VehicleState(
        "A", FlightPhase.ARRIVED, 3, (3, 1, 2), 1.0, healthy=True, in_air=True, commanded=True
    )
    assert played.done[-5:] == ["land", "arm", "rise 2.5", "go (6, 0, 2.5)", "go (3, 1, 2)"]


def test_at_the_end_a_vehicle_may_hold(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.end(AtEnd.HOLD, waits=True)
    assert steps(pilot, played, 2).phase is FlightPhase.ARRIVED
    assert is_over(pilot)
    assert played.done[-1] == "hold"


def test_what_another_guard_has_left_in_the_air_is_brought_down(pilot: Pilot, played: Played) -> None:
    played.seen = replace(GROUND, armed=True, in_air=True, mode="HOLD", place=(1, 1, 3))
    pilot.recover(AtEnd.LAND)
    steps(pilot, played, 4)
    assert is_over(pilot)
    assert played.done == ["land"]


# Refusals, vehicles that do not fly as told, and those that are not heard


@pytest.mark.parametrize(
    ("seen", "why"),
    [
        (replace(GROUND, healthy=False), "its autopilot is not ready to arm"),
        (replace(GROUND, place=(50, 0, 0)), "it is at 50, 0, 0, outside the fence (-1, -1, 0 to 9, 9, 9)"),
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
    assert steps(pilot, played).phase is FlightPhase.OUT
    steps(pilot, played)
    assert not played.seen.armed
    assert played.done[-2:] == ["land", "disarm"]


def test_who_refuses_set_points_at_first_is_asked_again(pilot: Pilot, played: Played) -> None:
    played.refuses = {"go"}
    flying(pilot)
    assert steps(pilot, played, 4).phase is FlightPhase.CLIMBING
    played.refuses = set()
    assert steps(pilot, played).phase is FlightPhase.FLYING


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
        ({"place_age_s": 11.0}, "no place reported for 10 s"),
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
    arrived(pilot, played)
    steps(pilot, played, 1, 2 * MODE_S)
    played.seen = replace(played.seen, **seen)  # type: ignore[arg-type]
    assert steps(pilot, played).why == why
    steps(pilot, played, 3)
    assert played.done[-1] == "land"
    assert played.done.count("land") == 1
    pilot.fly(2, VehicleTarget((4, 2, 4)))
    assert steps(pilot, played, 3).phase is FlightPhase.OUT
    assert played.done[-1] == "land"


def test_an_end_that_is_refused_is_asked_for_again_and_given_up_at_last(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    played.refuses = {"land"}
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played, 3, 1.0)
    assert played.done[-3:] == ["land"] * 3
    assert not is_over(pilot)
    assert steps(pilot, played, 1, 2 * END_S).why == "it has not accepted the final command within 10 s"
    assert is_over(pilot)


def test_a_landing_that_never_ends_is_not_waited_for_for_ever(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played, 2, LANDING_S).why == "it has not landed within 90 s"
    assert is_over(pilot)


def test_who_is_not_heard_in_time_is_out(pilot: Pilot, played: Played) -> None:
    played.connects, played.seen = False, Telemetry()
    assert steps(pilot, played, 9, 1.0).phase is FlightPhase.CONNECTING
    assert steps(pilot, played, 3, 1.0).why == "no message received on udpin://0.0.0.0:1 within 10 s"


def test_the_time_that_it_takes_to_open_a_link_is_no_silence(pilot: Pilot, played: Played) -> None:
    played.connects, played.seen, played.opens_s = False, Telemetry(), 20.0
    assert steps(pilot, played, 9, 1.0).phase is FlightPhase.CONNECTING
    assert steps(pilot, played, 3, 1.0).phase is FlightPhase.OUT


def test_motors_of_a_vehicle_that_is_not_heard_are_not_said_to_have_stopped(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    played.seen = replace(played.seen, armed=False, silent_s=SILENCE_S + 1)
    assert steps(pilot, played, 2, MODE_S).phase in {FlightPhase.FLYING, FlightPhase.ARRIVED}
    played.seen = replace(played.seen, silent_s=FLEET.patience_s + 1)
    assert steps(pilot, played).why == "its link has been silent for 10 s"


def test_motors_of_a_vehicle_that_is_not_heard_do_not_say_that_it_has_landed(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played).phase is FlightPhase.LANDING
    played.seen = replace(played.seen, armed=False, in_air=False, silent_s=SILENCE_S + 1)
    assert steps(pilot, played, 2, MODE_S).phase is FlightPhase.LANDING
    assert not is_over(pilot)
    played.seen = replace(played.seen, silent_s=0.5)
    assert steps(pilot, played).phase is FlightPhase.LANDED
    assert is_over(pilot)


def test_who_tells_no_place_is_out(pilot: Pilot, played: Played) -> None:
    played.seen = replace(GROUND, place=None)
    assert steps(pilot, played, 12, 1.0).why == "no place reported on udpin://0.0.0.0:1 within 10 s"


def test_who_is_not_heard_is_not_waited_for_for_ever(pilot: Pilot, played: Played) -> None:
    played.connects = False
    pilot.recover(AtEnd.LAND)
    steps(pilot, played, 12, 1.0)
    assert is_over(pilot)


# Errors of the pilot itself


def broken(*_: object, **__: object) -> None:
    raise ValueError("nobody foresaw it")


FAILED = "its pilot failed: ValueError: nobody foresaw it"


@pytest.mark.parametrize("what", ["telemetry", "go_to"])
def test_who_has_a_pilot_that_fails_is_out_and_lands(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((4, 2, 4)))
    monkeypatch.setattr(played, what, broken)
    assert steps(pilot, played).why == FAILED
    assert steps(pilot, played, 3).phase is FlightPhase.OUT
    assert played.done.count("land") == 1
    pilot.end(AtEnd.LAND, waits=False)
    steps(pilot, played)
    assert is_over(pilot)


def test_who_cannot_be_planned_for_lands_all_the_same(
    pilot: Ordered, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrived(pilot, played)
    for method in ("update_place", "lose", "clearance", "is_clear_below"):
        monkeypatch.setattr(pilot.traffic, method, broken)
    assert steps(pilot, played).why == FAILED
    assert played.done[-1] == "land"


def test_a_landing_that_fails_is_tried_again_and_given_up_at_last(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrived(pilot, played)
    for method in ("telemetry", "land"):
        monkeypatch.setattr(played, method, broken)
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played, 3, 1.0)
    assert not is_over(pilot)
    steps(pilot, played, 1, 2 * END_S)
    assert is_over(pilot)


def test_whom_a_person_flies_is_left_alone_by_a_pilot_that_fails(
    pilot: Ordered, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrived(pilot, played)
    played.seen = replace(played.seen, mode="POSCTL")
    monkeypatch.setattr(pilot.traffic, "update_place", broken)
    steps(pilot, played, 3)
    assert "land" not in played.done


def test_who_was_never_commanded_is_not_commanded_by_a_pilot_that_fails(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps(pilot, played, 2)
    monkeypatch.setattr(played, "telemetry", broken)
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == []


# A person, or a failsafe, takes the vehicle over: the pilot never fights them


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
    assert steps(pilot, played).phase is FlightPhase.OUT
    steps(pilot, played, 100)
    assert played.done == done


@pytest.mark.parametrize("mode", ["HOLD", "LAND"])
def test_who_leaves_our_mode_with_a_good_link_is_left_alone(pilot: Pilot, played: Played, mode: str) -> None:
    arrived(pilot, played)
    played.seen = replace(played.seen, mode=mode)
    done = [*played.done]
    told = f"its mode is {mode.lower()} (a person flies it, or its own failsafe)"
    assert told in steps(pilot, played, 1, 2 * MODE_S).why
    steps(pilot, played, 100)
    assert played.done == done


def test_a_person_who_takes_over_while_it_lands_at_the_end_is_not_fought(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    played.refuses = {"land"}
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    played.seen = replace(played.seen, mode="POSCTL")
    done = [*played.done]
    steps(pilot, played, 20)
    assert played.done == done
    assert is_over(pilot)


def test_a_person_who_takes_over_while_it_lands_on_the_way_is_told(pilot: Pilot, played: Played) -> None:
    arrived(pilot, played)
    pilot.fly(2, VehicleTarget((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is FlightPhase.LANDING
    played.seen = replace(played.seen, mode="POSCTL")
    assert steps(pilot, played).phase is FlightPhase.LANDING
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
