"""The tally of a search: who is ready, when it is over, and what came of it."""

from __future__ import annotations

import pytest

from robochoc.communication.control import Conclusion, Counters, OfEpoch, Ready
from robochoc.communication.network.control_messages import Account, Checked, Exchanged, Said
from robochoc.communication.network.search_state import SearchState
from robochoc.model.outcome import Metrics, Verdict
from robochoc.protocols.findings import NOTHING, Findings

ROBOTS = ("R1", "R2", "R3")


def account(epoch: int = 1, values: dict[str, int] | None = None, to: str = "R3", **spent: int) -> Account:
    """What a robot reports that has sent all its messages `to` one, and heard nothing."""
    sent = spent.pop("ok", 0)
    exchanged = {to: Exchanged(sent)} if sent else {}
    return Account(epoch, bool(values), values or {}, Metrics(messages={"Ok": sent}, **spent), NOTHING, exchanged)


def begun(tally: SearchState) -> SearchState:
    """The search is ordered."""
    tally.ordered = True
    return tally


def all_hear(tally: SearchState, word: OfEpoch) -> None:
    for name in ROBOTS:
        assert not tally.hear(name, word)


def waved(tally: SearchState, sent: int, received: int) -> None:
    """Ask all, who answer with these counters each."""
    all_hear(tally, Counters(1, tally.counters.begin_wave(), sent, received))


def test_ready_when_all_are() -> None:
    tally = SearchState(1, ROBOTS)
    for name in ROBOTS:
        assert not tally.ready
        tally.hear(name, Ready(1))
    assert tally.ready


def test_nothing_is_awaited_before_the_first_search() -> None:
    tally = SearchState()
    assert tally.ready
    assert not tally.hear("R1", Ready(0))
    assert not tally.hear("R1", Account(0, True, {"X": 1}, Metrics(), NOTHING))
    assert tally.result(0).verdict is Verdict.UNKNOWN
    assert not tally.assigned


@pytest.mark.parametrize("epoch", [0, 1, 3])
def test_late_words_of_other_searches_say_nothing(epoch: int) -> None:
    tally = SearchState(2, ROBOTS)
    for word in (
        Ready(epoch),
        Counters(epoch, 0, 7, 7),
        Conclusion(epoch, "no-solution"),
        account(epoch, {"X": 1}),
        Checked(epoch, allowed=False, cost=5),
    ):
        all_hear(tally, word)
    assert not tally.ready
    assert (tally.verdict, tally.silent, tally.unchecked) == (None, ROBOTS, True)
    assert (tally.cost, tally.counters.sent, tally.wave_due) == (0, 0, False)


def test_strangers_say_nothing() -> None:
    tally = SearchState(1, ROBOTS)
    for word in (Ready(1), Counters(1, 0, 1, 1), Conclusion(1, "solution"), account(1, {"X": 1})):
        assert not tally.hear("R9", word)
    assert tally.verdict is None
    assert not tally.assigned


@pytest.mark.parametrize("verdict", ["", "bogus", "SOLUTION", "Solution "])
def test_a_verdict_that_is_none_is_refused(verdict: str) -> None:
    tally = begun(SearchState(1, ROBOTS))
    assert tally.hear("R1", Conclusion(1, verdict)).startswith("it has concluded what is no verdict")
    assert tally.verdict is None


def test_words_that_are_not_for_the_master_are_told() -> None:
    assert SearchState(1, ROBOTS).hear("R1", Said(1, 0, b"")) == "it is none for the master"


def quiet(tally: SearchState) -> bool:
    """Whether nobody will ever say anything again."""
    return tally.counters.quiescent


def due(tally: SearchState) -> bool:
    """Whether it is worth asking all."""
    return tally.wave_due


def enough(tally: SearchState) -> bool:
    """Whether there were messages enough."""
    return tally.broken_off


def test_two_waves_of_equal_sums_are_quiet() -> None:
    tally = SearchState(1, ROBOTS)
    assert not due(tally)
    all_hear(tally, Counters(1, 0, 2, 2))
    assert due(tally)
    waved(tally, 2, 2)
    assert tally.counters.quiescent


def test_news_between_two_waves_are_not_quiet() -> None:
    tally = SearchState(1, ROBOTS)
    all_hear(tally, Counters(1, 0, 2, 2))
    waved(tally, 3, 3)
    assert not quiet(tally)
    assert tally.wave_due
    waved(tally, 3, 3)
    assert quiet(tally)


def test_what_is_under_way_is_not_quiet() -> None:
    tally = SearchState(1, ROBOTS)
    for _ in range(3):
        waved(tally, 3, 2)
    assert not tally.counters.quiescent
    assert not tally.wave_due


def test_a_limit_on_messages_breaks_off() -> None:
    tally = SearchState(1, ROBOTS, enough=9)
    assert tally.wave_due  # how many there are is asked for all the time
    waved(tally, 2, 0)
    assert not enough(tally)
    waved(tally, 3, 0)
    assert tally.broken_off
    assert tally.result(0).verdict is Verdict.UNKNOWN


def test_a_verdict_and_its_witness() -> None:
    tally = begun(SearchState(1, ROBOTS))
    tally.hear("R2", Conclusion(1, "no-solution"))
    all_hear(tally, account())
    result = tally.result(1.5)
    assert (result.verdict, result.witness) == (Verdict.NO_SOLUTION, "R2")
    assert result.metrics.wall_s == 1.5


def test_accounts_make_the_result() -> None:
    tally = SearchState(1, ROBOTS)
    tally.verdict = Verdict.SOLUTION
    tally.hear("R1", account(1, {"X": 1}, ok=3, bytes=10, largest=4, ncccs=5, checks=6))
    tally.hear("R2", account(1, {"Y": 2}, ok=4, bytes=20, largest=8, ncccs=1, checks=9))
    assert list(tally.silent) == ["R3"]
    tally.hear("R3", Account(1, False, {}, Metrics(), Findings(bound=4)))
    assert not list(tally.silent)
    result = tally.result(0)
    assert result.assignments == {"R1": {"X": 1}, "R2": {"Y": 2}, "R3": {}}
    assert (result.metrics.messages, result.metrics.bytes, result.metrics.largest) == ({"Ok": 7}, 30, 8)
    assert (result.metrics.ncccs, result.metrics.checks) == (5, 15)
    assert result.findings["R3"] == Findings(bound=4)
    assert tally.assigned == {"R1": True, "R2": True, "R3": False}


def test_a_lost_robot_is_waited_for_no_longer_and_its_words_are_void() -> None:
    tally = SearchState(1, ROBOTS)
    tally.hear("R1", Ready(1))
    tally.hear("R2", Ready(1))
    tally.hear("R3", Conclusion(1, "no-solution"))
    tally.hear("R3", account(1, {"Z": 1}))
    tally.lose("R3", "it fell")
    tally.lose("R3", "again")
    assert tally.ready
    assert tally.broken_off
    assert tally.silent == ("R1", "R2")
    tally.hear("R3", account(1, {"Z": 2}))
    tally.hear("R1", account(1, {"X": 1}))
    tally.hear("R2", account(1, {"Y": 1}))
    result = tally.result(0)
    assert (result.verdict, result.witness, result.lost) == (Verdict.UNKNOWN, None, {"R3": "it fell"})
    assert "R3" not in result.assignments


def checked(tally: SearchState) -> bool:
    """Whether all have held their constraints against the decision."""
    assert not (tally.unchecked and tally.held)
    return not tally.unchecked


def test_all_have_to_check() -> None:
    tally = SearchState(1, ROBOTS)
    all_hear(tally, account(1, {"X": 1}))
    tally.hear("R1", Checked(1, allowed=True, cost=2))
    tally.hear("R2", Checked(1, allowed=True, cost=3))
    assert not checked(tally)
    tally.hear("R3", Checked(1, allowed=True, cost=0))
    assert checked(tally)
    assert tally.held
    assert tally.cost == 5


def test_one_broken_constraint_is_enough() -> None:
    tally = SearchState(1, ROBOTS)
    all_hear(tally, Checked(1, allowed=True, cost=0))
    tally.hear("R2", Checked(1, allowed=False, cost=0))
    assert not tally.unchecked
    assert not tally.held
