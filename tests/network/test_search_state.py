"""The state of a search: who is ready, when it is over, and what came of it."""

from __future__ import annotations

from robochoc.communication.control import Conclusion, Counters, EpochMessage, Ready
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import (
    Charge,
    CheckResult,
    DetailedReport,
    Exchanged,
    ProtocolMessage,
)
from robochoc.communication.network.plausibility import Declarations, fault_of_check
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.findings import NO_FINDINGS, Findings
from tests.support.cases import looped

ROBOTS = ("R1", "R2", "R3")


def account(epoch: int = 1, values: dict[str, int] | None = None, to: str = "R3", **spent: int) -> DetailedReport:
    """What a robot reports that has sent all its messages `to` one, and heard nothing."""
    sent = spent.pop("ok", 0)
    exchanged = {to: Exchanged(sent)} if sent else {}
    return DetailedReport(
        epoch, values or {}, Metrics(messages={"Ok": sent}, **spent), NO_FINDINGS, bool(values), exchanged
    )


def begun(state: AuditedSearchState) -> AuditedSearchState:
    """The search is ordered."""
    state.ordered = True
    return state


def all_hear(state: AuditedSearchState, word: EpochMessage) -> None:
    for name in ROBOTS:
        assert not state.handle(name, word)


def waved(state: AuditedSearchState, sent: int, received: int) -> None:
    """Ask all, who answer with these counters each."""
    all_hear(state, Counters(1, state.counters.start_wave(), sent, received))


def test_ready_when_all_are() -> None:
    state = AuditedSearchState(1, ROBOTS)
    for name in ROBOTS:
        assert not state.ready
        state.handle(name, Ready(1))
    assert state.ready


def test_nothing_is_awaited_before_the_first_search() -> None:
    state = AuditedSearchState()
    assert state.ready
    assert not state.handle("R1", Ready(0))
    assert not state.handle("R1", DetailedReport(0, {"X": 1}, Metrics(), NO_FINDINGS, assigned=True))
    assert state.result(0).verdict is Verdict.UNKNOWN
    assert not state.assigned


@looped("epoch", [0, 1, 3])
def test_late_words_of_other_searches_say_nothing(epoch: int) -> None:
    state = AuditedSearchState(2, ROBOTS)
    for word in (
        Ready(epoch),
        Counters(epoch, 0, 7, 7),
        Conclusion(epoch, "no-solution"),
        account(epoch, {"X": 1}),
        CheckResult(epoch, allowed=False, cost=5),
    ):
        all_hear(state, word)
    assert not state.ready
    assert (state.verdict, state.pending_reports, state.unchecked) == (None, ROBOTS, True)
    assert (state.cost, state.counters.sent, state.wave_due) == (0, 0, False)


def test_strangers_say_nothing() -> None:
    state = AuditedSearchState(1, ROBOTS)
    for word in (Ready(1), Counters(1, 0, 1, 1), Conclusion(1, "solution"), account(1, {"X": 1})):
        assert not state.handle("R9", word)
    assert state.verdict is None
    assert not state.assigned


@looped("verdict", ["", "bogus", "SOLUTION", "Solution "])
def test_a_verdict_that_is_none_is_refused(verdict: str) -> None:
    state = begun(AuditedSearchState(1, ROBOTS))
    assert state.handle("R1", Conclusion(1, verdict)).startswith("it has concluded an invalid verdict")
    assert state.verdict is None


def test_words_that_are_not_for_the_master_are_told() -> None:
    assert AuditedSearchState(1, ROBOTS).handle("R1", ProtocolMessage(1, 0, b"")) == "its message is not for the master"


def quiet(state: AuditedSearchState) -> bool:
    """Whether nobody will ever say anything again."""
    return state.counters.quiescent


def due(state: AuditedSearchState) -> bool:
    """Whether it is worth asking all."""
    return state.wave_due


def enough(state: AuditedSearchState) -> bool:
    """Whether there were messages enough."""
    return state.broken_off


def test_two_waves_of_equal_sums_are_quiet() -> None:
    state = begun(AuditedSearchState(1, ROBOTS))
    assert not due(state)
    all_hear(state, Counters(1, 0, 2, 2))
    assert due(state)
    waved(state, 2, 2)
    assert state.counters.quiescent


def test_news_between_two_waves_are_not_quiet() -> None:
    state = begun(AuditedSearchState(1, ROBOTS))
    all_hear(state, Counters(1, 0, 2, 2))
    waved(state, 3, 3)
    assert not quiet(state)
    assert state.wave_due
    waved(state, 3, 3)
    assert quiet(state)


def test_what_is_under_way_is_not_quiet() -> None:
    state = AuditedSearchState(1, ROBOTS)
    for _ in range(3):
        waved(state, 3, 2)
    assert not state.counters.quiescent
    assert not state.wave_due


def test_a_limit_on_messages_breaks_off() -> None:
    state = begun(AuditedSearchState(1, ROBOTS, max_messages=9))
    assert state.wave_due
    waved(state, 2, 0)
    assert not enough(state)
    assert state.wave_due  # after each change
    waved(state, 2, 0)
    assert state.next_wave() is None  # without one, only from time to time
    all_hear(state, Counters(1, state.next_wave(wanted=True) or 0, 3, 0))
    assert state.broken_off
    assert state.result(0).verdict is Verdict.UNKNOWN


def test_a_verdict_and_its_witness() -> None:
    state = begun(AuditedSearchState(1, ROBOTS))
    state.handle("R2", Conclusion(1, "no-solution"))
    all_hear(state, account())
    result = state.result(1.5)
    assert (result.verdict, result.witness) == (Verdict.NO_SOLUTION, "R2")
    assert result.metrics.wall_s == 1.5


def test_accounts_make_the_result() -> None:
    state = AuditedSearchState(1, ROBOTS)
    state.verdict = Verdict.SOLUTION
    state.handle("R1", account(1, {"X": 1}, ok=3, bytes=10, largest=4, ncccs=5, checks=6))
    state.handle("R2", account(1, {"Y": 2}, ok=4, bytes=20, largest=8, ncccs=1, checks=9))
    assert list(state.pending_reports) == ["R3"]
    state.handle("R3", DetailedReport(1, {}, Metrics(), Findings(bound=4), assigned=False))
    assert not list(state.pending_reports)
    result = state.result(0)
    assert result.assignments == {"R1": {"X": 1}, "R2": {"Y": 2}, "R3": {}}
    assert (result.metrics.messages, result.metrics.bytes, result.metrics.largest) == ({"Ok": 7}, 30, 8)
    assert (result.metrics.ncccs, result.metrics.checks) == (5, 15)
    assert result.findings["R3"] == Findings(bound=4)
    assert state.assigned == {"R1": True, "R2": True, "R3": False}


def test_a_lost_robot_is_waited_for_no_longer_and_its_words_are_void() -> None:
    state = AuditedSearchState(1, ROBOTS)
    state.handle("R1", Ready(1))
    state.handle("R2", Ready(1))
    state.handle("R3", Conclusion(1, "no-solution"))
    state.handle("R3", account(1, {"Z": 1}))
    state.lose("R3", "it fell")
    state.lose("R3", "again")
    assert state.ready
    assert state.broken_off
    assert state.pending_reports == ("R1", "R2")
    state.handle("R3", account(1, {"Z": 2}))
    state.handle("R1", account(1, {"X": 1}))
    state.handle("R2", account(1, {"Y": 1}))
    result = state.result(0)
    assert (result.verdict, result.witness, result.lost) == (Verdict.UNKNOWN, None, {"R3": "it fell"})
    assert "R3" not in result.assignments


def checked(state: AuditedSearchState) -> bool:
    """Whether all have held their constraints against the decision."""
    assert not (state.unchecked and state.held)
    return not state.unchecked


def test_all_have_to_check() -> None:
    state = AuditedSearchState(1, ROBOTS)
    all_hear(state, account(1, {"X": 1}))
    state.handle("R1", CheckResult(1, allowed=True, cost=2))
    state.handle("R2", CheckResult(1, allowed=True, cost=3))
    assert not checked(state)
    state.handle("R3", CheckResult(1, allowed=True, cost=0))
    assert checked(state)
    assert state.held
    assert state.cost == 5


def test_violated_constraints_are_known_once_all_have_checked() -> None:
    state = AuditedSearchState(1, ROBOTS)
    all_hear(state, account(1, {"X": 1}))
    shared = (Charge("R1", ("A", "B"), 1, INFINITE), Charge("R1", ("A", "C"), 1, 0))
    state.handle("R1", CheckResult(1, allowed=False, cost=0, held=3, shared=shared, hard=3, broken=1))
    state.handle("R2", CheckResult(1, allowed=False, cost=0, held=2, hard=1, broken=1))
    assert state.violations is None
    state.handle("R3", CheckResult(1, allowed=True, cost=0, held=1, hard=1))
    assert str(state.violations) == "2 of 5 hard constraints: one of R1 over A B, one of R2"
    impossible = CheckResult(1, allowed=True, cost=0, held=1, hard=1, broken=1)
    assert "impossible number" in fault_of_check("R1", impossible, Declarations(), ROBOTS)


def test_one_broken_constraint_is_enough() -> None:
    state = AuditedSearchState(1, ROBOTS)
    all_hear(state, CheckResult(1, allowed=True, cost=0))
    state.handle("R2", CheckResult(1, allowed=False, cost=0))
    assert not state.unchecked
    assert not state.held
