"""The closed loop: what robots report opens the next epoch, from a recording or a live source."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import pytest

from robochoc.model.outcome import EpochOutcome, Outcome, Verdict
from robochoc.model.problem import RemoveAgent, ScenarioEvent, Team
from robochoc.robots.closed_loop import TOGETHER_S, ClosedLoop, drones_of
from robochoc.robots.sink import Sink
from robochoc.robots.source import ReceivedMessage
from robochoc.ros.report_decoder import ReportDecoder
from robochoc.ros.source_feedback import SourceFeedback
from robochoc.run import solve
from tests.support.environments import SIMULATED, openings
from tests.support.example_teams import example, hangar
from tests.support.limits import HANG_S
from tests.support.ros_ends import SECOND, KeptSink, Tape, WaitedClock, publishers

SLICE_S = 1.0
"""How long the source is waited for at a time."""
PORTS = {"point": {"x": 3.0, "y": 1.0, "z": 3.0}}
"""Where Port flies first."""


def at(seconds: float, topic: str, fields: Mapping[str, object]) -> ReceivedMessage:
    kinds = ReportDecoder(drones_of(hangar()), "map").topics
    return ReceivedMessage(topic, kinds.get(topic, ""), fields, round(seconds * SECOND))


def listened(
    *messages: ReceivedMessage, sink: Sink | None = None, team: Team | None = None
) -> tuple[Outcome, ClosedLoop]:
    team = team or hangar()
    feedback = SourceFeedback(Tape(*messages), ReportDecoder(drones_of(team), "map"))
    loop = ClosedLoop(team, publishers(team, sink) if sink else [], feedback)
    return solve(team, SIMULATED, environment=loop), loop


def test_the_first_report_that_changes_the_problem_opens_an_epoch() -> None:
    outcome, loop = listened(
        at(1, "/nose/battery", {"percentage": 0.9}),
        at(2, "/port/blocked", PORTS),
        at(8, "/fin/out_of_order", {"data": "a motor"}),
        at(9, "/tail/battery", {"percentage": 0.1}),
    )
    assert openings(outcome) == ["the start", "port without 3", "-Fin", "-Tail"]
    assert outcome.assignment["port"] != 3
    assert loop.team.scenario == tuple(loop.events)
    assert len(loop.events) == outcome.events == 3


def test_reports_within_half_a_second_belong_together() -> None:
    messages = [at(2, "/port/blocked", PORTS), at(2.4, "/fin/out_of_order", {"data": ""})]
    assert openings(listened(*messages)[0]) == ["the start", "port without 3, -Fin"]
    later = [*messages, at(2.6, "/tail/battery", {"percentage": 0})]
    assert openings(listened(*later)[0]) == ["the start", "port without 3, -Fin", "-Tail"]


def test_reports_that_change_nothing_open_no_epoch() -> None:
    outcome, loop = listened(at(1, "/port/blocked", {"point": {"x": 50, "y": 50, "z": 50}}), at(2, "/port/pose", {}))
    assert openings(outcome) == ["the start"]
    assert "it changes nothing" in loop.notes[0]


def test_what_is_known_to_come_is_not_asked_for_again() -> None:
    team = replace(hangar(), scenario=(ScenarioEvent((RemoveAgent("Fin"),)),))
    outcome, _ = listened(at(1, "/fin/out_of_order", {"data": ""}), at(3, "/fin/battery", {"percentage": 0}), team=team)
    assert openings(outcome) == ["the start", "-Fin"]


def test_a_recordings_time_is_the_clock_of_what_is_published() -> None:
    sink = KeptSink()
    listened(at(100, "/port/blocked", PORTS), at(107, "/nose/battery", {"percentage": 1.0}), sink=sink)
    times = [at_ns / SECOND for *_, at_ns in sink.said]
    assert times == [100.0] * 6 + [100.0] + [107.0] * 6 + [107.0]
    assert sink.topics()[6::7] == ["/port/blocked", "/nose/battery"]


def test_what_was_heard_over_a_ros_is_not_said_there_again() -> None:
    sink = KeptSink(live=True)
    _, loop = listened(at(100, "/port/blocked", PORTS), sink=sink)
    assert set(sink.topics()) == {f"/{name.lower()}/waypoint" for name in hangar().order}
    assert loop.publishers[0].summary == "12 waypoints, 0 landings"


def test_who_leaves_lands() -> None:
    sink = KeptSink()
    _, loop = listened(at(1, "/fin/out_of_order", {"data": "a motor"}), sink=sink)
    assert loop.publishers[0].summary == "11 waypoints, 1 landing, 1 report"
    assert loop.mission is not None
    assert [drone.name for drone in loop.mission.drones] == sorted(hangar().order)
    assert [leg.opened_by for leg in loop.mission.legs] == ["the start", "-Fin"]
    assert [goal.lands for goal in loop.mission.legs[1].goals.values()] == [True, False, False, False, False, False]


@pytest.fixture
def waited(monkeypatch: pytest.MonkeyPatch) -> WaitedClock:
    """The clock of what waits for reports."""
    clock = WaitedClock()
    monkeypatch.setattr("robochoc.ros.source_feedback.time", clock)
    monkeypatch.setattr("robochoc.ros.source_feedback._SLICE_S", SLICE_S)
    return clock


def live(
    clock: WaitedClock, patience_s: float, *messages: ReceivedMessage, busy_s: float = 0.0
) -> tuple[ClosedLoop, list[float]]:
    """A loop with a live source, and when it has said that it waits."""
    tape = Tape(*messages, clock=clock)
    tape.busy_s = busy_s
    feedback = SourceFeedback(tape, ReportDecoder(drones_of(hangar()), "map"), patience_s)
    idle: list[float] = []
    feedback.idle = lambda: idle.append(clock.waited_s)
    return ClosedLoop(hangar(), (), feedback), idle


def test_a_live_source_is_waited_for_and_somebody_told_so(waited: WaitedClock) -> None:
    loop, idle = live(waited, 60, at(0, "/port/blocked", PORTS))
    outcome = solve(hangar(), SIMULATED, environment=loop)
    assert openings(outcome) == ["the start", "port without 3"]
    assert waited.waited_s == pytest.approx(60, abs=TOGETHER_S), "from the last decision on"
    assert len(idle) >= 60 / SLICE_S


class Audience:
    """Passes on to a closed loop what is found while the team searches on."""

    def __init__(self, loop: ClosedLoop) -> None:
        self.loop = loop
        self.shown: list[EpochOutcome] = []

    def improve(self, _team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        self.shown.append(epoch)
        self.loop.improve(epoch, withdrawn)

    def has_news(self, team: Team) -> bool:
        return self.loop.has_news(team)


@pytest.mark.usefixtures("a_second_a_look")
def test_a_report_while_the_team_searches_on_opens_the_next_epoch(waited: WaitedClock) -> None:
    """What would be better is of no use any more: the next epoch begins, and has a deadline of its own."""
    sink, patrol = KeptSink(), example("patrol")
    kind = ReportDecoder(drones_of(patrol), "map").topics["/west/out_of_order"]

    class Late(Tape):
        def next(self, wait_s: float) -> ReceivedMessage | None:
            return super().next(wait_s) if sink.said else None

    tape = Late(ReceivedMessage("/west/out_of_order", kind, {"data": "a motor"}, 0), clock=waited)
    loop = ClosedLoop(
        patrol, publishers(patrol, sink), SourceFeedback(tape, ReportDecoder(drones_of(patrol), "map"), 5.0)
    )
    audience = Audience(loop)
    options = replace(SIMULATED, protocol="dsa", settings={"cycles": "1000000"}, deadline=5, improve=2000)
    outcome = solve(patrol, options, environment=loop, audience=audience)
    assert openings(outcome) == ["the start", "-West"]
    first, second = outcome.epochs
    assert [len(first.improvements) < 9, len(second.improvements) >= 1] == [True, True]
    assert first.improvements[-1].at_s < 500
    assert [epoch.opened_by for epoch in audience.shown] == sorted(
        [epoch.opened_by for epoch in audience.shown], key=["the start", "-West"].index
    )
    assert audience.shown[-1].assignment == second.assignment == outcome.assignment
    assert "west" not in outcome.assignment


def test_the_wait_begins_when_robots_are_where_they_were_sent(waited: WaitedClock) -> None:
    loop, _ = live(waited, 10, busy_s=45)
    solve(hangar(), SIMULATED, environment=loop)
    assert waited.waited_s == pytest.approx(55, abs=2 * SLICE_S)


def test_robots_on_their_way_are_waited_for_no_longer_than_all_may_take(waited: WaitedClock) -> None:
    loop, _ = live(waited, 10, busy_s=10 * HANG_S)
    solve(hangar(), replace(SIMULATED, timeout=HANG_S), environment=loop)
    assert 0 < waited.waited_s <= HANG_S + SLICE_S


def test_waiting_is_bounded_by_the_time_for_all(waited: WaitedClock) -> None:
    loop, _ = live(waited, 10 * HANG_S)
    outcome = solve(hangar(), replace(SIMULATED, timeout=HANG_S), environment=loop)
    assert (outcome.verdict, openings(outcome)) == (Verdict.SOLUTION, ["the start"])
    assert 0 < waited.waited_s <= HANG_S + SLICE_S


def test_the_team_of_a_run_nobody_changed_is_as_its_files_have_it() -> None:
    sink = KeptSink(live=True)
    loop = ClosedLoop(hangar(), publishers(hangar(), sink))
    loop.publish(solve(hangar(), SIMULATED))
    assert (loop.team, loop.mission) == (hangar(), None)
    assert loop.publishers[0].summary == "6 waypoints, 0 landings"
