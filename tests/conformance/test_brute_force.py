"""The truth that conformance tests go by, against the plainest way to find it: every assignment, every constraint."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from random import Random

import pytest

from robochoc.model.problem import INFINITE, Assignment, Team
from tests.support.brute_force import least_cost, solutions
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import cost_of, random_complex_cost_team, random_cost_team
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team

KINDS = (random_team, random_complex_team, random_pkc_team, random_cost_team, random_complex_cost_team)


def assignments(team: Team) -> Iterator[Assignment]:
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        yield dict(zip(team.variables, values, strict=True))


@pytest.mark.parametrize("teams", [5, pytest.param(200, marks=pytest.mark.slow)])
def test_brute_force_is_right(teams: int) -> None:
    chance = Random("brute force")
    for make in KINDS * teams:
        team = make(chance)
        constraints = list(team.constraints())
        costs = [(cost_of(one, constraints), one) for one in assignments(team)]
        assert list(solutions(team)) == [one for cost, one in costs if cost < INFINITE]
        assert least_cost(team) == min((cost for cost, _ in costs), default=INFINITE)
