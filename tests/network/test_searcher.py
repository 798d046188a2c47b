"""One epoch of a robot across machines: getting ready, searching, reporting, checking."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec
import pytest

from robochoc.communication.control import Conclusion, Counters, Events, Ready, RobotSnapshot
from robochoc.communication.host import BadMessageError
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.constraint_records import SharedRecord, record_of
from robochoc.communication.network.control_messages import (
    LATEST,
    Charge,
    CheckResult,
    Copies,
    DetailedReport,
    ProtocolMessage,
    Recall,
    SearchTask,
    ToMaster,
)
from robochoc.communication.network.members import NetworkMembers
from robochoc.communication.network.quotas import MIB
from robochoc.communication.network.searcher import RobotContext, Searcher
from robochoc.communication.robot_loop import EVENTS_AT_ONCE
from robochoc.formats import PREDEFINED
from robochoc.journal.events import Received
from robochoc.model.problem import INFINITE, Constraint, Team
from robochoc.protocols.findings import NO_FINDINGS, Trail
from robochoc.protocols.local_search.dsa import DSA
from robochoc.protocols.message import Envelope, encode
from robochoc.protocols.optimization.syncbb import BestPath, Path, SyncBB
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.protocols.satisfaction.awc import AWC
from robochoc.solver.agent_problem import DEFAULT_PARAMETERS, RunParameters
from robochoc.solver.compiled_team import CompiledRobot
from robochoc.solver.explanation import constraints_above
from tests.support.problems import team_of
from tests.support.sparse_teams import profiles_of


@dataclass
class Around:
    """What a searcher has said and sent."""

    said: list[ToMaster] = field(default_factory=list)
    sent: list[tuple[str, ProtocolMessage | Copies]] = field(default_factory=list)
    places: list[tuple[int, int]] = field(default_factory=list)

    def context(self, *, observed: bool = False, private: bool = False) -> RobotContext:
        return RobotContext(
            self.said.append,
            lambda receiver, word: self.sent.append((receiver, word)),
            lambda rank, size: self.places.append((rank, size)),
            observed,
            private,
        )

    def heard(self, kind: type[ToMaster]) -> list[ToMaster]:
        return [word for word in self.said if isinstance(word, kind)]


def chain(cost: float = INFINITE) -> Team:
    """A, B and C in a row; neighbours differ, or pay `cost`. B is not 9 by itself."""
    pairs = [("A", "B"), ("B", "C")]
    constraints = [Constraint("C", PREDEFINED["ne"], pair, pair, cost=cost) for pair in pairs]
    return team_of(dict.fromkeys("ABC", (1, 2)), [*constraints, Constraint("P", PREDEFINED["lt"], ("B", 9), ("B", 9))])


def tasks(
    team: Team, protocol: type[Protocol], parameters: RunParameters = DEFAULT_PARAMETERS
) -> dict[str, SearchTask]:
    members = NetworkMembers()
    for name, profile in profiles_of(team).items():
        members.register(name, profile, "incarnation")
    return members.tasks(1, protocol.__name__, protocol.traits, parameters)


def searcher(
    around: RobotContext,
    protocol: type[Protocol] = ABT,
    parameters: RunParameters = DEFAULT_PARAMETERS,
    team: Team | None = None,
) -> Searcher:
    """RB's."""
    team = team or chain()
    return Searcher(CompiledRobot(team["RB"]), tasks(team, protocol, parameters)["RB"], protocol, around)


def begun(
    protocol: type[Protocol] = ABT, team: Team | None = None, *, observed: bool = False, private: bool = False
) -> tuple[Around, Searcher]:
    """Return RB's searcher in its search, and what is around it."""
    around = Around()
    one = searcher(around.context(observed=observed, private=private), protocol, team=team)
    one.prepare()
    one.start(0)
    return around, one


def ok(value: int | None, clock: int = 0) -> Envelope:
    return Envelope("RA", "RB", encode(Ok((value,))), clock)


def said_all(one: Searcher) -> bool:
    """Whether the master knows the counters."""
    return not one.is_restless


def test_ready_once_with_its_place() -> None:
    around = Around()
    one = searcher(around.context())
    one.prepare()
    assert around.said == [Ready(1)]
    assert around.places == [(1, 3)]
    assert not around.sent
    assert not one.is_restless
    assert one.assignment == {}


def test_where_all_know_a_constraint_its_holder_tells_and_waits_to_be_told() -> None:
    around = Around()
    one = searcher(around.context(), AWC)
    one.prepare()
    assert not around.said
    ((receiver, word),) = around.sent
    assert receiver == "RA"
    assert isinstance(word, Copies)
    assert [record.scope for record in msgspec.msgpack.decode(word.content, type=list[SharedRecord])] == [("A", "B")]
    one.start(0)
    assert len(around.sent) == 1  # not ready: there is nothing to begin
    one.learn("RC", msgspec.msgpack.encode(list(map(record_of, constraints_above(chain()["RC"])))))
    one.learn("RC", b"\x90")
    assert around.said == [Ready(1)]


def test_searching_counts_and_tells() -> None:
    around = Around()
    one = searcher(around.context())
    one.prepare()
    assert not one.admit(ok(1))  # before the start it waits
    one.start(0)
    assert not said_all(one)
    (said,) = [word for _, word in around.sent[-1:]]
    assert isinstance(said, ProtocolMessage)
    assert one.assignment == {"B": 2}
    one.report_counters(0)
    assert said_all(one)
    assert around.said[-1] == Counters(1, 0, len(around.sent), 1)
    assert one.admit(ok(2, clock=50))
    one.receive([ok(2, clock=50)])
    assert not said_all(one)
    assert one.assignment == {"B": 1}
    last = around.sent[-1][1]
    assert isinstance(last, ProtocolMessage)
    assert last.clock > 50


def test_after_the_end_nothing_is_taken_in() -> None:
    around, one = begun()
    one.receive([ok(1)])
    one.pause()
    sent = len(around.sent)
    (account,) = around.heard(DetailedReport)
    assert isinstance(account, DetailedReport)
    assert account.assignment == {"B": 2}
    assert not one.admit(ok(2))
    one.receive([ok(2), Envelope("RA", "RB", b"no message", 0)])
    assert one.assignment == {"B": 2}
    assert len(around.sent) == sent
    assert not one.is_restless


def test_nothing_is_taken_in_before_the_start() -> None:
    around = Around()
    one = searcher(around.context())
    one.prepare()
    one.receive([ok(1)])
    assert not around.sent
    assert one.assignment == {}


def test_what_is_no_message_is_bad() -> None:
    _, one = begun()
    with pytest.raises(BadMessageError, match="RA sent RB an invalid message"):
        one.receive([Envelope("RA", "RB", b"\x93", 0)])


def test_what_waits_for_the_start_is_bounded_for_each_sender() -> None:
    one = searcher(Around().context())
    one.prepare()
    much = bytes(100 * MIB)
    for _ in range(2):
        assert not one.admit(Envelope("RA", "RB", much, 0))
    with pytest.raises(BadMessageError, match="RA has sent too many messages before the start of the search"):
        one.admit(Envelope("RA", "RB", much, 0))
    assert not one.admit(Envelope("RC", "RB", much, 0))


def test_who_never_was_ready_reports_all_the_same() -> None:
    around = Around()
    one = searcher(around.context(), AWC)
    one.prepare()
    one.pause()
    (account,) = around.said
    assert isinstance(account, DetailedReport)
    assert (account.assigned, account.assignment, account.findings) == (False, {}, NO_FINDINGS)


def test_in_a_private_run_values_stay_at_home() -> None:
    for private in (False, True):
        around, one = begun(private=private)
        one.pause()
        (account,) = around.heard(DetailedReport)
        assert isinstance(account, DetailedReport)
        assert account.assigned
        assert account.assignment == ({} if private else {"B": 1})
        assert sum(account.metrics.messages.values()) == len(around.sent)
        assert one.assignment == {"B": 1}


def test_events_are_told_if_anybody_wants_them_and_not_too_many_at_once() -> None:
    for observed in (False, True):
        around, one = begun(observed=observed)
        one.receive([ok(1 + number % 2) for number in range(2 * EVENTS_AT_ONCE)])
        one.pause()
        told = [word.events for word in around.said if isinstance(word, Events)]
        assert all(0 < len(events) <= EVENTS_AT_ONCE for events in told)
        received = [event for events in told for event in events if isinstance(event, Received)]
        assert len(received) == (2 * EVENTS_AT_ONCE if observed else 0)


def test_a_verdict_is_told_once() -> None:
    team = team_of({"A": (1,), "B": (1,), "C": (1,)}, chain().constraints())
    around = Around()
    one = Searcher(CompiledRobot(team["RA"]), tasks(team, ABT)["RA"], ABT, around.context())
    one.prepare()
    one.start(0)
    nogood = msgspec.msgpack.encode(["Nogood", {}, [1]])
    for _ in range(2):
        one.receive([Envelope("RB", "RA", nogood, 0)])
    assert around.heard(Conclusion) == [Conclusion(1, "no-solution")]


def test_checking_is_by_the_own_file() -> None:
    _, one = begun()
    one.receive([ok(1)])
    assert one.check_constraints({"A": 1, "C": 1}) == judgement(price=0)
    assert one.check_constraints({"A": 2, "C": 2}) == judgement(price=INFINITE)
    assert one.check_constraints({"A": 1, "B": 1}) == judgement(price=0)  # its own value it knows itself
    assert one.check_constraints({"C": 2}) == CheckResult(
        1, allowed=True, cost=0, held=1, hard=1
    )  # RA has stepped aside


def judgement(price: float, hard: int = 2) -> CheckResult:
    """Of RB's two constraints the private one holds, and RA can know the other."""
    allowed = price < INFINITE
    shared = (Charge("RB", ("A", "B"), 1, price),)
    return CheckResult(1, allowed, price if allowed else 0, held=2, shared=shared, hard=hard, broken=int(not allowed))


def test_checking_adds_up_what_its_constraints_charge() -> None:
    _, one = begun(team=chain(4))
    assert one.assignment == {"B": 1}
    assert one.check_constraints({"A": 1}) == judgement(price=4, hard=1)
    assert one.check_constraints({"A": 2}) == judgement(price=0, hard=1)


def test_who_steps_aside_answers_for_nothing() -> None:
    around = Around()
    one = searcher(around.context(), parameters=RunParameters(withdrawal_cost=1))
    one.prepare()
    assert one.check_constraints({"A": 1, "C": 1}) == CheckResult(1, allowed=True, cost=0)


# What others tell it must not make it say what cannot be: it would be lost for that


def believed(around: Around) -> DetailedReport:
    """Its account, which the master believes."""
    (account,) = around.heard(DetailedReport)
    assert isinstance(account, DetailedReport)
    assert not AuditedSearchState(1, ("RA", "RB", "RC")).handle("RB", account)
    return account


def test_a_clock_that_another_has_set_as_late_as_can_be() -> None:
    around, one = begun()
    one.receive([ok(1, clock=LATEST)])
    last = around.sent[-1][1]
    assert isinstance(last, ProtocolMessage)
    assert last.clock == LATEST
    msgspec.msgpack.decode(msgspec.msgpack.encode(last), type=ProtocolMessage)  # others can read it
    one.pause()
    assert believed(around).metrics.ncccs == LATEST


def test_costs_that_another_has_made_up_are_not_passed_on() -> None:
    around, one = begun(SyncBB, chain(4))
    best = BestPath(-5, ((1,), (2,), (1,)))
    one.receive([Envelope("RA", "RB", encode(Path([((1,), 0)], best)), 0)])
    one.pause()
    assert believed(around).findings == NO_FINDINGS


def test_of_copies_it_checks_no_more_than_can_be_told(monkeypatch: pytest.MonkeyPatch) -> None:
    around = Around()
    one = searcher(around.context(), AWC)
    one.prepare()
    one.learn("RC", msgspec.msgpack.encode(list(map(record_of, constraints_above(chain()["RC"])))))
    one.start(0)
    copy = Charge("RC", ("B", "C"), 1, 0)
    assert one.check_constraints({"A": 2, "C": 2}).copies == (copy,)
    monkeypatch.setattr("robochoc.communication.network.searcher.MOST_CHARGES", 1)
    assert one.check_constraints({"A": 2, "C": 2}).copies == ()


def test_a_master_that_recalls_does_not_get_all_cycles() -> None:
    """In a long search these would be more than a frame holds."""
    around = Around()
    team = chain(cost=1)
    one = searcher(around.context(), DSA, team=team)
    one.prepare()
    one.learn("RC", msgspec.msgpack.encode(list(map(record_of, constraints_above(team["RC"])))))
    one.start(0)
    one.report_snapshot(1)
    one.recall(Recall(1, 2))
    one.pause()
    told, recalled, report = (word for word in around.said if isinstance(word, RobotSnapshot | DetailedReport))
    assert told.findings.trail is not None
    assert told.findings.trail.entries
    assert recalled.findings.trail == report.findings.trail == Trail([], told.findings.trail.cycle)
