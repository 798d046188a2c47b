"""A pilot that fails, by an error that nobody foresaw, brings its vehicle down all the same."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robochoc.ros.autopilots.fleet import AtEnd
from robochoc.ros.autopilots.limits import END_S
from robochoc.ros.autopilots.messages import Phase, Target
from robochoc.ros.autopilots.pilot import Pilot
from tests.support.played_autopilot import Ordered, Played, flying, is_over, steps


def broken(*_: object, **__: object) -> None:
    raise ValueError("nobody foresaw it")


FAILED = "its pilot failed: ValueError: nobody foresaw it"


@pytest.mark.parametrize("what", ["look", "go_to"])
def test_who_has_a_pilot_that_fails_is_out_and_lands(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    pilot.fly(2, Target((4, 2, 4)))
    monkeypatch.setattr(played, what, broken)
    assert steps(pilot, played).why == FAILED
    assert steps(pilot, played, 3).phase is Phase.OUT
    assert played.done.count("land") == 1
    pilot.end(AtEnd.LAND, waits=False)
    steps(pilot, played)
    assert is_over(pilot)


def test_who_cannot_be_planned_for_lands_all_the_same(
    pilot: Ordered, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    for method in ("see", "lose", "clearance", "is_clear_below"):
        monkeypatch.setattr(pilot.traffic, method, broken)
    assert steps(pilot, played).why == FAILED
    assert played.done[-1] == "land"


def test_a_landing_that_fails_is_tried_again_and_given_up_at_last(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    for method in ("look", "land"):
        monkeypatch.setattr(played, method, broken)
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played, 3, 1.0)
    assert not is_over(pilot)
    steps(pilot, played, 1, 2 * END_S)
    assert is_over(pilot)


def test_whom_a_person_flies_is_left_alone_by_a_pilot_that_fails(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying(pilot)
    steps(pilot, played, 3)
    played.seen = replace(played.seen, mode="POSCTL")
    monkeypatch.setattr(pilot, "_trouble", broken)
    steps(pilot, played, 3)
    assert "land" not in played.done


def test_who_was_never_commanded_is_not_commanded_by_a_pilot_that_fails(
    pilot: Pilot, played: Played, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps(pilot, played, 2)
    monkeypatch.setattr(played, "look", broken)
    pilot.end(AtEnd.LAND, waits=True)
    steps(pilot, played)
    assert is_over(pilot)
    assert played.done == []
