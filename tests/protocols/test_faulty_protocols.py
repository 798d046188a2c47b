"""Runs within one program, of protocols that do what a protocol must not do, or more than one usually does."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from select import select

import pytest

from robochoc.communication.processes import processes
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.processes.robot_link import RobotLink
from robochoc.communication.search_result import RobotsLostError
from robochoc.journal.events import AnyEvent, Lost
from robochoc.model.outcome import Verdict
from robochoc.protocols.protocol import Protocol
from tests.support.cases import looped
from tests.support.examples import count
from tests.support.faults import open_descriptors, own_children
from tests.support.faulty_protocols import (
    FLOOD,
    TEAM,
    AsksForStranger,
    Floods,
    HangsUp,
    Leaves,
    Raises,
    RaisesAtOnce,
    SaysMuch,
    Speaks,
    Spins,
    TalksNonsense,
)
from tests.support.limits import HANG_S

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")


def speaking(protocol: type[Protocol], *, timeout: float | None = None) -> tuple[Verdict, dict[str, int]]:
    """Let a team of four speak `protocol`; whatever comes of it, nothing may be left in this process."""
    before = open_descriptors(), own_children()
    try:
        result = ProcessesRun(TEAM, protocol).run(timeout)
    finally:
        assert (open_descriptors(), own_children()) == before
    return result.verdict, dict(result.metrics.messages)


FIRST, SECOND, *_ = (robot.name for robot in TEAM.robots)


@looped(("protocol", "lost", "why"), [
    (Raises, FIRST, r"ValueError: out of ideas \(.*faulty_protocols.py:\d+\)"),
    (RaisesAtOnce, FIRST, r"ValueError: no ideas at all"),
    (Leaves, FIRST, r"its process ended with status 7"),
    (HangsUp, FIRST, r"its process cannot be reached any more"),
    (AsksForStranger, FIRST, r"it sent a message to 'Robot9.9', which is not a robot of the team"),
    (TalksNonsense, SECOND, rf"BadMessageError: {FIRST} sent {SECOND} an invalid message"),
])  # fmt: skip
def test_a_robot_that_fails_is_named(protocol: type[Protocol], lost: str, why: str) -> None:
    with pytest.raises(RobotsLostError) as caught:
        speaking(protocol)
    assert lost in caught.value.robots
    assert re.search(why, caught.value.robots[lost])


def test_observers_hear_who_was_lost() -> None:
    events: list[AnyEvent] = []
    with pytest.raises(RobotsLostError) as caught:
        ProcessesRun(TEAM, Leaves, observer=events.append).run()
    assert {event.robot: event.why for event in events if isinstance(event, Lost)} == caught.value.robots


def test_more_than_pipes_hold() -> None:
    assert speaking(Floods) == (Verdict.SOLUTION, {"Word": 2 * FLOOD})


def test_a_message_of_a_megabyte() -> None:
    assert speaking(SaysMuch) == (Verdict.SOLUTION, {"Word": len(TEAM.robots)})


def test_deaf_robots_do_not_outlive_the_time_limit() -> None:
    verdict, _ = speaking(Spins, timeout=0.1)
    assert verdict is Verdict.UNKNOWN


class ReadsOneReportAtATime(ProcessesRun):
    """Its time for reports is over after each of them."""

    def _serve_until(self, done: Callable[[], bool], deadline: float) -> None:
        if self.state.verdict is None:
            return super()._serve_until(done, deadline)
        silent = len(self._silent())
        while silent and len(self._silent()) == silent:
            self._serve(HANG_S, None)
        return None

    def _serve(self, patience_s: float, _deadline: float | None) -> None:
        for robot in self._pool.readable(patience_s)[:1]:
            for message in self._pool.receive(robot):
                self._handle(robot, message)


def test_reports_that_only_wait_to_be_read_are_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(RobotLink, "is_computing", False)
    assert ReadsOneReportAtATime(TEAM, Speaks).run().verdict is Verdict.SOLUTION


def test_who_reports_while_it_is_looked_at_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parent may lose the processor between its wait and its look: a robot is idle then as its report is there."""

    def idle_with_its_report(robot: RobotLink) -> bool:
        select([robot.control], [], [], HANG_S)
        return False

    monkeypatch.setattr(processes, "REPORTS_S", 0.0)
    monkeypatch.setattr(RobotLink, "is_computing", property(idle_with_its_report))
    assert ProcessesRun(TEAM, Speaks).run().verdict is Verdict.SOLUTION


@count("runs", 3, 50)
def test_many_runs_leave_nothing_open(runs: int) -> None:
    before = open_descriptors()
    for _ in range(runs):
        speaking(Speaks)
    assert open_descriptors() == before
