"""Teams with costs that tables cannot hold, and what a run refuses."""

from __future__ import annotations

import pytest

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.run import solve
from robochoc.run.options import Options
from robochoc.solver.errors import UnsupportedError
from tests.support.cost_problems import with_costs
from tests.support.problems import team_of


def costly_team(cost: int, pairs: str = "AB BC") -> Team:
    """Return three robots with two values each; two neighbours with the same one cost `cost`, or one more."""
    tuples = ((0, 0), (1, 1))
    price = Relation("R", 2, Semantics.SOFT, tuples, (cost, cost + 1), 1)
    constraints = [Constraint(pair, price, tuple(pair), tuple(pair)) for pair in pairs.split()]
    return with_costs(team_of(dict.fromkeys("ABC", (0, 1)), constraints))


def refusal_of(team: Team, options: Options) -> str:
    """Return the sentence with which a run of `team` is refused."""
    with pytest.raises(UnsupportedError) as refusal:
        solve(team, options)
    return str(refusal.value)
