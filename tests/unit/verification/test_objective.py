"""The objective of a team that changes: constraints without variables, and what neighbours see."""

from __future__ import annotations

from dataclasses import replace

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.verification.objective import Objective, withdrawal_cost
from tests.support.problems import team_of

PRICE = Relation("P", 2, Semantics.SOFT, ((1, 1),), (4,), 1)


def pair() -> Team:
    """Two robots; a constraint between them, and one of the first over constants only."""
    constants = Constraint("K", PRICE, (1, 1), (1, 1))
    both = Constraint("C", PRICE, ("A", "B"), ("A", "B"))
    team = team_of(dict.fromkeys("AB", (1, 2)), [both])
    first, second = team.robots
    return replace(team, robots=(replace(first, private=(constants,)), second))


def test_a_constraint_without_variables_costs_what_it_costs_from_the_start() -> None:
    objective = Objective(pair(), 10)
    assert objective.cost == 4 + 20
    objective.change({"RA": {"A": 1}, "RB": {"B": 2}})
    assert objective.cost == 4 + 1


def test_values_of_another_length_than_the_interface_are_not_of_these_robots() -> None:
    objective = Objective(pair(), 10)
    assert objective.shown({"RA": (1,), "RB": (None,)}) == {"RA": {"A": 1}, "RB": {}}
    assert objective.shown({"RA": (1, 2)}) is None
    assert objective.shown({"RZ": (1,)}) is None


def test_no_robot_withdraws_to_save_costs() -> None:
    assert withdrawal_cost(pair()) == 1 + 4 + 4
