"""What the master makes of what it is told, and how refusals are counted: without a network."""

from __future__ import annotations

import threading
from typing import cast

import pytest

from robochoc.authority.admission import InMemoryAuthority
from robochoc.communication.control import Counters, Ready, WentOn
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import Bye, LostFrames
from robochoc.communication.network.master import Master
from robochoc.communication.network.master_control import HELD_S
from robochoc.communication.network.members import Member, NetworkMembers
from robochoc.communication.network.profile import Profile
from robochoc.communication.network.refusals import KINDS, LONGEST, WHO, Refusals
from robochoc.communication.network.settings import PATIENCE_S
from robochoc.communication.network.transport import HEARTBEAT_S
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.journal.events import Decided, Received, Refused, actor
from robochoc.model.outcome import Verdict
from robochoc.protocols.satisfaction.afc import AFC
from robochoc.run import Options, Runtime
from robochoc.run.networked.machines import Machines
from robochoc.run.phases import RunPhase
from robochoc.solver.agent_problem import RunParameters


def test_what_a_robot_tells_of_others() -> None:
    """Also somebody who is of the team may only tell of itself."""
    assert actor(Decided(t=0, robot="A", assignment={}, clock=0)) == "A"
    assert actor(Received(t=0, sender="A", receiver="B", type="Ok", clock=0)) == "B"
    assert actor(Refused(t=0, who="A", what="", why="")) != "A"


def started() -> AuditedSearchState:
    """The state of a search by A and B, which were ordered to start."""
    state = AuditedSearchState(1, ["A", "B"])
    for name in state.order:
        state.handle(name, Ready(1))
    state.start()
    return state


def test_messages_that_are_missing_are_told_only_when_nothing_moves_any_more() -> None:
    state = started()
    state.handle("A", Counters(1, 0, 3, 0))
    assert not state.is_stalled(0, 10)
    state.handle("B", Counters(1, 0, 0, 2))
    assert [state.is_stalled(now, 10) for now in (1, 5, 10.9)] == [False] * 3
    for now in (12, 13):
        assert not state.is_stalled(now, 10)
        assert state.wave_due
        wave = state.counters.start_wave()
        state.handle("A", Counters(1, wave, 3, 0))
        assert not state.is_stalled(now + 50, 10), "B has not answered"
        state.handle("B", Counters(1, wave, 0, 2))
    assert state.is_stalled(14, 10)
    assert state.describe_stall() == "1 messages between robots were lost for good"
    state.handle("B", Counters(1, 0, 0, 3))
    assert not state.is_stalled(15, 10)


def test_a_robot_that_waits_for_lost_data_before_the_start_ends_the_search() -> None:
    """`make simulate` found a master that waited forever for frames lost in an earlier search."""
    state = AuditedSearchState(1, ["A", "B"])
    state.handle("A", Ready(1))
    assert not state.is_stalled(0, 10)
    assert not state.wave_due, "B may compute"
    for now in (11, 12):
        assert not state.is_stalled(now, 10)
        wave = state.next_wave()
        assert wave is not None
        for name in state.order:
            assert not state.is_stalled(now + 50, 10), f"{name} may compute"
            state.handle(name, Counters(1, wave, 0, 0))
    assert state.is_stalled(13, 10)
    assert state.describe_stall() == "B cannot start: data from other robots were lost for good"
    assert state.verdict is None, "no message was sent, but this is not the end of a search"
    state.handle("B", Ready(1))
    assert not state.is_stalled(13, 10)


def test_answers_to_a_wave_before_the_start_prove_nothing() -> None:
    state = AuditedSearchState(1, ["A", "B"])
    for name in state.order:
        state.handle(name, Counters(1, 0, 0, 0))
        state.handle(name, Ready(1))
    before = state.counters.start_wave()
    state.start()
    for name in state.order:
        state.handle(name, Counters(1, before, 0, 0))
    assert not state.counters.quiescent
    wave = state.next_wave()
    assert wave not in {None, before}


def test_no_message_is_missing_while_a_robot_has_not_said_whether_it_goes_on() -> None:
    """A busy machine may give it no turn for long, and no wave asks the others before."""
    state = started()
    state.lossy = True
    for name in ("A", "B"):
        state.handle(name, Counters(1, 0, 1, 1))
    wave = state.counters.start_wave()
    for name in ("A", "B"):
        state.handle(name, Counters(1, wave, 1, 1))
    assert state.start_continuation()
    state.handle("A", WentOn(1, went=True))
    state.handle("A", Counters(1, 0, 2, 1))
    for now in (0, 11, 12, 13, 14):
        assert not state.is_stalled(now, 10)
        assert state.next_wave() is None
    state.handle("B", WentOn(1, went=False))
    assert [state.is_stalled(now, 10) for now in (15, 24, 26)] == [False] * 3
    assert state.next_wave() is not None, "now all are asked"


# What is refused is counted


def test_refusals_are_told_in_powers_of_ten_and_remembered_up_to_a_number() -> None:
    told: list[Refused] = []
    refusals = Refusals(lambda who, what, why: told.append(Refused(t=0, who=who, what=what, why=why)))
    for _ in range(1234):
        refusals.note("A", "put", "no")
    assert [one.why for one in told] == ["no", *(f"no ({n} times so far)" for n in ("10", "100", "1,000"))]
    told.clear()
    for number in range(1000):
        refusals.note("A", f"put {number}", "no")
    assert len(told) < KINDS + 5
    assert told[-1].what == "other requests"
    assert "(100 times so far)" in told[-1].why
    told.clear()
    for number in range(2 * WHO):
        refusals.note(f"B{number}", "x" * 10**6, "y\n")
    assert len(told) < WHO + 10
    assert told[-1].who == "others"
    assert len(told[0].what) == LONGEST
    assert told[0].why == "y\\n"


def test_refusals_of_several_threads() -> None:
    told: list[str] = []
    refusals = Refusals(lambda _who, _what, why: told.append(why))

    def work() -> None:
        for _ in range(2500):
            refusals.note("A", "put", "no")

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert told[-1] == "no (10,000 times so far)"


def a_master() -> Master:
    authority = InMemoryAuthority(("A", "B"))
    master = Master(authority, authority.master_identity(("127.0.0.1",)), "127.0.0.1:7447", NetworkMembers())
    for name in ("A", "B"):
        master.members.robots[name] = Member(cast("Profile", None), "incarnation")
    return master


def test_a_robot_that_leaves_before_the_end_is_lost() -> None:
    """Otherwise it would be asked no more, although the master waits for it, and its absence would not count."""
    master = a_master()
    master.members.closed = True
    with pytest.raises(RobotsLostError, match="A was lost: it has left before the end of the run"):
        master._handle("A", master.members.robots["A"], Bye())  # noqa: SLF001 - as it arrives


def test_an_answer_is_not_checked_if_a_robot_has_not_reported() -> None:
    """Found by `make simulate`: after a timeout, honest robots contradicted each other about its constraints."""
    master = a_master()
    master.members._order = ("A", "B")  # noqa: SLF001 - the team is complete
    machines = Machines(master, Options(protocol="afc", runtime=Runtime.NETWORK, timeout=1), "two", None)
    phase = RunPhase("afc", AFC, RunParameters())
    assert machines._check(phase, SearchResult.of(Verdict.UNKNOWN, None, {}, [], 1.0)) is None  # noqa: SLF001


def test_messages_that_zenoh_may_hold_back_are_not_missing_yet() -> None:
    """It holds them for as long as it asks for an earlier one; the loss of that one a robot reports."""
    asked: list[float] = []

    class Recorded(AuditedSearchState):
        def is_stalled(self, now: float, patience_s: float) -> bool:
            asked.append(patience_s)
            return super().is_stalled(now, patience_s)

    master = a_master()
    master.state = Recorded(1, ["A", "B"])
    master._detect_end(0)  # noqa: SLF001 - a step of its loop
    master._frame_loss.note_between("B", LostFrames("A", 3))  # noqa: SLF001 - as B says it
    master._detect_end(0)  # noqa: SLF001
    assert asked == [PATIENCE_S + HELD_S, PATIENCE_S]
    assert HELD_S >= HEARTBEAT_S + 10
