"""The runtime of arrays as runs see it: options, limits, events, studies, and what it refuses."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from click.testing import CliRunner

from robochoc.cli.group import cli
from robochoc.communication.arrays.array_runs import array_run_for
from robochoc.communication.arrays.session import ArraysRun
from robochoc.communication.search_result import Progress
from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.task import ProblemSpec, Recording, Setup, Task
from robochoc.generators.families import FAMILIES
from robochoc.journal.events import AnyEvent, Decided
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.dsa import DSA
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.registry import installed_protocols
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.problems import team_of
from tests.support.program import ROOT

ARRAYS = Options(protocol="dsa", runtime=Runtime.ARRAYS, settings={"cycles": "30"})
PATROL = str(ROOT / "docs" / "examples" / "patrol")
RESCUE = str(ROOT / "docs" / "examples" / "rescue")


def dear(cost: int) -> Team:
    relation = Relation("R", 2, Semantics.SOFT, ((1, 1), (2, 2)), (cost, cost), 1)
    return with_costs(team_of({"A": (1, 2), "B": (1, 2)}, [Constraint("C", relation, ("A", "B"), ("A", "B"))]))


def test_the_outcome_is_the_simulators() -> None:
    for seed in range(5):
        team = random_cost_team(Random(seed))
        options = replace(ARRAYS, seed=seed)
        arrays, objects = solve(team, options), solve(team, replace(options, runtime=Runtime.SIMULATOR))
        assert arrays.runtime == "arrays"
        assert (arrays.verdict, arrays.assignment, arrays.cost) == (objects.verdict, objects.assignment, objects.cost)
        assert arrays.metrics.messages == objects.metrics.messages
        assert arrays.metrics.ncccs == objects.metrics.ncccs


def test_a_limit_on_messages_ends_the_run_after_a_cycle() -> None:
    team = dear(3)
    run = ArraysRun(team, DSA)
    result = run.search(messages=5)
    assert result.verdict is Verdict.UNKNOWN
    assert result.metrics.messages == {"Value": 6}
    found = solve(team, replace(ARRAYS, messages=5))
    assert (found.verdict, found.reason) == (Verdict.UNKNOWN, "the limit of messages was reached (--messages 5)")


def test_a_limit_on_time_ends_the_run() -> None:
    result = ArraysRun(dear(3), DSA).search(timeout=0)
    assert result.verdict is Verdict.UNKNOWN
    assert {found.trail.cycle for found in result.findings.values() if found.trail} == {0}


def test_decisions_are_told_cycle_by_cycle_after_the_progress() -> None:
    seen: list[AnyEvent | Progress] = []
    solve(random_cost_team(Random(3)), replace(ARRAYS, repair=False), observer=seen.append, progress=seen.append)
    decided = [event for event in seen if isinstance(event, Decided)]
    assert decided
    assert [event.t for event in decided] == sorted(event.t for event in decided)
    reports = [event for event in seen if isinstance(event, Progress) and not event.stage]
    assert len(reports) == 31
    assert reports == sorted(reports)


def test_a_study_has_the_cost_over_time_of_the_simulator_in_step() -> None:
    rows = {}
    problem = ProblemSpec(family="coloring", parameters={"agents": 30, "colors": 3, "degree": 4.0, "seed": 1})
    with TaskRunner() as bench:
        for runtime, schedule in (("arrays", "concurrent"), ("simulator", "cycles")):
            setup = Setup(protocol="dsa", runtime=runtime, schedule=schedule, settings={"cycles": "20"})
            rows[runtime] = bench.run(Task(problem=problem, setup=setup, record=(Recording.COST_OVER_TIME,)))
    arrays, objects = rows["arrays"], rows["simulator"]
    assert (arrays.status, arrays.cost, arrays.messages) == (objects.status, objects.cost, objects.messages)
    assert arrays.cpu_s is not None
    assert [point.cost for point in arrays.cost_over_time] == [point.cost for point in objects.cost_over_time]
    assert arrays.cost_over_time[0].messages == 120


def test_protocols_with_a_form_say_so_and_no_other_has_one() -> None:
    for offer in installed_protocols():
        assert offer.protocol
        if offer.protocol.traits.arrays:
            assert array_run_for(offer.protocol)
        else:
            with pytest.raises(UnsupportedError, match="has no array implementation"):
                array_run_for(offer.protocol)


def test_a_users_kind_of_dsa_has_none() -> None:
    class MyDSA(DSA):
        pass

    with pytest.raises(UnsupportedError, match="MyDSA has no array implementation"):
        ArraysRun(dear(3), MyDSA)


def test_costs_that_64_bits_do_not_hold_with_what_is_broken_are_refused() -> None:
    assert solve(dear(2**50), ARRAYS).cost == 1
    with pytest.raises(UnsupportedError, match=r"2\^53"):
        solve(dear(2**55), ARRAYS)


def run(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(cli, ["solve", *words])
    return result.exit_code, result.output


@looped(
    ("words", "said"),
    [
        ((PATROL, "--protocol", "sfb"), "sfb has no array implementation"),
        ((PATROL, "--protocol", "dsa", "--journal", "out.journal"), "--runtime arrays sends no messages"),
        ((PATROL, "--protocol", "dsa", "--sniff"), "--runtime arrays sends no messages"),
        ((PATROL, "--protocol", "dsa", "--schedule", str(ScheduleName.CYCLES)), "are only for the simulator"),
        ((RESCUE, "--protocol", "mgm"), "is for problems that do not change"),
    ],
)
def test_the_command_refuses_what_does_not_go(
    words: tuple[str, ...], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    status, output = run(*words, "--runtime", "arrays")
    assert status == 2
    assert said in " ".join(output.split())


def test_the_command_solves_with_arrays() -> None:
    status, output = run(PATROL, "--runtime", "arrays", "--protocol", "dsa", "--json")
    assert status == 0
    assert '"runtime":"arrays"' in output


def test_a_large_team_of_files_runs() -> None:
    team = FAMILIES["coloring"](agents=300, colors=3, degree=4.0)
    assert solve(team, ARRAYS).metrics.messages == {"Value": 36_000}
