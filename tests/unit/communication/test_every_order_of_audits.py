"""A master that does not trust its robots, in every order: it never doubts honest ones, and notices lost messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pytest

from robochoc.communication.master_loop import TRANSIT_S
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.quiescence import MessageCounts
from robochoc.communication.search_state import SearchState
from robochoc.model.outcome import Verdict
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.explored_audit import Audit, AuditedRobot, audited_search
from tests.support.explored_robots import RobotView
from tests.support.explored_team import ExploredTeam, Found
from tests.support.scripted_senders import TEAMS, Script, all_scripts, scripted

pytestmark = plain_python_only

CONCLUDED: Script = {"RA": ("RB",), "RB": ("RA", "!")}
LATE: dict[str, Any] = {"passes": 5, "pass_s": 1.2 * TRANSIT_S, "patient": True}
"""Time passes only when nothing else can happen: no message is under way for longer than `TRANSIT_S`."""


def trusted(result: object, robots: Mapping[str, RobotView]) -> str:
    """Return what the master holds against the robots, or why the result is wrong."""
    if not isinstance(result, Audit):
        return f"the search has failed: {result}"
    search = result.result
    witness = None if search.witness is None else robots[search.witness].verdict
    is_right = search.verdict == (witness or Verdict.SOLUTION)
    return result.stuck or "".join(doubt.why for doubt in result.doubts) or ("" if is_right else "a wrong verdict")


def stuck_or_trusted(result: object, robots: Mapping[str, RobotView]) -> str:
    """As `trusted`; the search may be stuck, since a message may be lost, which is no robot's fault."""
    is_stuck = isinstance(result, Audit) and result.stuck and result.result.verdict == Verdict.UNKNOWN
    return "" if is_stuck else trusted(result, robots)


def audited(script: Script, judge: Callable[..., str] = trusted, **options: Any) -> Found:  # noqa: ANN401 - as `ExploredTeam`
    program = audited_search(TEAMS[2], scripted(script))
    return ExploredTeam(program, judge, kind=AuditedRobot, **options).explore(50_000)


@count("messages", fast=3, slow=5)
def test_honest_robots_are_never_doubted(messages: int) -> None:
    for script in all_scripts(messages):
        found = audited(script, **LATE)
        assert (found.fault, found.is_complete) == ("", True), (script, found)


@count("messages", fast=2, slow=4)
def test_a_lost_message_ends_the_search_without_a_verdict(messages: int) -> None:
    for script in all_scripts(messages):
        found = audited(script, stuck_or_trusted, losses=1, **LATE)
        assert (found.fault, found.is_complete) == ("", True), (script, found)


def test_a_robot_concludes_although_a_message_is_under_way_or_lost() -> None:
    assert not audited(CONCLUDED, **LATE).fault
    assert not audited(CONCLUDED, stuck_or_trusted, losses=1, **LATE).fault


def in_one_wave(self: AuditedSearchState, name: str, wave: int, counts: MessageCounts) -> str:
    """Compare the sums of one wave: reports from different moments seem to contradict each other."""
    fault = str(COUNT(self, name, wave, counts))
    total = self.counters.total
    if total is not None and total.received > total.sent:
        self.stuck = "more messages were received than sent"
    return fault


COUNT: Callable[..., str] = SearchState._count  # noqa: SLF001 - the planted fault replaces its override


def test_a_planted_fault_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AuditedSearchState, "_count", in_one_wave)
    assert audited({"RA": ("", "RB RB"), "RB": ("RA", "", "")}).fault == "more messages were received than sent"
