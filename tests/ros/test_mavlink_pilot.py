"""A pilot flies one vehicle: orders, and the end. Autopilot and clock are played."""

from __future__ import annotations

from dataclasses import replace

from robochoc.ros.autopilots.fleet import AtEnd
from robochoc.ros.autopilots.messages import Phase, State, Target
from robochoc.ros.autopilots.pilot import Pilot
from tests.support.played_autopilot import GROUND, THERE, Played, flying, is_over, landed, steps


def test_a_vehicle_arms_takes_off_flies_and_lands_at_the_end(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    phases = [steps(pilot, played).phase for _ in range(3)]
    assert phases == [Phase.CLIMBING, Phase.FLYING, Phase.ARRIVED]
    pilot.end(AtEnd.LAND, waits=True)
    assert steps(pilot, played).phase is Phase.LANDING
    assert not is_over(pilot)
    landed(played)
    assert steps(pilot, played) == State("A", Phase.LANDED, 1, (3, 1, 2), 1.0, healthy=True, commanded=True)
    assert is_over(pilot)
    assert played.done == ["arm", "rise 2.5", "go (3, 1, 2)", "land"]


def test_a_vehicle_without_an_order_is_never_commanded(pilot: Pilot, played: Played) -> None:
    assert steps(pilot, played, 20).phase is Phase.READY
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == []


def test_a_new_order_takes_the_place_of_the_one_before(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 2)
    pilot.fly(2, Target((4, 2, 4)))
    assert steps(pilot, played).order == 2
    assert played.done[-1] == "go (4, 2, 4)"
    assert steps(pilot, played).phase is Phase.ARRIVED


def test_who_is_to_land_flies_above_the_point_first(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is Phase.LANDING
    assert played.done[-2:] == ["go (6, 0, 2)", "land"]
    landed(played)
    assert steps(pilot, played).phase is Phase.LANDED


def test_who_is_to_land_outside_of_the_fence_lands_where_it_is(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((50, 0, 0), lands=True))
    assert steps(pilot, played).phase is Phase.LANDING
    assert played.done[-1] == "land"


def test_who_has_landed_is_not_commanded_at_the_end(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((6, 0, 0), lands=True))
    steps(pilot, played, 2)
    landed(played)
    steps(pilot, played)
    done = [*played.done]
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == done


def test_who_is_to_land_and_stands_on_the_ground_does_nothing(pilot: Pilot, played: Played) -> None:
    flying(pilot, Target((6, 0, 0), lands=True))
    assert steps(pilot, played).phase is Phase.LANDED
    assert played.done == []


def test_who_has_landed_takes_off_again(pilot: Pilot, played: Played) -> None:
    flying(pilot, Target((6, 0, 0), lands=True))
    steps(pilot, played)
    pilot.fly(2, THERE)
    assert steps(pilot, played, 3).phase is Phase.ARRIVED


def test_who_is_sent_elsewhere_while_it_lands_takes_off_again(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((6, 0, 0), lands=True))
    assert steps(pilot, played, 2).phase is Phase.LANDING
    pilot.fly(3, THERE)
    steps(pilot, played)
    played.seen = replace(played.seen, armed=False, in_air=False, place=(6, 0, 0))
    assert steps(pilot, played, 5) == State(
        "A", Phase.ARRIVED, 3, (3, 1, 2), 1.0, healthy=True, in_air=True, commanded=True
    )
    assert played.done[-5:] == ["land", "arm", "rise 2.5", "go (6, 0, 2.5)", "go (3, 1, 2)"]


def test_at_the_end_a_vehicle_may_hold(pilot: Pilot, played: Played) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.end(AtEnd.HOLD, waits=True)
    assert steps(pilot, played, 2).phase is Phase.ARRIVED
    assert is_over(pilot)
    assert played.done[-1] == "hold"


def test_what_another_guard_has_left_in_the_air_is_brought_down(pilot: Pilot, played: Played) -> None:
    played.seen = replace(GROUND, armed=True, in_air=True, mode="HOLD", place=(1, 1, 3))
    pilot.recover(AtEnd.LAND)
    steps(pilot, played, 4)
    assert is_over(pilot)
    assert played.done == ["land"]
