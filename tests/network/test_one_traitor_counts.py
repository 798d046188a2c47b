"""What one robot can do to the counts, and to the end of the search: its lie, and whom that names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from robochoc.communication.control import Counters, Ready
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import DetailedReport, Exchanged
from robochoc.model.outcome import Metrics, PseudoTreeNode
from robochoc.protocols.findings import NO_FINDINGS, Findings, Incumbent, Trail
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.traits import Traits
from tests.support import traitors
from tests.support.cases import looped
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.one_traitor import begun
from tests.support.traitors import Lie, changed


@looped(
    ("lie", "why"),
    [
        (traitors.counting(lambda _: -1), "it has reported -1 messages sent"),
        (traitors.counting(lambda sent: sent, lambda _: -5), "-5 received, which is impossible"),
        (traitors.counting(lambda _: 2**53 + 1), "which is impossible"),
        (traitors.LIES["falling"], "its counters have fallen, from "),
        (traitors.counting(lambda sent: sent + 1, lambda received: received + 1), "its counters have fallen"),
        (traitors.LIES["costs"], "it has reported 9,007,199,254,740,992 constraint checks in 0.0 s"),
        (traitors.spending(ncccs=2**40), "its clock is at 1,099,511,627,776, more than its"),
        (traitors.spending(bytes=0), "bytes together, the largest of"),
        (traitors.spending(bytes=2**50), "bytes together, the largest of"),
        (traitors.spending(largest=2**50), "the largest of 1,125,899,906,842,624, which is impossible"),
        (traitors.spending(largest=-1), "counts that cannot be"),
        (traitors.spending(bytes=-1), "it has reported counts that cannot be"),
        (traitors.spending(memory=2**52), "it has reported costs that are not its own"),
        (traitors.spending(wall_s=1e300), "it has reported costs that are not its own"),
        (traitors.spending(simulated_s=float("nan")), "it has reported costs that are not its own"),
        (traitors.spending(messages={"Ok": 0}, bytes=0, largest=0), "differs from the sum of those"),
        (traitors.spending(messages={"\x1b[2J": 1}), "it has reported messages of invalid types"),
        (traitors.spending(messages={f"K{n}": 0 for n in range(101)} | {"Ok": 1}), "of invalid types"),
        (
            traitors.reporting(lambda one: changed(one, exchanged={"R9": Exchanged(1)})),
            "a robot that is not in the team",
        ),
        (traitors.reporting(lambda one: changed(one, exchanged={"RA": Exchanged(1, -1)})), "counts that cannot be"),
        (traitors.finding(Findings(bound=float("-inf"))), "it has reported impossible costs"),
        (traitors.finding(Findings(bound=float("nan"))), "it has reported impossible costs"),
        (traitors.finding(Findings(best=Incumbent(-1.0, {}))), "it has reported impossible costs"),
        (
            traitors.finding(Findings(best=Incumbent(1, {"\x1b[2J": (1,)}))),
            "it has reported a robot that is not in the team",
        ),
        (traitors.finding(Findings(place=PseudoTreeNode("R9"))), "it has reported a robot that is not in the team"),
        (traitors.finding(Findings(trail=Trail([(0, -1)], 0))), "it has reported impossible cycles"),
    ],
)
def test_counts_that_cannot_be(lied: Callable[..., InMemoryNetwork], lie: Lie, why: str) -> None:
    office = lied(lie)
    assert set(office.state.lost) == {"RB"}
    assert why in office.state.lost["RB"]


def test_more_taken_in_than_was_sent(lied: Callable[..., InMemoryNetwork]) -> None:
    """The sums tell that somebody lies; the report, held against its own earlier words, who."""
    office = lied(traitors.counting(lambda sent: sent, lambda received: received + 3))
    assert set(office.state.lost) == {"RB"}


def exchanging(change: Callable[[Exchanged], Exchanged], who: str = "RA") -> Lie:
    """What it says of its messages with another is changed, and its sums go with that."""

    def reported(account: DetailedReport) -> DetailedReport:
        exchanged = {**account.exchanged, who: change(account.exchanged.get(who, Exchanged()))}
        sent = sum(one.sent for one in exchanged.values())
        metrics = replace(account.metrics, messages={"Ok": sent}, bytes=max(account.metrics.bytes, sent))
        return changed(account, metrics=metrics, exchanged=exchanged)

    return traitors.reporting(reported)


@looped(
    ("change", "why"),
    [
        (
            lambda one: one._replace(received=one.received + 3),
            "RA reports 1 messages sent to RB, but RB reports 4",
        ),
        (lambda one: one._replace(clock=1000), "RB reports 1,000 as the clock of RA in its messages"),
    ],
)
def test_messages_that_nobody_has_sent(
    lied: Callable[..., InMemoryNetwork], change: Callable[[Exchanged], Exchanged], why: str
) -> None:
    office = lied(exchanging(change))
    doubts = office.state.doubts_about_counts
    assert [set(doubt.between) for doubt in doubts] == [{"RA", "RB"}]
    assert doubts[0].why.startswith(why)
    assert not office.state.doubts_about_verdict, "a solution is checked, whatever was counted"


def quiet(accounts: dict[str, DetailedReport], heard: dict[str, tuple[int, int]], traits: Traits) -> AuditedSearchState:
    """All have answered two waves, and reported."""
    state = begun(traits)
    for _ in range(2):
        wave = state.counters.start_wave()
        for name, counts in heard.items():
            assert not state.handle(name, Counters(1, wave, *counts))
    for name, account in accounts.items():
        assert not state.handle(name, account)
    assert state.counters.quiescent
    return state


def reported(kind: str = "Ok", checks: int = 0, **exchanged: Exchanged) -> DetailedReport:
    sent = sum(one.sent for one in exchanged.values())
    return DetailedReport(
        1,
        {},
        Metrics({kind: sent}, sent, 0, checks, largest=min(sent, 1)),
        NO_FINDINGS,
        assigned=False,
        exchanged=exchanged,
    )


def test_quiet_too_early() -> None:
    """RB has counted as many messages taken in as RA sent it; RA's message to RC, it says, it has had itself."""
    heard = {"RA": (2, 0), "RB": (0, 2), "RC": (0, 0)}
    accounts = {"RA": reported(RB=Exchanged(1), RC=Exchanged(1)), "RB": reported(RA=Exchanged(0, 2)), "RC": reported()}
    state = quiet(accounts, heard, SFB.traits)
    assert [doubt.between for doubt in state.doubts_about_verdict] == [("RA", "RB"), ("RA", "RC")]
    assert not quiet(accounts, heard, ABT.traits).doubts_about_verdict, (
        "where nothing is minimised, the answer is checked"
    )


def test_whom_it_stirs_after_all_were_quiet_is_not_blamed() -> None:
    heard = {"RA": (1, 0), "RB": (0, 1), "RC": (0, 0)}
    accounts = {
        "RA": reported(RB=Exchanged(1, 1), RC=Exchanged(1)),
        "RB": reported(RA=Exchanged(1, 1)),
        "RC": reported(),
    }
    state = begun(SFB.traits)
    for _ in range(2):
        wave = state.counters.start_wave()
        for name, counts in heard.items():
            state.handle(name, Counters(1, wave, *counts))
    assert not state.handle("RA", accounts["RA"]), "it has answered what it was told"
    assert state.handle("RB", accounts["RB"]) == "it has sent messages after quiescence, without receiving one"
    assert not state.handle("RC", accounts["RC"])


def test_who_keeps_it_awake() -> None:
    state = begun()
    assert not state.handle("RA", reported(RB=Exchanged(150, 3)))
    assert not state.handle("RB", reported(RA=Exchanged(3, 2), RC=Exchanged(0, 0)))
    assert not state.handle("RC", reported())
    assert state.unfinished == "RA reports 150 messages sent to RB, but RB reports 2 received from it"


def test_who_does_not_answer() -> None:
    state = begun()
    for name in state.order:
        state.handle(name, Ready(1))
    state.handle("RA", Counters(1, state.counters.start_wave(), 150, 3))
    state.note_end(1, in_time=False)
    assert state.unfinished == "RB and RC have not answered the master"


def test_who_was_never_ready() -> None:
    state = begun()
    state.handle("RA", Ready(1))
    state.note_end(1, in_time=False)
    assert state.unfinished.startswith("RB and RC have not answered the master")
