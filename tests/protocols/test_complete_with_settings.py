"""Complete protocols with settings that change how they search, against brute force; conformance uses the defaults."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.model.outcome import Verdict
from robochoc.run import Withdrawal, solve
from robochoc.solver.ace import AceProcess
from tests.support.cases import looped
from tests.support.cost_problems import minimum_withdrawal
from tests.support.loose_problems import check_against_brute_force, loosened, loosened_cost_team
from tests.support.problems import random_team
from tests.support.random_options import random_options

SETTINGS: list[tuple[str, dict[str, str]]] = [
    *(("adopt-k", {"k": k}) for k in ("1", "2", "3", "5", "inf")),
    *(("adopt-k", {"k": k, "heuristic": "dp"}) for k in ("1", "3", "1000")),
    *(("bnb-adopt-fdac", {"level": level}) for level in ("ac", "fdac")),
    ("bnb-adopt", {"heuristic": "dp"}),
]
BATCHES = pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 9))])


@BATCHES
@pytest.mark.usefixtures("warm_ace")
@looped(("protocol", "settings"), SETTINGS)
def test_the_least_cost_is_found(protocol: str, settings: dict[str, str], batch: int) -> None:
    chance = Random(f"{protocol} {settings} {batch}")
    with AceProcess() as solver:
        for _ in range(200 if batch else 5):
            team = loosened_cost_team(chance)
            options = replace(random_options(team, protocol, chance), settings=settings)
            outcome = check_against_brute_force(team, options, solver)
            assert outcome.verdict in {Verdict.OPTIMAL, Verdict.NO_SOLUTION}


@pytest.mark.parametrize("teams", [4, pytest.param(60, marks=pytest.mark.slow)])
@looped(("protocol", "settings"), [one for one in SETTINGS if "heuristic" not in one[1]])
def test_as_few_as_possible_withdraw(protocol: str, settings: dict[str, str], teams: int) -> None:
    chance = Random(f"withdraw {protocol} {settings}")
    for _ in range(teams):
        team = loosened(random_team(chance), chance)
        team = replace(team, robots=tuple(replace(one, weight=chance.choice((1, 1, 2, 3))) for one in team.robots))
        options = random_options(team, protocol, chance)
        outcome = solve(team, replace(options, settings=settings, withdraw=Withdrawal.MINIMUM))
        assert sum(team[name].weight for name in outcome.withdrawn) == minimum_withdrawal(team)
