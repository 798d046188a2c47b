"""Crashes, returns and events at any moment: no fault in protocols that continue, and planted faults are found."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from robochoc.communication.host import Host
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.exploration.changes import Course, FaultPlan
from robochoc.exploration.check import CheckedTeam, CheckOptions, case_of, checked
from robochoc.exploration.counterexample import write_counterexample
from robochoc.exploration.judgement import TeamJudge
from robochoc.exploration.problems import small_teams
from robochoc.exploration.shrinking import reduced
from robochoc.exploration.stage import Stage
from robochoc.exploration.state_graph import StateGraph
from robochoc.exploration.state_key import state_key
from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import random_scenario
from robochoc.journal.events import AnyEvent, Began, Lost, Received
from robochoc.journal.journal import read_journal
from robochoc.model.problem import Team
from robochoc.protocols.inference.s_dpop import SDPOP
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.dynabt import DynABT
from robochoc.protocols.traits import ENDS_WITH_EITHER
from robochoc.run import Options, Runtime
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.explanation import Invalidated
from robochoc.solver.local_problem import LocalProblem
from robochoc.testing import check_protocol
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.program import robochoc_within

pytestmark = plain_python_only
CRASH, REJOIN, EVENT = FaultPlan(crashes=1), FaultPlan(rejoins=1), FaultPlan(events=1)


def first_teams(protocol: type[Protocol], number: int, start: int = 0) -> Sequence[Team]:
    return [*itertools.islice(small_teams(protocol.traits, 3, 2, 0), start, start + number)]


def found(protocol: type[Protocol], teams: Sequence[Team], plan: FaultPlan, states: int = 3000) -> list[CheckedTeam]:
    run = Options(protocol="dynabt" if issubclass(protocol, DynABT) else "s-dpop", runtime=Runtime.SIMULATOR)
    return [*checked(teams, CheckOptions(protocol, run, states, plan=plan))]


@pytest.mark.parametrize("name", [name for name in protocol_names() if protocol_named(name).traits.dynamic])
@pytest.mark.parametrize(
    "plan", [CRASH, REJOIN, EVENT, FaultPlan(1, 1, 1), FaultPlan(events=2)], ids=lambda plan: "-".join(map(str, plan))
)
@count("teams", fast=4, slow=60)
def test_no_change_of_the_problem_at_any_moment_leads_to_a_fault(name: str, plan: FaultPlan, teams: int) -> None:
    protocol = protocol_named(name)
    all_checked = found(protocol, first_teams(protocol, teams), plan, states=400)
    assert not [one.in_words for one in all_checked if one.exploration.fault]


class KeepsNogoods(DynABT):
    """Keeps the nogoods that were derived from removed constraints."""

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        domains = frozenset(key for key in invalidated.keys if key.endswith("="))
        super().change(problem, order, invalidated._replace(keys=domains))


class KeepsProof(DynABT):
    """Keeps its proof of no solution, also if a robot of the proof has left."""

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        verdict = self.verdict
        super().change(problem, order, invalidated)
        self.verdict = verdict


class KeepsView(DynABT):
    """Keeps the values of robots that have left."""

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        super().change(problem, order, invalidated._replace(agents=frozenset()))


class MissesNothing(DynABT):
    """Does not send again what was lost in transit."""

    def resume(self, *, lossless: bool) -> None:
        del lossless
        super().resume(lossless=True)


class TellsOnce(DynABT):
    """Forgets the robots that joined in a change before which it did not continue."""

    def change(self, problem: LocalProblem, order: PriorityOrder, invalidated: Invalidated) -> None:
        self.uninformed = []
        super().change(problem, order, invalidated)


class KeepsTables(SDPOP):
    """Keeps its tables after messages were lost."""

    def _forget_all(self) -> None:
        pass


@pytest.mark.parametrize(
    ("mutant", "plan", "number"),
    [
        (KeepsNogoods, EVENT, 27),
        (KeepsProof, EVENT, 27),
        (KeepsProof, CRASH, 2),
        (KeepsView, CRASH, 0),
        (KeepsView, EVENT, 5),
        (MissesNothing, EVENT, 3),
        (MissesNothing, CRASH, 2),
        (TellsOnce, FaultPlan(events=2), 13),
        (TellsOnce, FaultPlan(rejoins=1, events=1), 3),
        (KeepsTables, CRASH, 5),
        (KeepsTables, EVENT, 0),
    ],
)
def test_a_planted_fault_is_found_and_its_journal_shows_it(
    mutant: type[Protocol], plan: FaultPlan, number: int, tmp_path: Path
) -> None:
    (faulty,) = found(mutant, first_teams(mutant, 1, number), plan)
    assert faulty.exploration.fault
    run = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)
    write_counterexample(tmp_path / "run.jsonl", faulty.case, faulty.exploration.path, run)
    journal = read_journal((tmp_path / "run.jsonl").read_bytes())
    shown = [_step(event) for event in journal.events if isinstance(event, Received | Began | Lost)][1:]
    path: list[Any] = []
    for step in faulty.exploration.path:
        if step.change is not None:
            path += [*step.change.lost, step.change.in_words]
        path += [(step.receiver, sender) for sender in step.senders]
    assert shown == path[: len(shown)]
    assert len(shown) >= len(path) - 1  # a refused message is not recorded


def _step(event: AnyEvent) -> object:
    if isinstance(event, Received):
        return event.receiver, event.sender
    return event.robot if isinstance(event, Lost) else getattr(event, "opened_by", None)


@pytest.mark.parametrize("options", ["--crash", "--rejoin", "--event"])
@pytest.mark.parametrize("name", ["dynabt", "s-dpop"])
def test_the_journal_of_a_changed_team_can_be_replayed(
    name: str, options: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Team] = []

    def on_the_way(judge: Any, robots: Sequence[Any], _: int) -> str:  # noqa: ANN401 - as in `TeamJudge`
        seen.append(judge._compiled.team)  # noqa: SLF001 - the team that is judged
        return "it is a Sunday" if len(robots) > 1 and seen[-1].robots != seen[0].robots else ""

    monkeypatch.setattr(TeamJudge, "on_the_way", on_the_way)
    file = tmp_path / "fault.journal"
    done = robochoc_within("check", name, "--teams", 3, options, 1, "--jobs", 1, "--journal", file)
    assert done.returncode == 4, done.stderr
    replayed = robochoc_within("replay", file)
    assert (replayed.returncode, replayed.stderr) == (0, "")


def test_a_counterexample_is_reduced_to_the_events_that_matter() -> None:
    teams = [random_scenario(team, 3, 0.1) for team in first_teams(MissesNothing, 4, 2)]
    run = Options(protocol="dynabt", runtime=Runtime.SIMULATOR)
    options = CheckOptions(MissesNothing, run, 3000, plan=FaultPlan(events=3))
    faulty = next(one for one in checked(teams, options) if one.exploration.fault)
    smaller = reduced(faulty, options)
    assert smaller.exploration.fault
    assert len(smaller.team.scenario) == sum(step.change is not None for step in smaller.exploration.path) == 1


def test_the_events_are_those_of_the_scenario() -> None:
    team = random_scenario(random_csp(3, 2, 1, 0.3, seed=1), 3, 0.1)
    assert check_protocol(DynABT, [team]) < check_protocol(DynABT, [team], events=1)
    assert check_protocol(DynABT, [team], events=1) < check_protocol(DynABT, [team], events=3)
    assert check_protocol(DynABT, [team], events=3) == check_protocol(DynABT, [team], events=4)


class EndsAtOnce(DynABT):
    """May also conclude a solution: then the values of all robots count at once."""

    traits = replace(DynABT.traits, concludes=ENDS_WITH_EITHER)


def test_robots_continue_after_a_conclusion_until_the_problem_changes(monkeypatch: pytest.MonkeyPatch) -> None:
    teams = first_teams(DynABT, 1, 56)
    states = check_protocol(EndsAtOnce, teams, events=1, states=2000)
    monkeypatch.setattr("robochoc.exploration.state_graph.StateGraph._goes_on", lambda *_: False)
    assert check_protocol(EndsAtOnce, teams, events=1, states=2000) < states


class FailsAfterConclusion(DynABT):
    """Cannot use messages that arrive after its conclusion."""

    def receive(self, sender: str, message: Message) -> None:
        if self.verdict is not None:
            raise ValueError("it is over")
        super().receive(sender, message)


def test_a_robot_that_has_concluded_the_search_still_receives_messages() -> None:
    with pytest.raises(AssertionError, match="it is over"):
        check_protocol(FailsAfterConclusion, teams=60)


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["abt", "--crash", 1], "abt does not continue after a crash or an event, it starts again"),
        (["dsa", "--event", 1], "dsa does not continue after a crash or an event, it starts again"),
        (["dynabt", "--event", -1], "-1"),
    ],
)
def test_other_protocols_are_refused(words: list[object], error: str) -> None:
    done = robochoc_within("check", *words)
    assert (done.returncode, error in done.stderr, "Traceback" in done.stderr) == (2, True, False)


def test_lost_messages_are_not_combined_with_changes() -> None:
    class Both(DynABT):
        traits = replace(DynABT.traits, bears_loss=True)

    with pytest.raises(UnsupportedError, match="cannot be combined with crashes and events"):
        check_protocol(Both, losses=1, events=1)


@pytest.mark.parametrize("protocol", [DynABT, SDPOP])
@pytest.mark.parametrize("after", [5, None])
def test_the_states_of_real_runs_are_explored(protocol: type[Protocol], after: int | None) -> None:
    compared = 0
    for number, seed in itertools.product((1, 3, 5), (1, 3)):
        team = random_scenario(first_teams(protocol, 1, number)[0], 1, 0.1, seed, after=after)
        case = case_of(team, protocol, Options(protocol=protocol.__name__, runtime=Runtime.SIMULATOR))
        course = Course(case.compiled.team, case.phase, EVENT)
        graph = StateGraph(Stage.first_of(course), reduced=False)
        if not graph.explore(3_000).is_complete:
            continue
        compared += 1
        keys = [[[*map(_key, robot.hosts)] for robot in stage.robots] for stage in graph._stages]  # noqa: SLF001
        explored = {
            tuple(known[number] for known, number in zip(keys[state.stage], state.robots, strict=True))
            for state in graph.states
        }
        schedule = Concurrent(seed, 20, one_by_one=True)
        session = Simulation(course.start.compiled, protocol, schedule, parameters=case.phase.parameters)
        for epoch in course.run([]).epochs(session, lambda _: None):
            hosts = session._hosts.values()  # noqa: SLF001
            assert tuple(map(_key, hosts)) in explored, (team.name, epoch.opened_by)
    assert compared > 1


def _key(host: Host) -> tuple[str, bytes]:
    return host.name, state_key(host.protocol)
