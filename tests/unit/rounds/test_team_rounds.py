"""Teams in rounds: announced values, costs as the checker computes them, and errors."""

from __future__ import annotations

from contextlib import suppress

import pytest

import robochoc
from robochoc.model.problem import ConstraintModel
from robochoc.rounds import TeamRounds
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import assignment_cost, violated_constraints
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.examples import drawn


def test_costs_agree_with_the_checker() -> None:
    chance = drawn("rounds")
    for make in (random_cost_team, random_complex_cost_team):
        with suppress(UnsupportedError):  # a random robot may have no possible value
            rounds = TeamRounds(make(chance))
            for _ in range(5):
                rounds.choose({name: chance.randrange(len(one.values)) for name, one in rounds.problems.items()})
                assignment = rounds.assignment()
                assert rounds.team_cost[0] == violated_constraints(rounds.team, assignment).number
                if not rounds.team_cost[0]:
                    assert rounds.team_cost[1] == assignment_cost(rounds.team, assignment)
                for name, problem in rounds.problems.items():
                    index = rounds.index_of(name, assignment)
                    assert index is not None
                    assert problem.values[index] == rounds.announced[name]


def test_neighbours_see_the_announced_value() -> None:
    model = robochoc.Model()
    x, y = (model.robot(name).variable("x", range(3)) for name in ("a", "b"))
    model.add(x != y)
    assert all(one.model == ConstraintModel.TKC for one in model.team.constraints())
    rounds = TeamRounds(model.team)
    rounds.choose({"a": 1, "b": 1}, {"a": 2})
    assert rounds.team_cost[0] == 1
    assert rounds.view("b") == {"a": (2,)}
    assert [broken for broken, _ in rounds.costs("b")] == [0, 0, 1]
    assert rounds.user_cost is None
    assert rounds.index_of("a", {}) is None
    assert rounds.index_of("a", {"a.x": 7}) is None


def test_a_robot_without_values_is_refused() -> None:
    model = robochoc.Model()
    x = model.robot("a").variable("x", range(3))
    model.add(x > 5)
    with pytest.raises(UnsupportedError, match="a has no possible value"):
        TeamRounds(model.team)
