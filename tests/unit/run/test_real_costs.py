"""Costs that people have: decimal, negative, maximised, functions. What a run says is exact, in the user's numbers."""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.kill_schedule import Kill
from robochoc.formats import write_team
from robochoc.formats.result import read_result, result_json
from robochoc.formats.team import read_team
from robochoc.model.assembly import assemble
from robochoc.model.expression import Type, parse
from robochoc.model.outcome import Verdict
from robochoc.model.problem import (
    AddValue,
    Constraint,
    CostUnits,
    Domain,
    Function,
    ProblemKind,
    RemoveValue,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.model.team_edits import without_robots
from robochoc.run.options import OnLoss, Options, Runtime, Withdrawal
from robochoc.run.orchestrator import solve
from robochoc.solver.encoding import UnsupportedError
from robochoc.verification.checker import RefutedError, check_told_cost
from tests.support.examples import count
from tests.support.real_costs import best_cost, random_costs_team

PROTOCOLS = ("central", "adopt", "dpop", "syncbb", "bnb-adopt", "bnb-adopt-fdac", "afb", "sfb")


def in_simulator(protocol: str, *, verify: bool = False) -> Options:
    return Options(protocol=protocol, runtime=Runtime.SIMULATOR, verify=verify)


@count("seeds", 30, 2000)
def test_every_complete_protocol_finds_the_exact_optimum(seeds: int) -> None:
    for seed in range(seeds):
        team = random_costs_team(seed)
        best = best_cost(team)
        for protocol in PROTOCOLS:
            outcome = solve(team, in_simulator(protocol, verify=protocol == "dpop" and seed % 10 == 0))
            told = None if outcome.cost is None else Fraction(outcome.cost)
            assert told == best, (seed, protocol)
            assert read_result(result_json(outcome)).cost == outcome.cost


@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_robots_with_processes_count_the_same(runtime: Runtime) -> None:
    for seed in (0, 5):  # functions, and a utility
        team = random_costs_team(seed)
        best = best_cost(team)
        outcome = solve(team, Options(protocol="adopt", runtime=runtime))
        assert outcome.epochs == ()
        assert (None if outcome.cost is None else Fraction(outcome.cost)) == best


@pytest.mark.slow
@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, Runtime.NETWORK])
def test_who_is_left_after_a_loss_has_the_exact_optimum(runtime: Runtime, tmp_path: Path) -> None:
    """Robots that are killed are lost, or come back in processes of their own."""
    for seed in range(25):
        chance = Random(seed)
        write_team(random_costs_team(seed), tmp_path / str(seed))
        team = read_team(tmp_path / str(seed))
        struck = chance.sample([robot.name for robot in team.robots], min(2, len(team.robots) - 1))
        spares = len(struck) * (runtime is Runtime.PROCESSES and chance.random() < 0.5)
        outcome = solve(
            team,
            Options(
                protocol=chance.choice(PROTOCOLS[1:]),
                runtime=runtime,
                kill=tuple(Kill(robot, after_s=0) for robot in struck),
                on_loss=None if spares else OnLoss.WITHDRAW,
                spares=spares,
            ),
        )
        best = best_cost(without_robots(team, outcome.lost))
        assert (None if outcome.cost is None else Fraction(outcome.cost)) == best, seed


def test_incomplete_protocols_tell_what_their_answer_costs() -> None:
    for protocol in ["dsa", "mgm", "mgm2", "maxsum"]:
        for seed in range(10):
            team = random_costs_team(seed)
            outcome = solve(team, in_simulator(protocol))
            best = best_cost(team)
            if outcome.cost is not None:
                assert best is not None
                better = outcome.cost <= best if team.robots[0].costs.maximize else outcome.cost >= best
                assert better, seed  # and `solve` has checked it against the files


def tutored() -> Team:
    """Two robots whose values should multiply to much: 0.01 for each, of which 5 is given away."""
    product = Function("product", ("X", "Y"), parse("mul(X,Y)", ("X", "Y"), Type.INTEGER))
    values = Domain("D", (range(3),))
    return assemble(
        "product",
        {"a": [Variable("x", values)], "b": [Variable("y", values)]},
        [Constraint("C", product, ("x", "y"), ("x", "y"))],
        kind=ProblemKind.DISWCSP,
        costs=CostUnits(maximize=True, places=2, constant=-5),
    )


def test_a_utility_is_told_with_its_decimal_places() -> None:
    outcome = solve(tutored(), in_simulator("adopt"))
    assert outcome.cost == Decimal("3.95")
    assert b'"cost":3.95' in result_json(outcome)
    assert outcome.assignment == {"x": 2, "y": 2}


def test_a_limit_leaves_a_bound_above_the_utility() -> None:
    outcome = solve(tutored(), replace(in_simulator("adopt"), messages=2))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.bound is None or outcome.bound >= Decimal("3.95")


def test_epochs_tell_their_own_costs() -> None:
    events = (ScenarioEvent((RemoveValue("x", 2),)), ScenarioEvent((AddValue("y", 7),)))
    team = replace(tutored(), scenario=events)
    for protocol in ("adopt", "central"):
        outcome = solve(team, in_simulator(protocol))
        assert [epoch.cost for epoch in outcome.epochs] == [Decimal("3.95"), Decimal("1.95"), Decimal("6.95")]


def test_a_value_that_nobody_named_is_refused_where_costs_are_functions() -> None:
    events = iter([ScenarioEvent((AddValue("y", 9),))])
    with pytest.raises(UnsupportedError, match="the value 9 is new to y"):
        solve(tutored(), in_simulator("adopt"), environment=lambda *_: next(events, None))


def test_withdrawal_and_utilities_do_not_go_together() -> None:
    with pytest.raises(UnsupportedError, match="negative costs, or utilities"):
        solve(tutored(), replace(in_simulator("adopt"), withdraw=Withdrawal.MINIMUM))


def test_a_wrong_cost_is_refuted() -> None:
    check_told_cost(tutored(), {"x": 1, "y": 2}, Decimal("1.95"))
    with pytest.raises(RefutedError, match=r"costs 1\.95, and it is said to cost 2"):
        check_told_cost(tutored(), {"x": 1, "y": 2}, 2)
