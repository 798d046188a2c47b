"""The central solver on costs when the time is over: the best so far, and what is proven of the rest."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

from robochoc.formats import PREDEFINED
from robochoc.generators.coloring import coloring
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import CentralSolverName
from robochoc.solver import central
from robochoc.solver.ace import AceProcess
from robochoc.solver.ace_messages import BEST
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.encoding import CodeTable, Network
from robochoc.solver.errors import SolverTimeoutError
from robochoc.solver.weighted import weighted_components
from robochoc.verification.checker import assignment_cost, robots_without_values, violations
from tests.support.compiled import plain_python_only
from tests.support.cost_problems import with_costs
from tests.support.limits import HANG_S, wait_until
from tests.support.moved_clock import MovedClock
from tests.support.problems import team_of
from tests.support.solver_networks import queens_network

CENTRAL = Options(protocol="central", central_with=CentralSolverName.ACE)
SOON_S = 0.05


@cache
def hard() -> Team:
    """Return a problem for which hours would not do."""
    return random_csp(30, 8, 0.3, 0, 1, max_cost=100)


@cache
def small() -> Team:
    return random_csp(3, 3, 1, 0, 1, max_cost=9)


def endless(*_: object, **__: object) -> None:
    while True:
        pass


@pytest.fixture
def warm(warm_ace: None) -> Iterator[AceProcess]:
    """A process that has minimised something before."""
    del warm_ace
    with AceProcess(always=True) as one:
        solve(coloring(3, 2, 2), CENTRAL, solver=one)
        yield one


def wait_for_a_best(solver: AceProcess) -> None:
    """Wait until ACE has printed a solution."""
    file: Path = vars(solver)["_folder"].path / BEST
    wait_until(lambda: file.exists() and b"</values>" in file.read_bytes(), "ACE has found nothing")


@pytest.fixture
def over_with_a_best(warm: AceProcess, monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """The judge's time stands still, until it calls this, and there is a solution."""
    clock = MovedClock()
    monkeypatch.setattr(central, "time", clock)

    def over(*_: object) -> None:
        wait_for_a_best(warm)
        clock.end()

    return over


def test_when_the_time_is_over_the_best_so_far_is_told(warm: AceProcess, over_with_a_best: Callable[..., None]) -> None:
    outcome = solve(hard(), replace(CENTRAL, timeout=HANG_S), solver=warm, progress=over_with_a_best)
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.bound is not None
    assert outcome.cost == assignment_cost(hard(), outcome.assignment) > outcome.bound
    assert outcome.verified


def test_without_an_answer_until_then_there_is_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two parts one is seen through without ACE."""
    unary = Relation("U", 1, Semantics.SOFT, ((1,), (2,)), (5, 4), 0)
    differ = Constraint("D", PREDEFINED["ne"], ("A", "B"), ("A", "B"), cost=3)
    domains = {"A": (1, 2), "B": (1, 2), "C": (1, 2)}
    team = with_costs(team_of(domains, [differ, Constraint("U", unary, ("C",), ("C",))]))
    clock = MovedClock()
    clock.end()
    monkeypatch.setattr(central, "time", clock)
    judgement = CentralSolver(deadline=time.monotonic() + HANG_S).solve(team)
    assert judgement == CentralAnswer(Verdict.UNKNOWN, bound=4)


@pytest.mark.parametrize("step", ["weighted.components", "weighted.propagate", "weighted.costs_by_scope"])
def test_preparation_without_an_end_ends_with_the_time(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"robochoc.solver.{step}", endless)
    outcome = solve(small(), replace(CENTRAL, timeout=SOON_S))
    assert outcome.verdict is Verdict.UNKNOWN


@pytest.mark.parametrize("step", ["central.components", "central.symmetries", "central.with_cliques", "ace.propagate"])
def test_preparation_without_costs_ends_with_the_time(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"robochoc.solver.{step}", endless)
    outcome = solve(queens3d(4), replace(CENTRAL, timeout=SOON_S))
    assert outcome.verdict is Verdict.UNKNOWN


def test_compilation_without_an_end_ends_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.solver.compile.compile_domain", endless)
    outcome = solve(small(), Options(protocol="dpop", timeout=SOON_S))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.reason == "the time limit was exceeded while Robot1 was compiled"


@plain_python_only
@pytest.mark.parametrize("step", ["start", "receive", "__init__"])
def test_a_step_of_a_robot_without_an_end_ends_with_the_time(step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ABT, step, endless)
    options = Options(protocol="abt", runtime=Runtime.SIMULATOR, timeout=SOON_S)
    assert solve(queens3d(3), options).verdict is Verdict.UNKNOWN


def test_the_choice_of_a_protocol_ends_with_the_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robochoc.run.orchestrator.choose", endless)
    outcome = solve(small(), Options(protocol="auto", runtime=Runtime.SIMULATOR, timeout=SOON_S))
    assert (outcome.verdict, outcome.protocol) == (Verdict.UNKNOWN, "sfb")
    assert outcome.chosen == {"protocol": "there was no time to analyse the team"}


def test_a_process_that_does_not_read_its_task_is_given_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """While Java starts it reads nothing, and a large task does not fit into the socket."""
    program = tmp_path / "sleeping"
    program.write_text("#!/bin/sh\nexec sleep 1000\n")
    program.chmod(0o700)
    monkeypatch.setattr("robochoc.solver.ace.sys", SimpleNamespace(executable=str(program)))
    monkeypatch.setattr("robochoc.solver.ace.msgspec.msgpack.encode", lambda _: bytes(10**7))
    with AceProcess(always=True) as sleeping, pytest.raises(SolverTimeoutError):
        sleeping.solve(queens_network(4), deadline=time.monotonic() + SOON_S)


def test_a_task_that_is_given_up_has_a_best_once_ace_has_one(warm: AceProcess) -> None:
    """And it is no solution of the task before."""
    (part,) = weighted_components(hard().variables.values(), list(hard().constraints()))
    warm.submit(part.network, costs=part.costs)
    wait_for_a_best(warm)
    with pytest.raises(SolverTimeoutError) as over:
        warm.answer(time.monotonic())
    best = over.value.best
    assert best is not None
    assert part.cost(best) == assignment_cost(hard(), part.decoded(best))


def test_what_was_found_for_another_task_is_not_told(warm: AceProcess) -> None:
    rows = tuple((a, b, (a + b) % 3) for a in range(3) for b in range(3))
    network = Network(((0, 1, 2), (0, 1, 2), (0, 1, 2)), (CodeTable((0, 1, 2), allowed=True, rows=rows),))
    assert warm.submit(network, costs=((2, 1),))
    assert warm.answer().solutions[0] in rows
    (part,) = weighted_components(hard().variables.values(), list(hard().constraints()))
    assert warm.submit(part.network, costs=part.costs)
    best = warm.abort().best
    assert best is None or part.cost(best) < INFINITE


@pytest.mark.slow
def test_when_the_time_is_over_those_who_stay_so_far_are_told(
    warm: AceProcess, over_with_a_best: Callable[..., None]
) -> None:
    team = queens3d(6)
    judge = CentralSolver(deadline=time.monotonic() + HANG_S, progress=over_with_a_best, solver=warm)
    judgement = judge.solve(team, withdrawal_cost=1)
    away = robots_without_values(team, judgement.assignment)
    assert judgement.verdict is Verdict.UNKNOWN
    assert judgement.cost == len(away) == 36 - len(judgement.assignment)
    assert not list(violations(team, judgement.assignment, away))
