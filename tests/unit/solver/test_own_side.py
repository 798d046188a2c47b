"""What a robot's local problem says of its own side of asymmetric constraints, held against the own file."""

from __future__ import annotations

from collections import Counter
from random import Random

import pytest

from robochoc.model.assembly import assemble
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    ConstraintModel,
    Domain,
    Relation,
    Semantics,
    Team,
    Variable,
)
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.compiled import plain_python_only
from tests.support.problems import team_of

EQUAL = Relation("R", 2, Semantics.SUPPORTS, ((1, 1), (2, 2)))
WIDE = {"RA": "AB", "RC": "C"}


def test_the_own_side_of_a_constraint_is_what_the_own_part_says() -> None:
    """Towards robots above and below alike, and nothing of the other's part, nor of what is totally known."""
    chance = Random("own side")
    seen = Counter[bool]()
    for _ in range(80):
        team = random_asymmetric_team(chance)
        given = {name: chance.choice(sorted(v.domain)) for name, v in team.variables.items()}
        views = {robot.name: tuple(given[name] for name in robot.interface) for robot in team.robots}
        for name, part in agent_problems(team).items():
            problem = LocalProblem(part)
            if views[name] not in problem.values:
                continue
            index = problem.values.index(views[name])
            for other in problem.neighbours:
                before = problem.checks
                prices = [own.price(given) for own in _own_parts(team, name, other)]
                paid = problem.own_side(index, other, views[other])
                assert paid == (prices.count(INFINITE), sum(price for price in prices if price < INFINITE))
                assert problem.checks - before == len(prices)
                assert problem.shares_parts_with(other) == (bool(prices) or other in problem.pkc_parents)
                seen[bool(prices)] += 1
    assert seen[True] > 40


def test_a_withdrawn_robot_costs_nothing_on_the_own_side() -> None:
    chance = Random("own side withdrawn")
    for _ in range(20):
        team = random_asymmetric_team(chance)
        for part in agent_problems(team, RunParameters(withdrawal_cost=1000)).values():
            problem = LocalProblem(part)
            for other in problem.neighbours:
                nothing = (None,) * len(team[other].interface)
                assert problem.own_side(0, other, nothing) == (0, 0)
                anything = tuple(min(team.variables[one].domain) for one in team[other].interface)
                assert problem.own_side(len(problem.values) - 1, other, anything) == (0, 0)


@pytest.mark.parametrize("shown", [(), (1, 1), (99,), pytest.param(("x",), marks=plain_python_only)])
def test_a_value_that_a_robot_cannot_have_is_refused(shown: tuple[int, ...]) -> None:
    team = team_of(dict.fromkeys("AB", (1, 2)), [Constraint("C", EQUAL, ("A", "B"), ("A", "B"))])
    problem = LocalProblem(agent_problems(team)["RB"])
    problem.refuse_value("RA", (2,))
    problem.refuse_value("RA", (None,))
    with pytest.raises(ValueError, match="RA"):
        problem.own_side(0, "RA", shown)


def test_a_robot_withdraws_with_all_its_variables_or_with_none() -> None:
    own = {robot: [Variable(name, Domain("D", (range(2),))) for name in names] for robot, names in WIDE.items()}
    shared = [Constraint("C", EQUAL, ("C", one), ("C", one)) for one in "AB"]
    problem = LocalProblem(agent_problems(assemble("two", own, shared))["RC"])
    problem.refuse_value("RA", (0, 1))
    with pytest.raises(ValueError, match="RA"):
        problem.refuse_value("RA", (None, 1))


def test_costs_in_a_whole_view_are_those_of_the_own_file() -> None:
    """So the costs of all robots add up to those of the team: each constraint, and each part, is paid once."""
    chance = Random("own file")
    for _ in range(60):
        team = random_asymmetric_team(chance)
        given = {name: chance.choice(sorted(v.domain)) for name, v in team.variables.items()}
        views = {robot.name: tuple(given[name] for name in robot.interface) for robot in team.robots}
        for robot in team.robots:
            problem = LocalProblem(agent_problems(team)[robot.name])
            if views[robot.name] in problem.values:
                index = problem.values.index(views[robot.name])
                paid = problem.cost(index, views)
                assert (
                    paid - problem.charges[index]
                    == sum(one.price(given) for one in robot.constraints() if one not in robot.private)
                    or paid == INFINITE
                )


def _own_parts(team: Team, name: str, other: str) -> list[Constraint]:
    """The parts of partially known constraints that a robot has with another."""
    robot = team[name]
    above = [part for parent in robot.parents if parent.name == other for part in parent.constraints]
    below = [part for child in robot.children if child.name == other for part in child.constraints]
    return [part for part in (*above, *below) if part.model is ConstraintModel.PKC]
