"""Answers to one problem are compared: which pairs contradict each other, and how they are repeated."""

from __future__ import annotations

import shlex
from pathlib import Path

import msgspec
import pytest

from robochoc.experiments.agreement import Agreement, DisagreementError, contradiction, repeat_commands
from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.task import Limits, ProblemSpec, Row, Setup, Status, Task
from tests.support.cases import cases
from tests.support.program import robochoc_within

SOLUTION, NONE = ("solution", None), ("no-solution", None)


def row(verdict: str, cost: str | None = None, *, maximises: bool = False, withdrawn: int = 0) -> Row:
    return Row(
        status=Status.DONE, verdict=verdict, cost=cost, maximises=maximises, withdrawn=withdrawn, digest="d", team="t"
    )


def test_contradictions() -> None:
    with cases() as each:
        for one, other, why in [
            (row("solution"), row("solution"), ""),
            (row("no-solution"), row("no-solution"), ""),
            (row("solution"), row("no-solution"), "solution and no-solution"),
            (row("optimal", "3"), row("no-solution"), "optimal and no-solution"),
            (row("optimal", "3"), row("optimal", "3"), ""),
            (row("optimal", "3.0"), row("optimal", "3"), ""),
            (row("optimal", "3"), row("optimal", "4"), "3 was reported as optimal, but 4 was found"),
            (row("optimal", "3"), row("solution", "4"), ""),
            (row("optimal", "3"), row("solution", "2.99"), "2.99 was found"),
            (row("optimal", "3", maximises=True), row("solution", "2", maximises=True), ""),
            (row("optimal", "3", maximises=True), row("solution", "4", maximises=True), "4 was found"),
            (row("solution", "4"), row("solution", "2"), ""),
            (row("optimal", withdrawn=1), row("optimal", withdrawn=2), "at least 1 and at least 2 robots withdraw"),
            (row("optimal", "3", withdrawn=1), row("solution", "1", withdrawn=2), ""),
        ]:
            with each((one.verdict, one.cost, other.verdict, other.cost)):
                for pair in ((one, other), (other, one)):
                    found = contradiction(*pair)
                    assert bool(found) == bool(why)
                assert why in contradiction(one, other)


def test_the_commands_leave_the_users_files_alone() -> None:
    problem = ProblemSpec(path="mine", digest="x", scenario={"events": 3, "rate": 0.3, "seed": 1})
    told = repeat_commands(Task(problem=problem, setup=Setup(protocol="dynabt"), limits=Limits(messages=9)))
    assert told == (
        "robochoc generate scenario mine --events 3 --rate 0.3 --seed 1 -o PROBLEM"
        " && robochoc solve PROBLEM --protocol dynabt --runtime simulator --messages 9"
    )
    foreign = ProblemSpec(path="w.yaml", digest="x", parameters={"instance": "w.yaml", "infinity": 10, "owner": "(.)"})
    told = repeat_commands(Task(problem=foreign, setup=Setup(protocol="sfb")))
    assert told == "robochoc solve w.yaml --protocol sfb --runtime simulator --owner '(.)' --infinity 10"


TASK = Task(problem=ProblemSpec(family="queens3d", parameters={"n": 2}), setup=Setup(protocol="abt", label="abt"))


def test_two_that_differ_are_told_with_the_commands_that_repeat_them() -> None:
    agreement = Agreement()
    agreement.add(TASK, row("solution"))
    agreement.add(TASK, Row(status=Status.LIMIT, digest="d"))
    with pytest.raises(DisagreementError) as caught:
        agreement.add(TASK, row("no-solution"))
    assert "abt and abt contradict each other on t" in str(caught.value)
    assert str(caught.value).count("robochoc generate queens3d --n 2 -o PROBLEM && robochoc solve PROBLEM") == 2
    with pytest.raises(DisagreementError, match="the checker refutes the answer of abt: because"):
        Agreement().add(TASK, Row(status=Status.REFUTED, reason="because"))


def test_other_problems_and_rules_of_withdrawal_are_other_questions() -> None:
    agreement = Agreement()
    agreement.add(TASK, row("no-solution"))
    other = Task(problem=TASK.problem, setup=Setup(protocol="abt", withdraw="minimum"))
    agreement.add(other, row("solution"))
    elsewhere = row("solution")
    elsewhere.digest = "e"
    agreement.add(TASK, elsewhere)


@pytest.mark.parametrize(
    ("problem", "setup"),
    [
        (
            {
                "family": "random",
                "parameters": {"agents": 5, "domain": 3, "density": 0.5, "max_cost": 9, "maximize": True},
            },
            {"protocol": "dsa", "settings": {"cycles": "7"}, "order": "dfs", "delay": 3},
        ),
        (
            {
                "family": "random",
                "parameters": {"agents": 5, "domain": 3, "graph": "grid", "torus": False, "rows": 1, "tightness": 0.3},
                "scenario": {"events": 2, "rate": 0.3, "kinds": "add-value remove-value"},
            },
            {"protocol": "dynabt", "schedule": "random"},
        ),
        ({"family": "queens3d", "parameters": {"n": 3}}, {"protocol": "abt", "withdraw": "minimum", "verify": True}),
    ],
)
def test_the_commands_repeat_the_run(
    problem: dict[str, object], setup: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    task = Task(problem=msgspec.convert(problem, ProblemSpec), setup=msgspec.convert(setup, Setup), seed=5)
    *made, solved = repeat_commands(task).split(" && ")
    for words in made:
        assert robochoc_within(*shlex.split(words)[1:]).returncode == 0, words
    done = robochoc_within(*shlex.split(solved)[1:], "--json")
    with TaskRunner() as bench:
        found = bench.run(task)
    result = msgspec.json.decode(done.stdout)
    assert result["metrics"]["messages"] == found.messages
    assert result["metrics"]["ncccs"] == found.ncccs
    assert result["verdict"] == found.verdict
