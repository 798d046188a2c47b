"""OR-Tools as a second central solver: it says what ACE says, ends in time, and leaves nothing behind."""

from __future__ import annotations

import importlib.util
import json
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from random import Random

import pytest

from robochoc.formats import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.generators.random_csp import random_csp
from robochoc.model.expression import Name
from robochoc.model.outcome import CENTRAL_SOLVER, Verdict
from robochoc.model.problem import Constraint, Domain, Function, ProblemKind, Relation, Robot, Semantics, Team, Variable
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.options import CentralSolverName
from robochoc.solver import cp_sat
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralAnswer, CentralSolver
from robochoc.solver.cp_sat import CpSatSolver
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.verification.checker import RefutedError
from robochoc.verification.objective import withdrawal_cost
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_complex_cost_team, random_cost_team, random_hard_team, with_costs
from tests.support.limits import HANG_S
from tests.support.moved_clock import MovedClock
from tests.support.program import robochoc_within

needs_ortools = pytest.mark.skipif(importlib.util.find_spec("ortools") is None, reason="the extra ortools")
CENTRAL = Options(protocol="central", central_with=CentralSolverName.ORTOOLS)
SIMULATED = Options(protocol="syncbb", runtime=Runtime.SIMULATOR, verify=True)
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 13))]
EACH = 36


@pytest.fixture
def cp() -> Iterator[CpSatSolver]:
    with CpSatSolver() as solver:
        yield solver


def any_team(chance: Random) -> Team:
    return chance.choice([random_cost_team, random_complex_cost_team, random_hard_team])(chance)


def same(one: CentralAnswer, other: CentralAnswer) -> bool:
    return (one.verdict, one.cost, one.bound) == (other.verdict, other.cost, other.bound)


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
@pytest.mark.parametrize("batch", BATCHES)
def test_both_solvers_find_the_same(batch: int, cp: CpSatSolver) -> None:
    with AceProcess(always=batch > 0) as ace:
        for seed in range(EACH * batch, EACH * (batch + 1)):
            team = any_team(Random(seed))
            found, expected = cp.solve(team), CentralSolver(solver=ace).solve(team)
            assert same(found, expected), seed
            if found.cost is not None:
                assert found.cost == least_cost(team), seed
            if found.verdict is Verdict.NO_SOLUTION:
                price = int(withdrawal_cost(team))
                found, expected = (
                    solver.solve(team, withdrawal_cost=price) for solver in (cp, CentralSolver(solver=ace))
                )
                assert same(found, expected), seed


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
def test_whole_runs_of_it_are_checked_as_those_of_ace_are() -> None:
    team = queens3d(4)
    assert solve(team, CENTRAL).verdict is Verdict.NO_SOLUTION
    outcome = solve(team, replace(CENTRAL, withdraw=Withdrawal.MINIMUM))
    by_ace = solve(team, replace(CENTRAL, withdraw=Withdrawal.MINIMUM, central_with=CentralSolverName.ACE))
    assert outcome.verified
    assert len(outcome.withdrawn) == len(by_ace.withdrawn)


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
def test_decimals_that_are_maximised() -> None:
    domain = Domain("D", (range(4),))
    tables = Relation("R", 2, Semantics.SOFT, ((0, 1), (1, 2), (2, 3)), (25, -150, 75), 10)
    constraints = (Constraint("C", tables, ("V1", "V2"), ("V1", "V2"), model=None),)
    robot = Robot("R1", (Variable("V1", domain), Variable("V2", domain)), ProblemKind.DISWCSP, constraints)
    robot = replace(robot, costs=replace(robot.costs, maximize=True, places=2, constant=5))
    outcome = solve(Team("sum", (robot,)), CENTRAL)
    assert (outcome.verdict, str(outcome.cost)) == (Verdict.OPTIMAL, "0.80")
    assert outcome.assignment == {"V1": 2, "V2": 3}


@needs_ortools
def test_a_time_limit_ends_its_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time is over once OR-Tools has been searching for a while."""
    clock, pids = MovedClock(), list[int | None]()
    monkeypatch.setattr(cp_sat, "time", clock)

    def over() -> None:
        pids.append(solver.pid)
        clock.end()

    solver = CpSatSolver(time.monotonic() + HANG_S, over)
    assert solver.solve(random_csp(30, 8, 0.3, 0, 1, max_cost=100)).verdict is Verdict.UNKNOWN
    assert solver.pid is None
    assert pids[0]
    with pytest.raises(ProcessLookupError):
        os.kill(pids[0], 0)


def test_without_time_nothing_is_started() -> None:
    solver = CpSatSolver(deadline=time.monotonic() - 1)
    if cp_sat.is_installed():
        assert solver.solve(queens3d(4)).verdict is Verdict.UNKNOWN
    assert solver.pid is None


@needs_ortools
def test_a_process_that_dies_is_lost_and_the_next_task_starts_another(
    cp: CpSatSolver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cp_sat, "sys", type("sys", (), {"executable": "/bin/false"}))
    with pytest.raises(SolverLostError, match="was lost"):
        cp.solve(queens3d(4))
    monkeypatch.undo()
    assert cp.solve(queens3d(4)).verdict is Verdict.NO_SOLUTION


def test_without_the_extra_it_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cp_sat, "is_installed", lambda: False)
    with pytest.raises(SolverMissingError, match=r"robochoc\[ortools\]"):
        solve(queens3d(4), CENTRAL)
    outcome = solve(with_costs(queens3d(3)), SIMULATED)
    assert outcome.confirmed_by == (CENTRAL_SOLVER,)


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
def test_verify_asks_both() -> None:
    outcome = solve(with_costs(queens3d(3)), SIMULATED)
    assert outcome.confirmed
    assert outcome.confirmed_by == (CENTRAL_SOLVER, "OR-Tools")


@needs_ortools
def test_a_second_solver_that_disagrees_refutes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(CpSatSolver, "solve", lambda *_, **__: CentralAnswer(Verdict.OPTIMAL, {}, cost=-1, bound=-1))
    with pytest.raises(RefutedError, match="OR-Tools has found"):
        solve(with_costs(queens3d(3)), SIMULATED)


def test_costs_beyond_its_integers_are_refused() -> None:
    domain = Domain("D", (range(3),))
    huge = Relation("R", 1, Semantics.SOFT, ((0,), (1,)), (10**17, 1), 3)
    other = Function("F", ("X",), Name("X"))
    constraints = tuple(Constraint("C", one, ("V1",), ("V1",), model=None) for one in (huge, other))
    team = Team("huge", (Robot("R1", (Variable("V1", domain),), ProblemKind.DISWCSP, constraints),))
    with pytest.raises(UnsupportedError):
        CpSatSolver().solve(team)


@pytest.mark.usefixtures("shared_solvers")
@needs_ortools
def test_the_command_line_and_json(tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = tmp_path_factory.mktemp("team") / "q4"
    write_team(queens3d(4), folder)
    done = robochoc_within("solve", str(folder), "--protocol", "central", "--with", "ortools", "--json")
    assert json.loads(done.stdout)["verdict"] == "no-solution"
    refused = robochoc_within("solve", str(folder), "--with", "ortools")
    assert refused.returncode == 2
    assert "add --protocol central" in refused.stderr
    refused = robochoc_within("solve", str(folder), "--protocol", "central", "--with", "ortools", "--count")
    assert refused.returncode == 2
