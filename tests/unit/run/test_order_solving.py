"""Teams that solve in an order that was asked for."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.orders import Order, with_priorities
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.run.registry import protocol_named
from robochoc.solver.central import CentralAnswer
from robochoc.solver.solver_choice import AutoSolver
from robochoc.verification.checker import violations
from tests.support.brute_force import solutions
from tests.support.complex_problems import random_complex_team
from tests.support.limits import HANG_S
from tests.support.problems import random_team, shuffled
from tests.support.small_teams import graph_team
from tests.support.solver_networks import compiled_by_brute_force

SIMULATED = Options(runtime=Runtime.SIMULATOR, cache=False)


def test_robots_solve_in_the_order_they_are_given() -> None:
    chance = Random("solve")
    seen = set()
    for seed in range(80):
        team = random_team(chance)
        order = chance.choice([*Order, tuple(shuffled(chance, team))])
        outcome = solve(team, replace(SIMULATED, order=order, seed=seed, timeout=HANG_S))
        truth = next(solutions(team), None)
        assert outcome.verdict is (Verdict.NO_SOLUTION if truth is None else Verdict.SOLUTION), (team, order)
        seen.add(outcome.verdict)
    assert len(seen) == 2


def test_complex_robots_solve_in_any_order() -> None:
    chance = Random("solve complex")
    for seed in range(25):
        team = random_complex_team(chance)
        turned = with_priorities(team, shuffled(chance, team))
        result = Simulation(compiled_by_brute_force(turned), protocol_named("abt"), RandomChannels(seed)).run(30)
        assert (result.verdict is Verdict.SOLUTION) is any(solutions(team))
        if result.verdict is Verdict.SOLUTION:
            found = {name: value for own in result.assignments.values() for name, value in own.items()}
            assert not list(violations(team, found))


def test_the_priority_is_the_orders() -> None:
    """ABT's highest robot is the one that can derive the empty nogood."""
    team = graph_team(["AB", "BC", "AC"])
    for names in (("RC", "RA", "RB"), ("RB", "RC", "RA")):
        outcome = solve(team, replace(SIMULATED, order=names))
        assert (outcome.verdict, outcome.witness) == (Verdict.NO_SOLUTION, names[0])


def test_judge_and_checker_see_the_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were they shown the turned team, a fault in turning it would go unnoticed."""
    team = graph_team(["AB", "BC", "AC"])
    seen = []

    def judged(_judge: AutoSolver, merged: Team, **_: object) -> CentralAnswer:
        seen.append(merged)
        return CentralAnswer(Verdict.NO_SOLUTION)

    monkeypatch.setattr(AutoSolver, "solve", judged)
    assert solve(team, replace(SIMULATED, order=Order.DFS, verify=True)).verified
    solve(team, replace(SIMULATED, seed=1, protocol="central"))
    assert [one is team for one in seen] == [True, True]
