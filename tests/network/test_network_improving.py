"""`--improve` on a network: robots tell what they have while they search on."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, solve
from robochoc.verification.checker import assignment_cost, violations

pytestmark = pytest.mark.slow


class FirstIsEnough:
    """An audience for which the first answer is enough."""

    def __init__(self) -> None:
        self.heard: list[EpochOutcome] = []

    def improve(self, team: Team, /, epoch: EpochOutcome, withdrawn: Sequence[str]) -> None:
        assert list(violations(team, epoch.assignment, withdrawn)) == []
        self.heard.append(epoch)

    def has_news(self, _team: Team) -> bool:
        return True


def test_what_robots_have_is_published_while_they_search() -> None:
    team = random_csp(4, 4, 0.8, 0.0, seed=1, max_cost=50)
    audience = FirstIsEnough()
    options = Options(
        protocol="dsa", runtime=Runtime.NETWORK, deadline=0.2, improve=600, settings={"cycles": "1000000"}
    )
    outcome = solve(team, options, audience=audience)
    assert (outcome.verdict, outcome.deadline) == (Verdict.SOLUTION, 0.2)
    assert outcome.assignment == audience.heard[-1].assignment
    assert outcome.cost == audience.heard[-1].cost == assignment_cost(team, outcome.assignment)
    assert [one.cost for one in outcome.improvements] == [epoch.cost for epoch in audience.heard]
