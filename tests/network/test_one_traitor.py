"""What one robot can do to the verdict: its lie, what is said of it, and whom that names (docs/guides/security.md)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.control import Conclusion
from robochoc.communication.network.control_messages import Charge, CheckResult, Spent
from robochoc.communication.network.master import Master
from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.search_result import RobotsLostError, SearchResult
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import ALL_ROBOTS, CheckCounts, Metrics, Outcome, Verdict
from robochoc.protocols.optimization.sfb import SFB
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.afc import AFC
from robochoc.protocols.satisfaction.awc import AWC
from robochoc.protocols.satisfaction.first_fit import FirstFit
from robochoc.protocols.traits import Traits
from robochoc.run.networked.machines import Machines, claimed
from robochoc.run.options import Options
from robochoc.run.phases import RunPhase
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.agent_problem import RunParameters
from robochoc.verification.checker import RefutedError
from tests.support import traitors
from tests.support.cases import looped
from tests.support.in_memory_network import InMemoryNetwork
from tests.support.one_traitor import CHAIN, DIFFERENT, VALUES, begun
from tests.support.problems import known_to_both, team_of
from tests.support.traitors import Lie, changed

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
    assert ends.pop("DBA") == {Verdict.NO_SOLUTION, Verdict.UNKNOWN}  # it stops, and may give up
    assert set(map(frozenset, ends.values())) == {frozenset({Verdict.NO_SOLUTION})}
    assert Verdict.OPTIMAL not in Traits().concludes


@looped(
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
    said = "an invalid verdict" if verdict == "maybe" else verdict
    assert state.lost["RB"].startswith(f"it has concluded {said}, but a robot of this protocol may conclude only ")
    assert state.result(0).verdict is Verdict.UNKNOWN


def test_a_protocol_of_ones_own_is_held_to_the_same() -> None:
    class Boastful(ABT):
        def start(self) -> None:
            self.conclude(Verdict.OPTIMAL)

    with pytest.raises(
        ValueError, match="it has concluded optimal, but a robot of this protocol may conclude only no-solution"
    ):
        InMemoryNetwork(CHAIN, Boastful).search()


class Sly(ABT):
    """It goes past what keeps it from concluding that."""

    def start(self) -> None:
        self.verdict = Verdict.OPTIMAL


def test_processes_are_held_to_the_same() -> None:
    with ProcessesRun(CHAIN, Sly) as run, pytest.raises(RobotsLostError, match="it has concluded optimal, but a robot"):
        run.search()


def test_a_verdict_before_the_search(lied: Callable[..., InMemoryNetwork]) -> None:
    office = lied(traitors.LIES["too early"])
    assert office.state.lost == {"RB": "it has concluded a verdict before the start of the search"}


def test_no_solution_rests_on_its_word(lied: Callable[..., InMemoryNetwork]) -> None:
    """Nobody can tell it from a proof; that the witness is told is all that there is."""
    office = lied(traitors.LIES["no-solution"])
    result = office.state.result(0)
    assert (result.verdict, result.witness, result.lost) == (Verdict.NO_SOLUTION, "RB", {})


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


# While they search

PHASE = RunPhase("abt", ABT, RunParameters())
BROKEN, HELD = CheckResult(1, allowed=False, cost=0, held=1), CheckResult(1, allowed=True, cost=0, held=1)


def machines(checks: dict[str, CheckResult]) -> Machines:
    """The three robots, who have checked what they had."""
    members = SimpleNamespace(order=("RA", "RB", "RC"), robots={})
    snapshots = SimpleNamespace(number=1, checks=checks)
    master = cast("Master", SimpleNamespace(members=members, snapshots=snapshots, spent_before=Spent()))
    return Machines(master, Options(protocol="abt", deadline=1), "t", None)


def had(**values: dict[str, int]) -> SearchResult:
    return SearchResult(Verdict.UNKNOWN, None, values, Metrics())


def test_what_one_robot_finds_broken_is_no_answer() -> None:
    found = machines({"RA": HELD, "RB": BROKEN, "RC": HELD})
    now = had(RA={"A": 1}, RB={"B": 1}, RC={"C": 1})
    assert found._check_snapshot(PHASE, now) is None  # noqa: SLF001 - the robots' word for it


def test_what_not_all_have_is_no_answer() -> None:
    found = machines(dict.fromkeys(("RA", "RB", "RC"), HELD))
    now = had(RA={"A": 1}, RB={}, RC={"C": 1})
    assert found._check_snapshot(PHASE, now) is None  # noqa: SLF001


@looped(
    ("liar", "why"),
    [
        ({"copies": (Charge("RA", ("A", "B"), 1, 5),)}, "RB reports that the constraint over A B charges 5, but RA"),
        ({}, "the variable A is RA's, and RB's too"),
    ],
)
def test_who_contradicts_another_while_they_search_ends_the_run(liar: dict[str, Any], why: str) -> None:
    found = machines({"RA": HELD, "RB": changed(HELD, **liar), "RC": HELD})
    now = had(RA={"A": 1}, RB={"B": 1} if liar else {"A": 2}, RC={"C": 1})
    with pytest.raises(RefutedError, match=why):
        found._check_snapshot(PHASE, now)  # noqa: SLF001


# What is said of that

CHECKED = "checked against every constraint"
WHOLE = "no solution for the whole team (RB claims it; this could not be checked)"
SAID = Outcome(Verdict.NO_SOLUTION, team="t", protocol="abt", runtime="network", seed=0, witness="RB")


@looped(
    ("found", "claimed_by", "words"),
    [
        ({}, "RB", "t: no solution (RB claims it; this could not be checked)"),
        (
            {"verdict": Verdict.SOLUTION, "verified": True, "assignment": VALUES},
            None,
            "t: solution for all 3 robots, checked against every constraint",
        ),
        (
            {"verdict": Verdict.SOLUTION, "verified": True, "assignment": VALUES, "checked": CheckCounts(1, 1)},
            None,
            "t: solution for all 3 robots, checked; by their owner only: 1 of 2 constraints",
        ),
        ({"verdict": Verdict.SOLUTION, "reason": "so"}, ALL_ROBOTS, "t: solution for all 3 robots, not checked: so"),
        (
            {"verdict": Verdict.OPTIMAL, "verified": True, "assignment": VALUES, "cost": 3},
            ALL_ROBOTS,
            f"t: optimal solution for all 3 robots, cost 3, {CHECKED}; the minimum cost is as reported by all robots",
        ),
        (
            {"verdict": Verdict.OPTIMAL, "verified": True, "assignment": {"A": 1, "C": 2}, "withdrawn": ("RB",)},
            ALL_ROBOTS,
            f"t: 2 of 3 fly (proven maximum); {WHOLE}; {CHECKED}; the minimum withdrawal is as reported by all robots",
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


@looped(
    ("lie", "why"),
    [
        (traitors.LIES["a strange name"], "it has reported a variable with an invalid name"),
        (traitors.valued(**{"X" * 300: 1}), "it has reported a variable with an invalid name"),
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
    office = lied(traitors.LIES["a wrong value"], team=team_of(dict.fromkeys("AB", (1, 2)), DIFFERENT[:1]))
    assert judged(office) == (True, 0)
    assert office.state.thoroughness == (0, 1), "on its owner's word alone"


def test_its_parent_knows_the_constraint_from_its_own_file(lied: Callable[..., InMemoryNetwork]) -> None:
    team = known_to_both(team_of(dict.fromkeys("AB", (1, 2)), DIFFERENT[:1]))
    office = lied(traitors.LIES["a wrong value"], team=team)
    judged(office)
    (doubt,) = office.state.doubts_about_verdict
    assert set(doubt.between) == {"RA", "RB"}
    assert doubt.why == (
        "RA reports that the constraint over A B is broken, but RB, which holds it, reports that it holds"
    )


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
    assert doubt.why.endswith("but RC, which holds it, has no such constraint")


@looped(
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
