"""Snapshots that all robots check before they count, and what a robot keeps of those that it has told."""

from __future__ import annotations

import pytest

from robochoc.communication.control import RobotSnapshot
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.checked_snapshots import CheckedSnapshots
from robochoc.communication.network.control_messages import CheckRequest, CheckResult, Recall, ToRobot
from robochoc.communication.network.framing import FrameRefusedError
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.searcher import SnapshotValues, values_for_recall
from robochoc.formats import PREDEFINED
from robochoc.model.problem import Constraint
from robochoc.protocols.findings import NO_FINDINGS, Findings, Incumbent, Trail
from robochoc.protocols.local_search.dsa import DSA
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.agents import robot_of
from tests.support.problems import team_of
from tests.support.sparse_teams import profiles_of

PAIRS = (("A", "B"), ("B", "C"))
TEAM = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("C", PREDEFINED["ne"], pair, pair) for pair in PAIRS])
ROBOTS = ("RA", "RB", "RC")
NOW = {"RA": {"A": 1}, "RB": {"B": 2}, "RC": {"C": 1}}
THEN = {"RA": {"A": 2}, "RB": {"B": 1}, "RC": {"C": 2}}


class Round:
    """The snapshots of a search by three robots, and what the master has sent them."""

    def __init__(self) -> None:
        members = NetworkMembers(ROBOTS)
        for name, profile in profiles_of(TEAM).items():
            members.register(name, profile, "incarnation").joined = True
        self.state = AuditedSearchState(1, ROBOTS, declared=members.declared(DSA.traits))
        self.sent: list[tuple[str, ToRobot]] = []
        self.snapshots = CheckedSnapshots(self.state, members, lambda name, word: self.sent.append((name, word)))

    def begin(self) -> None:
        number = self.state.start_snapshot()
        assert number is not None
        self.snapshots.ask(number)

    def taken(self) -> list[ToRobot]:
        """Return the messages that RB was sent since the last call."""
        sent, self.sent = [word for name, word in self.sent if name == "RB"], []
        return sent

    def tell(self, number: int, have: dict[str, dict[str, int]], findings: Findings = NO_FINDINGS) -> None:
        for name in ROBOTS:
            assert not self.state.handle(name, RobotSnapshot(1, number, have[name], 0, findings))

    def check(self, number: int, *, allowed: bool = True) -> None:
        for name in ROBOTS:
            assert not self.state.handle(name, CheckResult(1, allowed, 0, snapshot=number))


def test_a_snapshot_counts_once_all_have_checked_it() -> None:
    around = Round()
    around.begin()
    assert around.taken() == [Recall(1, 1)]
    around.tell(1, NOW)
    assert around.snapshots.advance() is None
    assert around.taken() == [CheckRequest(1, {"A": 1, "C": 1}, 1)]
    around.check(1)
    found = around.snapshots.advance()
    assert found is not None
    assert (found.assignments, around.snapshots.number, {*around.snapshots.checks}) == (NOW, 1, {*ROBOTS})
    assert around.snapshots.advance() is None


def test_what_was_checked_before_is_not_checked_again() -> None:
    around = Round()
    for number in (1, 2):
        around.begin()
        around.tell(number, NOW)
        around.snapshots.advance()
        if number == 1:
            around.check(1)
            around.snapshots.advance()
    assert [type(word) for word in around.taken()] == [Recall, CheckRequest, Recall]
    assert around.snapshots.number == 1


def test_the_last_cycle_that_all_have_completed_is_asked_for() -> None:
    around = Round()
    around.begin()
    for name, cycle in zip(ROBOTS, (7, 5, 6), strict=True):
        around.state.handle(name, RobotSnapshot(1, 1, NOW[name], 0, Findings(trail=Trail([], cycle))))
    assert around.snapshots.advance() is None
    assert around.taken() == [Recall(1, 1), Recall(1, 2, cycle=5)]
    around.tell(2, THEN)
    assert around.snapshots.advance() is None
    assert around.taken() == [CheckRequest(1, {"A": 2, "C": 2}, 2)]
    around.check(2)
    found = around.snapshots.advance()
    assert found is not None
    assert found.assignments == THEN


def test_the_cheapest_that_a_robot_has_heard_of_is_asked_for_and_one_that_does_not_hold_only_once() -> None:
    around = Round()
    false, true = (Incumbent(cost, {"RA": (1,), "RB": (value,), "RC": (1,)}) for cost, value in ((0, 1), (3, 2)))
    for number, (best, known) in enumerate(((false, 1), (true, 2), (None, 3)), 1):
        around.begin()
        first = 2 * number - 1
        for name, one in zip(ROBOTS, (true, false, false), strict=True):
            around.state.handle(name, RobotSnapshot(1, first, THEN[name], 0, Findings(best=one)))
        assert around.snapshots.advance() is None or best is None
        recalls = [word for word in around.taken() if isinstance(word, Recall)]
        assert recalls[1:] == ([Recall(1, first + 1, value=best.values["RB"])] if best else []), known
        if best is not None:
            around.tell(first + 1, NOW if best is true else THEN)
            around.snapshots.advance()
            around.check(first + 1, allowed=best is true)
            around.snapshots.advance()
    assert around.snapshots.number == 4


def test_nobody_checks_what_it_was_not_asked_to() -> None:
    around = Round()
    why = "it sent a check that was not requested"
    assert around.state.handle("RA", CheckResult(1, allowed=True, cost=0, snapshot=3)) == why
    around.state.start_check(3)
    assert not around.state.handle("RA", CheckResult(1, allowed=True, cost=0, snapshot=3))
    assert around.state.handle("RA", CheckResult(1, allowed=True, cost=0, snapshot=3)) == why


# What a robot keeps


def test_a_robot_keeps_the_last_snapshot_and_the_one_that_counts() -> None:
    kept = SnapshotValues()
    kept.note(1, {"A": 1})
    kept.adopt(1, published=False)
    kept.note(2, {"A": 2})
    assert (kept.at(1), kept.at(2), kept.adopted) == ({"A": 1}, {"A": 2}, None)
    kept.adopt(1, published=True)
    kept.note(3, {"A": 3})
    assert kept.adopted == {"A": 1}
    with pytest.raises(FrameRefusedError, match="snapshot 2, which is not known"):
        kept.adopt(2, published=True)
    kept.adopt(0, published=True)
    assert kept.adopted is None


def test_what_a_robot_had_in_a_cycle() -> None:
    compiled = CompiledTeam(TEAM)
    agent = robot_of(DSA, TEAM, "RB")
    agent.value = 0
    agent._trail, agent.cycle = [(0, 1), (4, 0)], 6  # noqa: SLF001 - as if it had come so far

    def asked(cycle: int | None = None, value: tuple[int | None, ...] | None = None) -> dict[str, int]:
        return values_for_recall(Recall(1, 1, cycle, value), agent, compiled["RB"])

    assert [asked(cycle) for cycle in (-1, 0, 3, 4, 6)] == [{}, {"B": 2}, {"B": 2}, {"B": 1}, {"B": 1}]
    assert (asked(), asked(value=(2,)), asked(value=(None,))) == ({"B": 1}, {"B": 2}, {})
