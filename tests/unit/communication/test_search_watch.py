"""Snapshots of a search that goes on: whose answers count, and what a master refuses to believe."""

from __future__ import annotations

from robochoc.communication.control import RobotSnapshot
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.plausibility import Declarations
from robochoc.communication.search_state import SearchState
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Domain
from robochoc.protocols.findings import NO_FINDINGS, Findings, Incumbent
from tests.support.cases import looped

NAMES = ("A", "B")


def has(
    value: int, number: int = 1, *, epoch: int = 0, lost: int = 0, findings: Findings = NO_FINDINGS
) -> RobotSnapshot:
    return RobotSnapshot(epoch, number, {f"x{value}": value}, lost, findings)


def test_a_snapshot_is_what_all_robots_have_answered() -> None:
    state = SearchState(0, NAMES)
    assert state.completed_snapshot() is None
    assert state.start_snapshot() == 1
    assert state.start_snapshot() is None, "one at a time"
    assert state.handle("A", has(1, lost=2)) == ""
    assert state.completed_snapshot() is None
    assert state.handle("B", has(2, findings=Findings(bound=3))) == ""
    found = state.completed_snapshot()
    assert found is not None
    assert (found.verdict, found.witness) == (Verdict.UNKNOWN, None)
    assert found.assignments == {"A": {"x1": 1}, "B": {"x2": 2}}
    assert found.findings["B"].bound == 3
    assert found.metrics.lost_messages == 2
    assert state.completed_snapshot() is None, "once"
    assert state.start_snapshot() == 2


def test_what_was_not_asked_for_is_a_fault_and_of_another_epoch_it_is_nothing() -> None:
    state = SearchState(3, NAMES)
    assert state.handle("A", has(1, epoch=3)) == "it sent a snapshot that was not requested"
    state.start_snapshot()
    assert state.handle("A", has(1, 7, epoch=3)) == "it sent a snapshot that was not requested"
    assert state.handle("A", has(1, epoch=2)) == ""
    assert state.handle("A", has(1, epoch=3)) == ""
    assert state.handle("A", has(1, epoch=3)) == "it sent a snapshot that was not requested"
    assert state.completed_snapshot() is None


@looped(
    ("said", "fault"),
    [
        (has(9), "it has reported values that it cannot have"),
        (RobotSnapshot(0, 1, {"x1": 1, "x2": 2}, 0, NO_FINDINGS), "it has reported a value of x2, which is B's"),
        (has(1, lost=-1), "it has reported counts that cannot be"),
        (has(1, findings=Findings(bound=-1)), "it has reported impossible costs"),
        (has(1, findings=Findings(best=Incumbent(1, {"C": (1,)}))), "it has reported a robot that is not in the team"),
    ],
)
def test_what_a_robot_across_machines_cannot_have_is_refused(said: RobotSnapshot, fault: str) -> None:
    shown = {name: {variable: Domain(variable, (range(1, 3),))} for name, variable in (("A", "x1"), ("B", "x2"))}
    state = AuditedSearchState(0, NAMES, None, Declarations(shown=shown))
    state.start_snapshot()
    assert state.handle("A", said) == fault
    assert state.handle("A", has(1)) == ""
