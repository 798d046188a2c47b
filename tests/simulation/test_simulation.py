"""The simulator of `make simulate`: a few seeds, and a planted fault that it finds and makes small."""

from __future__ import annotations

import itertools
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run import Options, Runtime, Withdrawal
from tests.simulation import __main__ as simulate
from tests.simulation import minimising
from tests.simulation.__main__ import main
from tests.simulation.clock import HangError, VirtualClock
from tests.simulation.drawing import drawn_plan
from tests.simulation.invariants import Finding
from tests.simulation.minimising import minimised, repeated
from tests.simulation.plan import FIXED, Fault, FaultKind, Plan, changed_options
from tests.simulation.playing import FullDisk, examine
from tests.support.compiled import plain_python_only

SEEDS = 16


def test_no_seed_has_a_finding() -> None:
    reports = {seed: examine(drawn_plan(seed)) for seed in range(SEEDS)}
    assert {seed: report.findings for seed, report in reports.items() if report.findings} == {}
    assert sum(bool(report.refused) for report in reports.values()) < SEEDS // 5
    assert {"solution", "optimal", "no-solution", "unknown"} <= {report.verdict for report in reports.values()}


def test_environments_filters_private_runs_and_revocations_are_simulated() -> None:
    kinds: dict[str, Callable[[Plan], object]] = {
        "environment": lambda plan: plan.environment,
        "filters": lambda plan: plan.options.filters,
        "private": lambda plan: plan.private,
        "revocation": lambda plan: plan.has(FaultKind.REVOKE),
    }
    plans = [drawn_plan(seed) for seed in range(600)]
    for name, has in kinds.items():
        reports = [examine(plan) for plan in [plan for plan in plans if has(plan)][:2]]
        assert [report.findings for report in reports] == [[], []], name
        assert any(report.runs and not report.refused for report in reports), name


def test_the_same_seed_gives_the_same_plan_and_run() -> None:
    for seed in range(3):
        assert drawn_plan(seed) == drawn_plan(seed)
        one, other = examine(drawn_plan(seed)), examine(drawn_plan(seed))
        assert one == other
    assert drawn_plan(0) != drawn_plan(1)


def test_a_stopped_robot_delays_an_answer_by_a_few_seconds_only() -> None:
    """With a deadline of 10 s; also if the robot is stopped between the verdict and its report."""
    team = random_csp(3, 2, 1, 0, seed=1, max_cost=9)
    options = Options(protocol="syncbb", runtime=Runtime.PROCESSES, cache=False, deadline=10, patience=1000)
    latest = []
    for number in range(60):
        stop = Fault(FaultKind.STOP, team.order[number % 3], number / 10, 10_000)
        report = examine(Plan(number * 3 + 1, team, options, (stop,), tick_s=1e-6, delay_s=0.2))
        assert not report.findings
        assert report.verdict in {"optimal", "solution", "unknown"}
        latest.append(report.robot_s / 3)
    assert 14 < max(latest) < 16


def test_answers_of_processes_at_a_deadline_replay_if_robots_have_no_values_yet() -> None:
    """Found by `make simulate`: robots that had decided on nothing counted as withdrawn, and `replay` disagreed."""
    options = Options(protocol="asym-pt-fb", runtime=Runtime.PROCESSES, cache=False, withdraw=Withdrawal.MINIMUM)
    verdicts = Counter[str]()
    for seed in range(40):
        team = random_csp(4, 3, 0.7, 0.3, seed=seed, max_cost=9)
        report = examine(Plan(seed, team, replace(options, deadline=1 + seed / 40), tick_s=1e-6, delay_s=0.1))
        assert not report.findings, seed
        verdicts[report.verdict] += 1
    assert verdicts["solution"] > 20


def test_answers_that_were_published_before_a_loss_do_not_count() -> None:
    """Found by `make simulate`: an answer of all robots was followed by a worse one of the remaining robots."""
    options = Options(protocol="adopt", runtime=Runtime.PROCESSES, cache=False, withdraw=Withdrawal.MINIMUM)
    options = replace(options, deadline=10, improve=300, patience=1, spares=1)
    for seed in range(8):
        team = random_csp(4, 3, 0.9, 0.2, seed=seed, max_cost=9)
        stop = Fault(FaultKind.STOP, team.order[2], 12 + seed, 50)
        report = examine(Plan(seed * 3 + 1, team, options, (stop,), tick_s=1e-6, delay_s=2.0))
        assert not report.findings, seed


def test_a_master_does_not_poll_while_robots_report_whether_they_continue() -> None:
    """Found by `make simulate`: with lost messages, the master read its clock a million times in three seconds."""
    options = Options(protocol="mcs-mgm", runtime=Runtime.PROCESSES, cache=False, messages=2000, message_loss=0.1)
    for seed in range(3):
        team = random_csp(4, 3, 0.7, 0.3, seed=seed, max_cost=9)
        assert not examine(Plan(seed * 3 + 1, team, options, tick_s=1e-6, delay_s=0.01)).findings, seed


@pytest.fixture
def deaf(monkeypatch: pytest.MonkeyPatch) -> pytest.MonkeyPatch:
    """Let the robots of ABT ignore the third message that each of them receives."""
    received, right = Counter[int](), ABT.receive

    def receive(protocol: ABT, sender: str, message: Message) -> None:
        received[id(protocol)] += 1
        if received[id(protocol)] != 3:
            right(protocol, sender, message)

    def start(protocol: ABT) -> None:
        received[id(protocol)] = 0
        right_start(protocol)

    right_start = ABT.start
    monkeypatch.setattr(ABT, "receive", receive)
    monkeypatch.setattr(ABT, "start", start)
    return monkeypatch


def small_plan(seed: int) -> Plan:
    """Return a plan of ABT with a fault and an order: its runs are short, whatever is drawn for other plans."""
    team = random_csp(4, 3, 0.9, 0.4, seed=seed)
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, cache=False, order=(*reversed(team.order),))
    return Plan(seed, team, options, (Fault(FaultKind.CLOCK, at_s=1, for_s=2),))


@pytest.fixture
def _small_plans() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for module in (simulate, minimising):
            patch.setattr(module, "drawn_plan", small_plan)
        yield


@plain_python_only
@pytest.mark.usefixtures("_small_plans")
def test_a_planted_fault_is_found_and_made_small(
    deaf: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, finding = next((plan, found) for plan in map(small_plan, range(20)) for found in examine(plan).findings)
    deaf.setattr(sys, "argv", ["simulate", "--seed", str(plan.seed), "--count", "1", "--out", str(tmp_path)])
    assert main() == 1
    (file,) = tmp_path.glob("*.json")
    assert "findings: " in capsys.readouterr().out
    content = json.loads(file.read_bytes())
    assert content["finding"] == finding.kind
    smaller = repeated(plan, content["reductions"])
    assert smaller.faults == ()
    assert smaller.options.order is None
    sizes = [[len(one.domain) for one in each.team.variables.values()] for each in (smaller, plan)]
    assert sum(sizes[0]) < sum(sizes[1])
    deaf.setattr(sys, "argv", ["simulate", "--repeat", str(file)])
    assert main() == 1
    assert finding.kind in capsys.readouterr().out
    deaf.undo()
    deaf.setattr(sys, "argv", ["simulate", "--repeat", str(file)])
    assert main() == 0
    for text, fault in [
        (json.dumps(content | {"plan": {}}), f"seed {plan.seed} decides another run now"),
        (json.dumps(content | {"reductions": [["robot"]]}), "is not a finding of this version"),
        ("[]", "is not a finding of this version"),
        ("{", "is not a finding of this version"),
        (None, "No such file"),
    ]:
        file.unlink() if text is None else file.write_text(text)
        with pytest.raises(SystemExit, match="2"):
            main()
        assert fault in capsys.readouterr().err


def test_minimisation_keeps_the_kind_of_a_finding_and_ends() -> None:
    plan = next(plan for plan in map(drawn_plan, itertools.count()) if len(plan.team.robots) > 3 and plan.faults)

    def find(plan: Plan) -> list[Finding]:
        return [Finding("large" if len(plan.team.robots) > 2 else "small", "")]

    smaller = minimised(plan, "large", find)
    assert len(smaller.team.robots) == 3
    assert (smaller.faults, changed_options(smaller.options).keys() - FIXED) == ((), set())
    assert minimised(plan, "large", find, most=0) is plan


def test_the_clock_jumps_and_detects_runs_without_an_end() -> None:
    clock = VirtualClock(1.0, ((2.0, 10.0),))
    assert [clock.monotonic() for _ in range(4)] == [1.0, 12.0, 13.0, 14.0]
    with pytest.raises(HangError):
        clock.advance_to(1e10)


def test_a_full_disk_keeps_the_beginning_of_a_journal() -> None:
    disk = FullDisk(5)
    disk.write(b"abc")
    with pytest.raises(OSError, match="space"):
        disk.write(b"defg")
    assert disk.content == b"abcde"
