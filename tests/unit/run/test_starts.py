"""The start of a search in the user's words: `solve(start=...)`, `--start`, and the epochs of a changing problem."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

import robochoc
from robochoc.communication.search_result import SearchResult
from robochoc.formats import write_team
from robochoc.journal.events import AnyEvent, Began, Improved
from robochoc.journal.journal import JournalRecorder, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, RemoveValue, ScenarioEvent, Team
from robochoc.model.team_edits import without_robots
from robochoc.modelling.terms import ModelVariable
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.context import RunContext
from robochoc.run.evaluation import Search, evaluate_search
from robochoc.run.known_costs import KnownCosts
from robochoc.run.phases import RunPhase
from robochoc.run.recording import journal_header
from robochoc.run.registry import protocol_named
from robochoc.run.starts import Start, start_in, start_of_outcome
from robochoc.run.this_machine import ThisMachine
from robochoc.solver.agent_problem import RunParameters
from robochoc.system.errors import OptionError, OptionTypeError
from robochoc.verification.checker import RefutedError
from robochoc.verification.objective import Objective
from tests.support.brute_force import solutions
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.problems import random_team
from tests.support.program import robochoc_within
from tests.support.small_teams import pair

SIMULATED = Options(protocol="syncbb", runtime=Runtime.SIMULATOR)


def charging(drones: int = 4) -> tuple[robochoc.Model, list[ModelVariable]]:
    """Return drones that charge at different times, each as close as possible to 0.5 or 1.5."""
    model = robochoc.Model("charging")
    slots = [model.robot(f"d{i}").variable("slot", [0, "0.5", 1, "1.5", 2]) for i in range(drones)]
    model.add(robochoc.all_different(slots))
    return model, slots


def colours() -> tuple[robochoc.Model, list[ModelVariable]]:
    model = robochoc.Model("colours")
    variables = [model.robot(name).variable("colour", ["red", "green", "blue"]) for name in "ABC"]
    model.add(robochoc.all_different(variables))
    return model, variables


def messages(outcome: robochoc.Outcome) -> int:
    return sum(outcome.metrics.messages.values())


def test_values_are_those_of_the_user() -> None:
    model, variables = colours()
    a, b, c = variables
    for start in ({a: "blue", "B.colour": "red", c: "green"}, {a: "blue"}):
        solution = model.solve("abt", start=start)
        assert solution[a] == "blue"
    assert "Nogood" not in model.solve("abt", start={a: "blue", b: "red", c: "green"}).metrics.messages


def test_a_solution_is_a_start() -> None:
    model, variables = colours()
    model.minimize(sum(robochoc.if_then_else(one == "green", 3, 0) for one in variables))
    first = model.solve("syncbb")
    again = model.solve("syncbb", start=first)
    assert (again.verdict, again.cost, dict(again)) == (Verdict.OPTIMAL, first.cost, dict(first))
    assert messages(again) < messages(first)
    model.add(variables[0] != first[variables[0]])
    changed = model.solve("syncbb", start=first)
    assert (changed.verdict, changed.cost) == (Verdict.OPTIMAL, 3)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"A.color": "red"}, r"start: there is no variable 'A.color'; did you mean 'A.colour'\?"),
        ({"A.colour": "pink"}, "start: A.colour cannot be 'pink'; its values are 'red', 'green' and 'blue'"),
    ],
)
def test_wrong_starts_are_refused(start: dict[str, str], message: str) -> None:
    with pytest.raises(OptionError, match=message):
        colours()[0].solve("abt", start=start)


def test_a_start_is_a_mapping() -> None:
    with pytest.raises(OptionTypeError, match="expected a mapping of variables to values, or an earlier solution"):
        colours()[0].solve("abt", start=3)  # type: ignore[arg-type]


def test_only_possible_values_begin_a_search() -> None:
    team = pair(values=2)
    assert start_in(team, {"A": 1, "B": 2, "C": 1}) == Start({"A": 1, "B": 2}, 0)
    assert start_in(team, {"A": 1, "B": 1}) == Start({"A": 1, "B": 1})
    assert start_in(team, {"A": 1, "B": 7}) == Start({"A": 1})
    assert start_in(team, {"A": 1, "B": None}) == Start({"A": 1, "B": None})
    assert start_in(team, {"A": 1, "B": None}, 5) == Start({"A": 1, "B": None}, 5)


def test_robots_that_had_withdrawn_begin_withdrawn() -> None:
    team = pair(values=1)
    outcome = solve(team, replace(SIMULATED, withdraw=Withdrawal.MINIMUM))
    (out,) = outcome.withdrawn
    start = start_of_outcome(outcome, team)
    assert start[out.removeprefix("R")] is None
    again = solve(team, replace(SIMULATED, withdraw=Withdrawal.MINIMUM, start=start))
    assert (again.verdict, again.withdrawn, dict(again.assignment)) == (
        Verdict.OPTIMAL,
        outcome.withdrawn,
        dict(outcome.assignment),
    )
    assert messages(again) < messages(outcome)


def changing(team: Team, *events: ScenarioEvent) -> Team:
    return replace(team, scenario=events)


def test_an_epoch_begins_from_the_previous_assignment() -> None:
    """Whose cost counts if the change keeps it possible: then nothing is searched again in vain."""
    for number in range(12):
        team = random_cost_team(Random(number))
        first = solve(team, SIMULATED)
        if first.cost is None:
            continue
        unused = next(
            (name, value)
            for name, one in team.variables.items()
            for value in one.domain
            if value != first.assignment[name]
        )
        changed = changing(team, ScenarioEvent((RemoveValue(*unused),)))
        begun: list[Began] = []

        def note(event: AnyEvent, begun: list[Began] = begun) -> None:
            if isinstance(event, Began):
                begun.append(event)

        warm = solve(changed, SIMULATED, observer=note)
        cold = solve(changed, replace(SIMULATED, cold=True))
        assert [epoch.cost for epoch in warm.epochs] == [epoch.cost for epoch in cold.epochs] == [first.cost] * 2
        assert warm.assignment == first.assignment
        assert begun[1].start == dict(first.assignment)
        assert begun[1].upper_bound == first.cost
        assert messages(warm) <= messages(cold)


def test_a_change_that_forbids_the_assignment_leaves_its_values_only() -> None:
    team = with_costs(pair(values=3))
    first = solve(team, SIMULATED)
    changed = changing(team, ScenarioEvent((RemoveValue("A", first.assignment["A"]),)))
    outcome = solve(changed, SIMULATED)
    assert outcome.verdict is Verdict.OPTIMAL
    assert outcome.assignment["B"] == first.assignment["B"] or outcome.assignment["A"] != first.assignment["A"]


def test_a_change_may_leave_no_solution() -> None:
    team = with_costs(pair(values=2))
    away = ScenarioEvent((RemoveValue("A", 1), RemoveValue("B", 1)))
    outcome = solve(changing(team, away), SIMULATED)
    assert outcome.verdict is Verdict.NO_SOLUTION


def test_the_start_is_the_answer_at_once_when_the_time_is_over() -> None:
    team = random_cost_team(Random(5))
    first = solve(team, SIMULATED)
    assert first.cost is not None
    cut = solve(team, replace(SIMULATED, start=dict(first.assignment), messages=1))
    assert (cut.verdict, cut.cost) == (Verdict.UNKNOWN, first.cost)


def test_the_known_cost_of_a_run_begins_with_that_of_its_start() -> None:
    team = with_costs(pair(values=2))
    known = KnownCosts(Objective(team))
    known.add(Began(t=0, protocol="SyncBB", minimises=True, start={"A": 1, "B": 2}, upper_bound=4))
    assert known.best == 4


def test_a_false_proof_is_refuted_by_the_start() -> None:
    denied = SearchResult.of(Verdict.NO_SOLUTION, "RA", {}, (), 0)
    phase = RunPhase("dpop", protocol_named("dpop"), RunParameters()).beginning_with(Start({"A": 1, "B": 2}, 0))
    with pytest.raises(RefutedError, match="the start assignment is a solution"):
        evaluate_search(phase, Search(denied, lambda: None), ProblemKind.DISWCSP, int)


def test_start_is_an_option_of_the_command_line(tmp_path: Path) -> None:
    folder, result, journal = tmp_path / "team", tmp_path / "result.json", tmp_path / "a.journal"
    write_team(replace(random_cost_team(Random(5)), name="team"), folder)
    words = ("solve", folder, "--runtime", "simulator", "--protocol", "syncbb", "--json")
    first = robochoc_within(*words, "--journal", journal)
    result.write_text(first.stdout)
    cold = json.loads(first.stdout)
    assert cold["verdict"] == "optimal"
    for file in (result, journal):
        warm = json.loads(robochoc_within(*words, "--start", file).stdout)
        assert (warm["verdict"], warm["cost"], warm["assignment"]) == ("optimal", cold["cost"], cold["assignment"])
        assert warm["metrics"]["messages"] < cold["metrics"]["messages"]


def test_files_without_a_start_are_refused(tmp_path: Path) -> None:
    folder, result = tmp_path / "team", tmp_path / "result.json"
    write_team(pair(values=2), folder)
    solved = robochoc_within("solve", folder, "--runtime", "simulator", "--json")
    other = json.loads(solved.stdout) | {"team": "elsewhere", "assignment": {"X": 1}}
    result.write_text(json.dumps(other))
    refused = robochoc_within("solve", folder, "--start", result)
    assert refused.returncode == 1
    assert f"{result}: elsewhere has none of the variables of" in refused.stderr
    assert robochoc_within("solve", folder, "--start", result, "--protocol", "central").returncode == 2
    result.write_text(json.dumps(other | {"assignment": {}, "verdict": "no-solution"}))
    begun = robochoc_within("solve", folder, "--start", result, "--runtime", "simulator")
    assert "there is no assignment to begin from" in begun.stderr
    assert begun.returncode == 0


def test_an_imported_problem_begins_from_its_original_names(tmp_path: Path) -> None:
    file = tmp_path / "p.yaml"
    file.write_text(
        "name: p\nobjective: min\ndomains: {d: {values: [R, G]}}\n"
        "variables: {v 1: {domain: d}, v 2: {domain: d}}\n"
        "constraints: {c: {type: extensional, variables: [v 1, v 2], values: {3: R R | G G, 1: R G, 0: G R}}}\n"
        "agents: [a1, a2]\n"
    )
    problem = robochoc.load(file)
    first = problem.solve("mgm", start={"v 1": "R", "v 2": "G"}, settings={"cycles": 1})
    assert first["v 1"] in {"R", "G"}
    again = problem.solve("syncbb", start=first)
    assert (again.verdict, again.cost) == (Verdict.OPTIMAL, 0)
    assert {"v 1", "v 2"} == {*again}
    with pytest.raises(OptionError, match="there is no variable 'v 3'"):
        problem.solve("syncbb", start={"v 3": "R"})


def test_after_a_loss_the_cost_of_the_start_does_not_count() -> None:
    """It was the cost of the whole team. The values still do."""
    team = random_cost_team(Random(5))
    first = solve(team, SIMULATED)
    cost = first.cost
    assert cost is not None
    phase = RunPhase("syncbb", protocol_named("syncbb"), RunParameters()).beginning_with(
        start_in(team, dict(first.assignment))
    )
    assert phase.parameters.upper_bound == cost
    machine = ThisMachine(team, RunContext(SIMULATED), None, None)
    machine.remove({team.order[0]: "lost"})
    left = machine.without_lost(phase)
    names = {variable.name for robot in team.robots[1:] for variable in robot.variables}
    assert {*left.parameters.start} == names
    remaining = without_robots(team, [team.order[0]])
    assert left.parameters.upper_bound == start_in(remaining, dict(first.assignment)).cost


@pytest.mark.parametrize("protocol", ["abt", "afc-ng", "disfc", "agile-abt", "abt-hyb"])
def test_robots_without_costs_keep_a_solution(protocol: str) -> None:
    for number in range(10):
        team = random_team(Random(number), n_ary=False)
        found = list(solutions(team))
        if not found:
            continue
        start = found[-1]
        outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, start=start))
        for name in (name for robot in team.robots for name in robot.interface):
            assert outcome.assignment[name] == start[name]


def test_a_journal_records_the_start_as_the_first_improvement() -> None:
    team = with_costs(pair(values=2))
    recorder = JournalRecorder(journal_header(team, SIMULATED), lambda: Objective(team))
    recorder(Began(t=0, protocol="SyncBB", minimises=True, start={"A": 1, "B": 2}, upper_bound=4))
    recorder.outcome = solve(team, SIMULATED)
    found = [event for event in read_journal(recorder.content()).events if isinstance(event, Improved)]
    assert [(event.t, event.cost, event.assignment) for event in found] == [(0, 4, {"A": 1, "B": 2})]
