"""The truth that conformance tests go by, against the plainest way to find it: every assignment, every constraint."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import pytest

from robochoc.model.problem import INFINITE, Assignment, Team
from tests.support.brute_force import least_cost, solutions
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import cost_of, random_complex_cost_team, random_cost_team
from tests.support.examples import count, drawn
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team

pytestmark = pytest.mark.fresh
KINDS = (random_team, random_complex_team, random_pkc_team, random_cost_team, random_complex_cost_team)


def assignments(team: Team) -> Iterator[Assignment]:
    for values in itertools.product(*(variable.domain for variable in team.variables.values())):
        yield dict(zip(team.variables, values, strict=True))


@count("teams", 4, 200)
def test_brute_force_is_right(teams: int) -> None:
    for number, make in enumerate(KINDS * teams):
        team = make(drawn(f"brute force {number}"))
        constraints = list(team.constraints())
        costs = [(cost_of(one, constraints), one) for one in assignments(team)]
        assert list(solutions(team)) == [one for cost, one in costs if cost < INFINITE], number
        assert least_cost(team) == min((cost for cost, _ in costs), default=INFINITE), number
