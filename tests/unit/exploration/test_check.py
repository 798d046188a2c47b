"""Every order of deliveries of small teams: no fault in the protocols, and each planted fault is found."""

from __future__ import annotations

import itertools
import sys
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import pytest

from robochoc.exploration import check, state_graph
from robochoc.exploration.changes import Course
from robochoc.exploration.check import CheckedTeam, CheckOptions, checked
from robochoc.exploration.components import strong_components
from robochoc.exploration.counterexample import write_counterexample
from robochoc.exploration.problems import small_teams
from robochoc.exploration.stage import Stage
from robochoc.exploration.state_graph import StateGraph
from robochoc.journal.events import Received
from robochoc.journal.journal import read_journal
from robochoc.model.problem import INFINITE
from robochoc.protocols.findings import Findings
from robochoc.protocols.optimization.adopt import ADOPT
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LocalProblem
from robochoc.testing import check_protocol
from tests.support.compiled import plain_python_only
from tests.support.encrypted_problems import short_settings
from tests.support.examples import count
from tests.support.faulty_abt import AnyNogood, NoAnswer
from tests.support.program import ROOT

pytestmark = [plain_python_only, pytest.mark.usefixtures("quick_encryption")]


def found(name: str, teams: int, *, robots: int = 3, seed: int = 0, **options: Any) -> list[CheckedTeam]:  # noqa: ANN401 - of `CheckOptions`
    run = Options(protocol=name, runtime=Runtime.SIMULATOR)
    problems = itertools.islice(small_teams(protocol_named(name).traits, robots, 2, seed), teams)
    return list(checked(problems, CheckOptions(protocol_named(name), run, **options)))


@pytest.mark.parametrize("name", protocol_names())
@count("teams", fast=3, slow=100)
def test_no_order_of_deliveries_leads_to_a_fault(name: str, teams: int) -> None:
    if protocol_named(name).traits.encrypted_tables:
        teams = 1
    assert not [one.in_words for one in found(name, teams, states=400) if one.exploration.fault]


@pytest.mark.parametrize("name", ["dsa", "mgm", "regret-matching"])
def test_any_message_may_be_lost(name: str) -> None:
    assert not [one.in_words for one in found(name, 3, states=400, losses=1) if one.exploration.fault]


@pytest.mark.parametrize("name", protocol_names())
@count("teams", fast=2, slow=10)
def test_the_reduced_orders_lead_to_the_same_ends(name: str, teams: int) -> None:
    """The teams are those of `robochoc check`; packets of several messages are tested with the protocols below."""
    _compare_reduced(name, 1 if protocol_named(name).traits.encrypted_tables else teams, packets=False)


@pytest.mark.parametrize("name", ["abt", "awc", "adopt"])
def test_the_reduced_orders_lead_to_the_same_ends_with_packets(name: str) -> None:
    assert _compare_reduced(name, 6, packets=True) > 3


def _compare_reduced(name: str, teams: int, *, packets: bool, most: int = 1500) -> int:
    """Compare the ends of all orders with those of the reduced ones. Return the number of compared teams."""
    protocol, compared = protocol_named(name), 0
    run = Options(protocol=name, runtime=Runtime.SIMULATOR, settings=short_settings(name, 2))
    for team in itertools.islice(small_teams(protocol.traits, 3, 2, 0), teams):
        case = check.case_of(team, protocol, run)
        stage = Stage.first_of(Course(case.compiled.team, case.phase))
        graphs = [StateGraph(stage, packets=packets, reduced=one) for one in (True, False)]
        reduced, whole = (graph.explore(most) for graph in graphs)
        assert not reduced.fault
        if whole.is_complete:
            compared += 1
            assert reduced.is_complete
            assert not whole.fault
            assert reduced.is_cyclic == whole.is_cyclic
            assert reduced.states <= whole.states
            ends, all_ends = ({state.robots for state in graph.states if graph.is_end(state)} for graph in graphs)
            assert ends == all_ends
    return compared


@pytest.mark.parametrize("number", [29, 80])
def test_a_message_behind_a_waiting_one_may_be_in_the_same_packet(number: int) -> None:
    team = next(itertools.islice(small_teams(ABT.traits, 3, 2, 7), number, None))
    options = CheckOptions(ABT, Options(protocol="abt", runtime=Runtime.SIMULATOR), packets=True)
    case = check.case_of(team, ABT, options.run)
    course = Course(case.compiled.team, case.phase)
    graphs = [StateGraph(Stage.first_of(course), packets=True, reduced=one) for one in (True, False)]
    reduced, whole = (graph.explore(3000) for graph in graphs)
    assert reduced.is_complete
    assert reduced.ends == whole.ends


class Endless(ABT):
    """Never ends its second step."""

    def receive(self, sender: str, message: Any) -> None:  # noqa: ANN401 - as its base
        while sender and message:
            pass


@pytest.mark.parametrize(
    ("mutant", "robots", "seed", "number"),
    [(AnyNogood, 4, 2, 90), (NoAnswer, 3, 0, 56)],
    ids=["any nogood", "no answer"],
)
def test_a_planted_fault_is_found_and_its_journal_shows_it(
    mutant: type[Protocol], robots: int, seed: int, number: int, tmp_path: Path
) -> None:
    run = Options(protocol="abt", runtime=Runtime.SIMULATOR)
    team = next(itertools.islice(small_teams(mutant.traits, robots, 2, seed), number, None))
    (faulty,) = checked([team], CheckOptions(mutant, run, 2000))
    assert faulty.exploration.fault
    write_counterexample(tmp_path / "run.jsonl", faulty.case, faulty.exploration.path, run)
    journal = read_journal((tmp_path / "run.jsonl").read_bytes())
    received = [(one.receiver, one.sender) for one in journal.events if isinstance(one, Received)]
    path = [(one.receiver, sender) for one in faulty.exploration.path for sender in one.senders]
    assert received == path[: len(received)]
    with pytest.raises(AssertionError, match=f"{mutant.__name__} on {team.name}, after {len(path)} steps") as raised:
        check_protocol(mutant, [team])
    assert f"\n{len(path)}. Robot" in str(raised.value)
    assert raised.match("This is the state after|A solution is|has no solution")


def test_the_guide_shows_the_report_of_a_fault() -> None:
    team = next(itertools.islice(small_teams(NoAnswer.traits, 3, 2, 0), 56, None))
    (faulty,) = checked([team], CheckOptions(NoAnswer, Options(protocol="abt", runtime=Runtime.SIMULATOR)))
    assert f"```text\n{team.name}: {faulty.report}\n```" in (ROOT / "docs" / "guides" / "check.md").read_text()


class Floods(ABT):
    """Sends twenty messages at its start, and ignores all."""

    def start(self) -> None:
        super().start()
        for name in self.problem.neighbours:
            for number in range(20):
                self.send(name, Nogood({}, (number,)))

    def receive(self, sender: str, message: Any) -> None:  # noqa: ANN401 - as its base
        pass


def test_a_state_with_too_many_packets_ends_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(state_graph, "MOST_PACKETS", 100)
    options = CheckOptions(Floods, Options(protocol="abt", runtime=Runtime.SIMULATOR), packets=True)
    (partly,) = checked([next(small_teams(ABT.traits, 3, 2, 0))], options)
    assert not partly.exploration.is_complete
    assert partly.exploration.states < options.states


class WritesToNobody(ABT):
    """Sends a message to a robot that does not exist."""

    def start(self) -> None:
        super().start()
        self.send("Nobody", Nogood({}, (0,)))


class WritesToAll(ABT):
    """Writes to robots with which it shares no constraint, and does not declare it."""

    traits = replace(ABT.traits, writes_to_non_neighbours=False)

    def start(self) -> None:
        super().start()
        for name in self.order.names:
            self.send(name, Nogood({}, (0,)))


@pytest.mark.parametrize(
    ("mutant", "fault"),
    [(WritesToNobody, "Nobody, which is not in the team"), (WritesToAll, "shares no constraint; set Traits")],
)
def test_a_message_to_a_wrong_receiver_is_a_fault(mutant: type[Protocol], fault: str) -> None:
    with pytest.raises(AssertionError, match=f"Robot1 sends a message to .*{fault}"):
        check_protocol(mutant, teams=1)


def test_a_step_without_an_end_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.exploration.local_steps.LONGEST_STEP_S", 0.2)
    with pytest.raises(AssertionError, match=r"does not end its step within 0\.2 seconds"):
        check_protocol(Endless, teams=2)


@pytest.mark.parametrize("seed", range(50))
def test_components_are_those_by_definition(seed: int) -> None:
    chance = Random(seed)
    size = chance.randint(1, 7)
    after = {node: {other for other in range(size) if chance.random() < 0.25} for node in range(size)}

    def reached(node: int) -> set[int]:
        """Return the nodes that can be reached from `node` by at least one edge."""
        seen: set[int] = set()
        left = [*after[node]]
        while left:
            if (one := left.pop()) not in seen:
                seen.add(one)
                left += after[one]
        return seen

    near = {0} | reached(0)
    expected = {frozenset(b for b in near if a in reached(b) and b in reached(a)) for a in near if a in reached(a)}
    assert {*map(frozenset, strong_components(0, after.__getitem__))} == expected


class BadStart(ABT):
    """Fails at its start."""

    def start(self) -> None:
        raise ValueError("at the start")


def test_a_fault_at_the_start_has_a_journal_too(tmp_path: Path) -> None:
    run = Options(protocol="abt", runtime=Runtime.SIMULATOR)
    (faulty,) = checked([next(small_teams(ABT.traits, 3, 2, 0))], CheckOptions(BadStart, run))
    assert faulty.exploration.fault.endswith("has failed: ValueError: at the start")
    write_counterexample(tmp_path / "run.jsonl", faulty.case, faulty.exploration.path, run)


class NotCreated(ABT):
    """Fails when it is created."""

    def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:  # noqa: ARG002 - as its base
        raise ValueError("not today")


class NoFindings(ABT):
    """Cannot report what it knows."""

    @property
    def findings(self) -> Findings:
        """Raises an error."""
        raise ValueError("not today")


class WrongFindings(ABT):
    """Reports what it knows in a wrong type."""

    findings = 3  # type: ignore[assignment]


class Exits(ABT):
    """Ends its process."""

    def receive(self, sender: str, message: Any) -> None:  # noqa: ARG002, ANN401 - as its base
        sys.exit(0)


class CountsAll(ABT):
    """Ignores each fifth message that any robot receives."""

    received: list[str] = []  # noqa: RUF012 - the fault

    def receive(self, sender: str, message: Any) -> None:  # noqa: ANN401 - as its base
        self.received.append(sender)
        if len(self.received) % 5:
            super().receive(sender, message)


class CountsInClosure(ABT):
    """Has a function whose variables a copy shares with the original."""

    def start(self) -> None:
        number = len(self.order.names)
        self.count = lambda: number
        super().start()


@pytest.mark.parametrize(
    ("mutant", "fault"),
    [
        (NotCreated, "Robot1 cannot be created: ValueError: not today"),
        (NoFindings, "Robot1 has failed: ValueError: not today"),
        (WrongFindings, "Robot1 has failed: TypeError: findings is 3; expected"),
        (Exits, "has failed: SystemExit: 0"),
        (CountsAll, "behaves differently when a step is repeated"),
        (CountsInClosure, "uses variables of another function: store a method"),
    ],
)
def test_a_protocol_that_cannot_be_explored_is_a_fault(mutant: type[Protocol], fault: str) -> None:
    with pytest.raises(AssertionError, match=fault):
        check_protocol(mutant, teams=3)


class Counts(ABT):
    """Counts up to three received messages."""

    def start(self) -> None:
        self.count(0)
        super().start()

    def receive(self, sender: str, message: Any) -> None:  # noqa: ANN401 - as its base
        super().receive(sender, message)
        self.count(min(self.holder.number + 1, 3))

    @property
    def holder(self) -> Any:  # noqa: ANN401 - any object
        """The object that has the number."""
        return self

    def count(self, number: int) -> None:
        """Store `number`."""
        self.holder.number = number


class CountsInProblem(Counts):
    """Counts them in its problem."""

    @property
    def holder(self) -> Any:  # noqa: ANN401 - any object
        """See `Counts.holder`."""
        return self.problem


def test_a_state_in_the_problem_is_a_part_of_the_state() -> None:
    def explored(protocol: type[Protocol]) -> list[tuple[int, int]]:
        options = CheckOptions(protocol, Options(protocol="abt", runtime=Runtime.SIMULATOR), 3000)
        results = [one.exploration for one in checked(itertools.islice(small_teams(ABT.traits, 3, 2, 0), 4), options)]
        assert not any(one.fault for one in results)
        return [(one.states, one.local_states) for one in results]

    assert explored(Counts) == explored(CountsInProblem) != explored(ABT)


@pytest.mark.parametrize("wrong", [{"teams": 0}, {"robots": 0}, {"states": 0}, {"losses": -1}, {"problems": []}])
def test_a_check_of_nothing_is_an_error(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"it must be|no team was checked"):
        check_protocol(ABT, **wrong)


def test_a_check_is_refused_where_it_would_be_of_something_else() -> None:
    with pytest.raises(UnsupportedError, match="does not tolerate lost messages"):
        check_protocol(ABT, losses=1)
    with pytest.raises(TypeError, match="expected a class of protocols"):
        check_protocol("abt")  # type: ignore[arg-type]


def test_after_the_deadline_nothing_counts_as_explored() -> None:
    run = Options(protocol="abt", runtime=Runtime.SIMULATOR)
    late = [*checked(itertools.islice(small_teams(ABT.traits, 3, 2, 0), 3), CheckOptions(ABT, run), deadline=0)]
    assert [one.exploration.is_complete for one in late] == [False] * 3


class EarlyEnd(ADOPT):
    """Ends the search as soon as the threshold is its lower bound."""

    def act(self) -> None:
        self.ub = self.lb if self.ub < INFINITE else self.ub
        super().act()


def test_random_runs_reach_the_ends_that_the_search_does_not_reach() -> None:
    team = next(itertools.islice(small_teams(ADOPT.traits, 3, 2, 0), 2, None))
    run = Options(protocol="adopt", runtime=Runtime.SIMULATOR)
    (partly,) = checked([team], CheckOptions(ADOPT, run, 400))
    assert partly.exploration.random_runs > 0
    assert "nor in" in partly.in_words
    (faulty,) = checked([team], CheckOptions(EarlyEnd, run, 400))
    assert faulty.exploration.states == partly.exploration.states
    assert faulty.exploration.fault.startswith("the verdict is optimal")
