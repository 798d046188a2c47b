"""The closed loop with the simulated flight: an obstacle, a motor that stops, and what the team makes of them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from robochoc.flight.layout import Point
from robochoc.flight.log import FlightLog
from robochoc.flight.mission import Mission
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import RemoveAgent, RemoveValue, ScenarioEvent
from robochoc.robots.closed_loop import ClosedLoop, drones_of
from robochoc.robots.simulated_feedback import CannotFlyError, FlightSettings, SimulatedFeedback, UnknownDroneError
from robochoc.run import Options, Runtime, solve
from robochoc.verification.checker import violations
from tests.support.example_teams import hangar

PLACE: Point = (3.0, 1.0, 3.0)
"""Where Port is first sent."""
MET = FlightSettings(obstacles=(PLACE,), failures=(("Fin", 7.0),))
SIMULATED = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)


@dataclass
class Looped:
    """What a closed loop has come to."""

    outcome: Outcome
    loop: ClosedLoop
    flown: FlightLog
    mission: Mission


def looped(surroundings: FlightSettings, options: Options = SIMULATED, *, scale: float | None = None) -> Looped:
    flying = SimulatedFeedback(surroundings)
    loop = ClosedLoop(hangar(), (), flying, scale=scale)
    outcome = solve(hangar(), options, environment=loop)
    flown = flying.log()
    assert flown is not None
    assert loop.mission is not None
    return Looped(outcome, loop, flown, loop.mission)


@pytest.fixture(scope="module")
def met() -> Looped:
    return looped(MET)


def openings(outcome: Outcome) -> list[str]:
    return [epoch.opened_by for epoch in outcome.epochs]


@pytest.mark.parametrize("runtime", [Runtime.SIMULATOR, pytest.param(Runtime.PROCESSES, marks=pytest.mark.more)])
def test_an_obstacle_and_a_drone_that_falls_out(runtime: Runtime, met: Looped) -> None:
    done = met if runtime is Runtime.SIMULATOR else looped(MET, replace(SIMULATED, runtime=runtime))
    outcome, flown = done.outcome, done.flown
    assert openings(outcome) == ["the start", "port without 3", "-Fin"]
    assert done.loop.events == [ScenarioEvent((RemoveValue("port", 3),)), ScenarioEvent((RemoveAgent("Fin"),))]
    assert (outcome.verdict, outcome.verified, outcome.protocol) == (Verdict.SOLUTION, True, "dynabt")
    assert all(epoch.verified for epoch in outcome.epochs)
    now = team_after_events(done.loop.team, outcome.events)
    assert list(violations(now, outcome.assignment)) == []
    assert "Fin" not in now
    assert outcome.assignment["port"] != PLACE[2]

    # They have flown there: who flies is where its topic says, and nobody where the obstacle is.
    for number, drone in enumerate(done.mission.drones):
        here = flown.positions[-1, number]
        if drone.robot == "Fin":
            assert here[2] < 0.2
            assert math.isnan(flown.errors_m[number])
            continue
        level = outcome.assignment[drone.robot.lower()]
        assert done.mission.legs[-1].goals[number].at[2] == level
        assert math.dist(here, done.mission.legs[-1].goals[number].at) < 0.01
        assert math.dist(here, PLACE) > 0.5
    assert [leg.title for leg in flown.legs] == [leg.opened_by for leg in done.mission.legs] == openings(outcome)
    port = [drone.name for drone in done.mission.drones].index("Port")
    assert float(np.sqrt(np.square(flown.positions[:, port] - PLACE).sum(1)).min()) > 0.4
    assert flown.nearest is not None
    assert flown.nearest.distance_m >= flown.distance


def test_what_still_stands_saves_messages(met: Looped) -> None:
    anew = solve(met.loop.team, Options(protocol="abt", runtime=Runtime.SIMULATOR))
    assert openings(anew) == openings(met.outcome)
    saved = [
        (sum(mine.metrics.messages.values()), sum(theirs.metrics.messages.values()))
        for mine, theirs in zip(met.outcome.epochs, anew.epochs, strict=True)
    ]
    assert saved[0][0] == saved[0][1]
    assert all(mine * 2 < theirs for mine, theirs in saved[1:]), saved


def test_the_same_again(met: Looped) -> None:
    again = looped(MET)
    assert [epoch.assignment for epoch in met.outcome.epochs] == [epoch.assignment for epoch in again.outcome.epochs]
    assert np.array_equal(met.flown.positions, again.flown.positions)
    assert met.flown.legs == again.flown.legs


def test_two_things_at_once_are_two_epochs_or_one_as_they_come() -> None:
    apart = looped(replace(MET, failures=(("Fin", 3.5),)))
    assert openings(apart.outcome) == ["the start", "port without 3", "-Fin"]
    assert [leg.title for leg in apart.flown.legs] == openings(apart.outcome)
    together = looped(replace(MET, failures=(("Fin", 2.8),)))
    assert openings(together.outcome) == ["the start", "port without 3, -Fin"]


def test_an_obstacle_where_nobody_is_sent_changes_nothing() -> None:
    calm = looped(FlightSettings(obstacles=((1.0, 5.0, 2.0),)))
    assert openings(calm.outcome) == ["the start"]
    assert np.nanmax(calm.flown.errors_m) < 0.01


def test_a_unit_may_be_longer_than_a_metre() -> None:
    done = looped(MET, scale=2.0)
    assert openings(done.outcome)[1] == "port without 3"
    assert np.nanmax(done.flown.errors_m) < 0.01
    assert done.flown.obstacles == ((6.0, 2.0, 6.0),)


def test_who_falls_when_all_hover_is_missed_too() -> None:
    late = looped(replace(MET, failures=(("Fin", 4.5),)))
    assert openings(late.outcome) == ["the start", "port without 3", "-Fin"]


def test_one_after_the_other_falls_out() -> None:
    failures = tuple((name, 2.0 + number * 0.9) for number, name in enumerate(hangar().order))
    last = looped(FlightSettings(failures=failures))
    assert last.outcome.verdict is Verdict.SOLUTION
    assert last.outcome.assignment == {}
    assert last.outcome.epochs[-1].robots == ()
    assert sorted(name for words in openings(last.outcome)[1:] for name in words.split(", ")) == sorted(
        f"-{name}" for name in hangar().order
    )


def test_who_is_to_fail_has_to_be_there() -> None:
    with pytest.raises(UnknownDroneError, match="no drone 'Wing' to fail: choose Fin, Nose"):
        FlightSettings(failures=(("Wing", 1.0),)).check(drones_of(hangar()))


def test_places_nearer_than_the_distance_to_keep_are_refused() -> None:
    with pytest.raises(CannotFlyError, match="the minimum is 5 m"):
        looped(FlightSettings(distance=5.0))
