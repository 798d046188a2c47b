"""What one robot can do to the verdict: its lie, what is said of it, and whom that names (docs/guides/security.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import msgspec
import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.control import Conclusion, Counters, Ready
from robochoc.communication.network.audited_state import AuditedSearchState
from robochoc.communication.network.control_messages import Charge, DetailedReport, Exchanged
from robochoc.communication.network.plausibility import Declarations
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.run_result import RobotsLostError
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import ALL_ROBOTS, CheckCounts, Metrics, Outcome, PseudoTreeNode, Verdict
from robochoc.model.problem import Constraint, Team
from robochoc.protocols.abt import ABT
from robochoc.protocols.afc import AFC
from robochoc.protocols.awc import AWC
from robochoc.protocols.findings import NOTHING, Findings, Incumbent, Trail
from robochoc.protocols.first_fit import FirstFit
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.sfb import SFB
from robochoc.protocols.traits import Traits
from robochoc.run.networked.machines import claimed
from robochoc.run.registry import protocol_named, protocol_names
from tests.support import traitors
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.problems import PREDICATES, known_to_both, team_of
from tests.support.traitors import Lie, changed

_DIFFERENT = [Constraint("C", PREDICATES[0], pair, pair) for pair in (("A", "B"), ("B", "C"))]
CHAIN = team_of(dict.fromkeys("ABC", (1, 2)), _DIFFERENT)
"""RA, RB and RC, each other than the one before: it has two solutions."""
VALUES = {"A": 1, "B": 2, "C": 1}


@pytest.fixture
def lied(monkeypatch: pytest.MonkeyPatch) -> Callable[..., InMemoryNetwork]:
    """A team in which RB lies, after a search."""

    def searched(lie: Lie, protocol: type[Protocol] = ABT, team: Team = CHAIN) -> InMemoryNetwork:
        traitors.install(lie, "RB", monkeypatch.setattr)
        office = InMemoryNetwork(team, protocol, traitor="RB")
        office.search()
        return office

    return searched


# Its verdict


def test_every_protocol_declares_what_its_robots_conclude() -> None:
    ours = [protocol_named(name) for name in protocol_names()]
    ends = {
        protocol.__name__: set(protocol.traits.concludes)
        for protocol in ours
        if protocol.__module__.startswith("robochoc.")
    }
    assert not FirstFit.traits.concludes
    assert ends.pop("SBT") == ends.pop("AFC") == {Verdict.SOLUTION, Verdict.NO_SOLUTION}
    assert set(map(frozenset, ends.values())) == {frozenset({Verdict.NO_SOLUTION})}
    assert Verdict.OPTIMAL not in Traits().concludes


@pytest.mark.parametrize(
    ("protocol", "verdict"),
    [
        (ABT, "optimal"),
        (ABT, "solution"),
        (ABT, "unknown"),
        (ABT, "maybe"),
        (AFC, "optimal"),
        (AFC, "unknown"),
        (SFB, "optimal"),
        (FirstFit, "no-solution"),
    ],
)
def test_a_verdict_that_its_protocol_does_not_have(
    lied: Callable[..., InMemoryNetwork], protocol: type[Protocol], verdict: str
) -> None:
    state = lied(traitors.concluding(verdict), protocol).state
    said = "what is no verdict" if verdict == "maybe" else verdict
    assert state.lost["RB"].startswith(f"it has concluded {said}, and a robot of this protocol concludes ")
    assert state.result(0).verdict is Verdict.UNKNOWN


def test_a_protocol_of_ones_own_is_held_to_the_same() -> None:
    class Boastful(ABT):
        def start(self) -> None:
            self.conclude(Verdict.OPTIMAL)

    with pytest.raises(
        ValueError, match="it has concluded optimal, and a robot of this protocol concludes no-solution"
    ):
        InMemoryNetwork(CHAIN, Boastful).search()


class Sly(ABT):
    """It goes past what keeps it from concluding that."""

    def start(self) -> None:
        self.verdict = Verdict.OPTIMAL


def test_processes_are_held_to_the_same() -> None:
    with ProcessesRun(CHAIN, Sly) as run, pytest.raises(RobotsLostError, match="it has concluded optimal, and a robot"):
        run.search()


def test_a_verdict_before_the_search(lied: Callable[..., InMemoryNetwork]) -> None:
    office = lied(traitors.LIES["too early"])
    assert office.state.lost == {"RB": "it has concluded something before the search began"}


def test_no_solution_rests_on_its_word(lied: Callable[..., InMemoryNetwork]) -> None:
    """Nobody can tell it from a proof; that the witness is told is all that there is."""
    office = lied(traitors.LIES["no-solution"])
    result = office.state.result(0)
    assert (result.verdict, result.witness, result.lost) == (Verdict.NO_SOLUTION, "RB", {})


def begun(traits: Traits = AFC.traits) -> AuditedSearchState:
    state = AuditedSearchState(1, ("RA", "RB", "RC"), None, Declarations(traits))
    state.ordered = True
    return state


def test_a_second_verdict_that_contradicts_the_first() -> None:
    state = begun()
    assert not state.handle("RA", Conclusion(1, "no-solution"))
    assert not state.handle("RC", Conclusion(1, "no-solution"))
    assert not state.handle("RB", Conclusion(1, "solution"))
    (doubt,) = state.doubts_about_verdict
    assert doubt == (("RA", "RB"), "RA has concluded no-solution, and RB solution")
    assert state.handle("RA", Conclusion(1, "solution")) == "it has concluded solution, and no-solution before"


def test_a_verdict_after_all_were_quiet_blames_nobody_and_changes_nothing() -> None:
    """Whoever concludes it may have been stirred by another: RA speaks once all are quiet."""
    state = begun()
    state.verdict = Verdict.SOLUTION
    assert not state.handle("RB", Conclusion(1, "no-solution"))
    assert (state.verdict, state.doubts_about_verdict) == (Verdict.SOLUTION, ())


# What is said of that

CHECKED = "checked against every constraint"
WHOLE = "no solution for the whole team (RB claims it; nobody could check)"
SAID = Outcome("t", "abt", "network", 0, Verdict.NO_SOLUTION, witness="RB")


@pytest.mark.parametrize(
    ("found", "claimed_by", "words"),
    [
        ({}, "RB", "t: no solution (RB claims it; nobody could check)"),
        (
            {"verdict": Verdict.SOLUTION, "verified": True, "assignment": VALUES},
            None,
            "t: solution for all 3 robots, checked against every constraint",
        ),
        (
            {"verdict": Verdict.SOLUTION, "verified": True, "assignment": VALUES, "checked": CheckCounts(1, 1)},
            None,
            "t: solution for all 3 robots, checked; by their owner alone: 1 of 2 constraints",
        ),
        ({"verdict": Verdict.SOLUTION, "reason": "so"}, ALL_ROBOTS, "t: solution for all 3 robots, not checked: so"),
        (
            {"verdict": Verdict.OPTIMAL, "verified": True, "assignment": VALUES, "cost": 3},
            ALL_ROBOTS,
            f"t: optimal solution for all 3 robots, cost 3, {CHECKED}; the minimum cost is what all robots report",
        ),
        (
            {"verdict": Verdict.OPTIMAL, "verified": True, "assignment": {"A": 1, "C": 2}, "withdrawn": ("RB",)},
            ALL_ROBOTS,
            f"t: 2 of 3 fly (proven maximum); {WHOLE}; {CHECKED}; the minimum withdrawal is what all robots report",
        ),
        (
            {"verdict": Verdict.SOLUTION, "verified": True, "assignment": {"A": 1, "C": 2}, "withdrawn": ("RB",)},
            "RB",
            f"t: 2 of 3 fly (not proven to be the maximum); {WHOLE}; {CHECKED}",
        ),
        ({"verdict": Verdict.UNKNOWN, "reason": "so", "bound": 5}, ALL_ROBOTS, "t: unknown: so"),
        ({"verdict": Verdict.UNKNOWN, "reason": "so"}, None, "t: unknown: so"),
    ],
)
def test_on_whose_word_a_verdict_rests(found: dict[str, Any], claimed_by: str | None, words: str) -> None:
    outcome = claimed(replace(SAID, **found))
    assert outcome.claimed_by == claimed_by
    assert outcome_report(CHAIN, outcome).splitlines()[0] == words
    told = msgspec.json.decode(result_json(outcome))
    assert told.get("claimed_by") == claimed_by
    assert told.get("checked") == (outcome.checked and outcome.checked._asdict())
    back = read_result(result_json(outcome))
    assert (back.claimed_by, back.checked) == (claimed_by, outcome.checked)


def test_on_this_machine_a_witness_is_no_more_than_that() -> None:
    outcome = replace(SAID, runtime="simulator")
    assert outcome_report(CHAIN, outcome).startswith("t: no solution (RB has ruled everything out)\n")
    assert "claimed_by" not in msgspec.json.decode(result_json(outcome))


# Its values


@pytest.mark.parametrize(
    ("lie", "why"),
    [
        (traitors.LIES["a strange name"], "it has reported a variable whose name is none"),
        (traitors.valued(**{"X" * 300: 1}), "it has reported a variable whose name is none"),
        (traitors.LIES["another's variable"], "it has reported a value of A, which is RA's"),
        (traitors.valued(B=3), "it has reported values that it cannot have"),
        (traitors.valued(**{f"Z{n}": 1 for n in range(10_001)}), "it has reported more than 10,000 variables"),
        (traitors.reporting(lambda one: changed(one, assigned=False)), "it has reported values, and that it has none"),
    ],
)
def test_values_that_it_cannot_have(lied: Callable[..., InMemoryNetwork], lie: Lie, why: str) -> None:
    office = lied(lie)
    assert office.state.lost == {"RB": why}
    assert "RB" not in office.state.result(0).assignments


def test_a_private_variable_of_another(lied: Callable[..., InMemoryNetwork]) -> None:
    """Only the two know of it: both are named."""
    office = lied(traitors.valued(Secret=1))
    assert not office.state.lost, "a name of its own is no lie"
    assert not office.state.doubts_about_verdict
    account = office.state._accounts["RC"]  # noqa: SLF001
    assert not office.state.handle("RC", changed(account, assignment={**account.assignment, "Secret": 2}))
    (doubt,) = office.state.doubts_about_verdict
    assert (set(doubt.between), "Secret" in doubt.why) == ({"RB", "RC"}, True)


# Its constraints


def judged(office: InMemoryNetwork) -> tuple[bool, float]:
    return office.judge({name: dict(values) for name, values in office.state.result(0).assignments.items()})


def test_it_judges_its_own_constraint_alone(lied: Callable[..., InMemoryNetwork]) -> None:
    """Nobody else knows the constraint: that is what is said of it."""
    office = lied(traitors.LIES["a wrong value"])
    assert judged(office)[0] is False, "RC's constraint with RB is broken as well, and RC says so"
    assert office.state.objections == ("RC finds its constraint over B C broken",)
    office = lied(traitors.LIES["a wrong value"], team=team_of(dict.fromkeys("AB", (1, 2)), _DIFFERENT[:1]))
    assert judged(office) == (True, 0)
    assert office.state.thoroughness == (0, 1), "on its owner's word alone"


def test_its_parent_knows_the_constraint_from_its_own_file(lied: Callable[..., InMemoryNetwork]) -> None:
    team = known_to_both(team_of(dict.fromkeys("AB", (1, 2)), _DIFFERENT[:1]))
    office = lied(traitors.LIES["a wrong value"], team=team)
    judged(office)
    (doubt,) = office.state.doubts_about_verdict
    assert set(doubt.between) == {"RA", "RB"}
    assert doubt.why == ("RA says that the constraint over A B is broken, and RB, which holds it, says that it holds")


def test_its_parent_was_told_the_constraint_before_the_search(lied: Callable[..., InMemoryNetwork]) -> None:
    office = lied(traitors.LIES["a wrong value"], AWC)
    judged(office)
    assert {"RA", "RB"} in [set(doubt.between) for doubt in office.state.doubts_about_verdict]


def test_what_both_ends_check_is_said_to_be_checked(lied: Callable[..., InMemoryNetwork]) -> None:
    for protocol, team in ((ABT, known_to_both(CHAIN)), (AWC, CHAIN), (AWC, known_to_both(CHAIN))):
        office = lied(lambda _me, word: iter([word]), protocol, team)
        assert judged(office) == (True, 0)
        assert office.state.thoroughness == (2, 0)
        assert not office.state.doubts_about_verdict


def test_how_many_are_checked_by_both_is_what_both_say(lied: Callable[..., InMemoryNetwork]) -> None:
    """RB says that its one constraint with RA is a thousand, or that it knows a thousand of RC's."""
    many = [
        lambda one: changed(one, held=1000, shared=tuple(each._replace(constraints=1000) for each in one.shared)),
        lambda one: changed(one, copies=tuple(each._replace(constraints=1000) for each in one.copies)),
    ]
    for change in many:
        office = lied(traitors.judging(change), team=known_to_both(CHAIN))
        judged(office)
        assert office.state.thoroughness.by_both == 2


def test_a_copy_of_what_nobody_holds(lied: Callable[..., InMemoryNetwork]) -> None:
    made_up = Charge("RC", ("A", "C"), 1, 0)
    office = lied(traitors.judging(lambda one: changed(one, copies=(made_up,))))
    judged(office)
    (doubt,) = office.state.doubts_about_verdict
    assert doubt.between == ("RC", "RB")
    assert doubt.why.endswith("and RC, which holds it, has no such constraint")


@pytest.mark.parametrize(
    "change",
    [
        {"cost": -1},
        {"cost": float("nan")},
        {"cost": 7},
        {"held": -1},
        {"held": 0},
        {"held": 2**60},
        {"shared": (Charge("RA", ("A", "B"), 1, 0),)},
        {"shared": (Charge("RB", ("A", "B"), 1, float("inf")),)},
        {"shared": (Charge("RB", ("\x1b[2J", "B"), 1, 0),)},
        {"copies": (Charge("RB", ("A", "B"), 1, 0),)},
        {"copies": (Charge("R9", ("A", "B"), 1, 0),)},
        {"copies": (Charge("RA", ("A", "B"), 0, 0),)},
    ],
)
def test_it_has_checked_what_cannot_be(lied: Callable[..., InMemoryNetwork], change: dict[str, Any]) -> None:
    office = lied(traitors.judging(lambda one: changed(one, **change)))
    judged(office)
    assert set(office.state.lost) == {"RB"}


# Its counts


@pytest.mark.parametrize(
    ("lie", "why"),
    [
        (traitors.counting(lambda _: -1), "it has counted -1 messages sent"),
        (traitors.counting(lambda sent: sent, lambda _: -5), "-5 taken in, which cannot be"),
        (traitors.counting(lambda _: 2**53 + 1), "which cannot be"),
        (traitors.LIES["falling"], "its counters have fallen, from "),
        (traitors.counting(lambda sent: sent + 1, lambda received: received + 1), "its counters have fallen"),
        (traitors.LIES["costs"], "it has reported 9,007,199,254,740,992 constraint checks in 0.0 s"),
        (traitors.spending(ncccs=2**40), "its clock is at 1,099,511,627,776, and neither its own"),
        (traitors.spending(bytes=0), "bytes together, the largest of"),
        (traitors.spending(bytes=2**50), "bytes together, the largest of"),
        (traitors.spending(largest=2**50), "the largest of 1,125,899,906,842,624, which cannot be"),
        (traitors.spending(largest=-1), "counts that cannot be"),
        (traitors.spending(bytes=-1), "it has reported counts that cannot be"),
        (traitors.spending(memory=2**52), "it has reported costs that are not its own"),
        (traitors.spending(wall_s=1e300), "it has reported costs that are not its own"),
        (traitors.spending(simulated_s=float("nan")), "it has reported costs that are not its own"),
        (traitors.spending(messages={"Ok": 0}, bytes=0, largest=0), "are not as many as those"),
        (traitors.spending(messages={"\x1b[2J": 1}), "it has reported messages of kinds that are none"),
        (traitors.spending(messages={f"K{n}": 0 for n in range(101)} | {"Ok": 1}), "of kinds that are none"),
        (
            traitors.reporting(lambda one: changed(one, exchanged={"R9": Exchanged(1)})),
            "somebody who is not of the team",
        ),
        (traitors.reporting(lambda one: changed(one, exchanged={"RA": Exchanged(1, -1)})), "counts that cannot be"),
        (traitors.finding(Findings(bound=float("-inf"))), "it tells of costs that cannot be"),
        (traitors.finding(Findings(bound=float("nan"))), "it tells of costs that cannot be"),
        (traitors.finding(Findings(best=Incumbent(-1.0, {}))), "it tells of costs that cannot be"),
        (
            traitors.finding(Findings(best=Incumbent(1, {"\x1b[2J": (1,)}))),
            "it tells of a robot that is not of the team",
        ),
        (traitors.finding(Findings(place=PseudoTreeNode("R9"))), "it tells of a robot that is not of the team"),
        (traitors.finding(Findings(trail=Trail([(0, -1)], 0))), "it tells of cycles that cannot be"),
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


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (
            lambda one: one._replace(received=one.received + 3),
            "RA says that it has sent RB 1 messages, and RB that it has had 4",
        ),
        (lambda one: one._replace(clock=1000), "RB says that the clock of RA was at 1,000 when it spoke"),
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
        wave = state.counters.begin_wave()
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
        NOTHING,
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
        wave = state.counters.begin_wave()
        for name, counts in heard.items():
            state.handle(name, Counters(1, wave, *counts))
    assert not state.handle("RA", accounts["RA"]), "it has answered what it was told"
    assert state.handle("RB", accounts["RB"]) == "it has sent messages after all were quiet, in answer to none"
    assert not state.handle("RC", accounts["RC"])


def test_who_keeps_it_awake() -> None:
    state = begun()
    assert not state.handle("RA", reported(RB=Exchanged(150, 3)))
    assert not state.handle("RB", reported(RA=Exchanged(3, 2), RC=Exchanged(0, 0)))
    assert not state.handle("RC", reported())
    assert state.unfinished == "RA says that it has sent RB 150 messages, and RB that it has had 2 of it"


def test_who_does_not_answer() -> None:
    state = begun()
    for name in state.order:
        state.handle(name, Ready(1))
    state.handle("RA", Counters(1, state.counters.begin_wave(), 150, 3))
    state.note_end(1, in_time=False)
    assert state.unfinished == "RB, RC have not answered the master"


def test_who_was_never_ready() -> None:
    state = begun()
    state.handle("RA", Ready(1))
    state.note_end(1, in_time=False)
    assert state.unfinished.startswith("RB, RC have not answered the master")
