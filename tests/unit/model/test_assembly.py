"""Teams from variables and constraints: holders, links and parts follow from the order."""

from __future__ import annotations

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.formats import PREDEFINED, check_team
from robochoc.model.assembly import Extras, assemble
from robochoc.model.orders import with_priorities
from robochoc.model.problem import Constraint, ConstraintModel, Domain, Team, Variable
from tests.support.examples import examples

VALUES = Domain("D", (range(3),))


def owned(*robots: str) -> dict[str, list[Variable]]:
    return {robot: [Variable(f"x{robot}", VALUES)] for robot in robots}


def ne(*robots: str) -> Constraint:
    scope = tuple(f"x{robot}" for robot in robots)
    return Constraint("ne", PREDEFINED["ne"], scope, scope)


def links_of(team: Team) -> dict[str, tuple[list[str], list[str]]]:
    return {
        robot.name: ([parent.name for parent in robot.parents], [child.name for child in robot.children])
        for robot in team.robots
    }


def test_the_lowest_robot_holds_a_constraint() -> None:
    team = assemble("t", owned("b", "a", "c"), [ne("a", "b"), ne("b", "c")])
    check_team(team)
    assert links_of(team) == {"b": ([], ["a", "c"]), "a": (["b"], []), "c": (["b"], [])}
    assert team["a"].shared == (ne("a", "b"),)
    assert team["b"].children[0].variables == ("xb",)


def test_a_link_without_a_constraint() -> None:
    team = assemble("t", owned("a", "b"), [], extras=Extras(links=[("b", "a")]))
    check_team(team)
    assert links_of(team) == {"a": ([], ["b"]), "b": (["a"], [])}


@pytest.mark.parametrize("knows", ["a", "b"])
def test_a_part_that_one_robot_knows_alone(knows: str) -> None:
    team = assemble("t", owned("a", "b"), [], extras=Extras(parts={knows: [ne("a", "b")]}))
    check_team(team)
    above, below = team["b"].parents[0].constraints, team["a"].children[0].constraints
    assert [one.model for one in (*above, *below)] == [ConstraintModel.PKC] * 2
    own, other = (above, below) if knows == "b" else (below, above)
    assert own[0].price({"xa": 1, "xb": 1}) > 0
    assert other[0].price({"xa": 1, "xb": 1}) == 0


def test_a_variable_that_nobody_owns() -> None:
    with pytest.raises(ValueError, match="'xc', which no robot owns"):
        assemble("t", owned("a", "b"), [ne("a", "c")])


@examples(40)
@given(st.integers(0, 10**6))
def test_another_order_gives_the_team_turned_to_it(seed: int) -> None:
    chance = Random(seed)
    names = list("abcde")
    constraints = [ne(*chance.sample(names, 2)) for _ in range(6)]
    turned = chance.sample(names, len(names))
    one, other = assemble("t", owned(*names), constraints), assemble("t", owned(*turned), constraints)
    check_team(one)
    check_team(other)
    again = with_priorities(one, turned)
    assert {name: tuple(map(set, links)) for name, links in links_of(other).items()} == {
        name: tuple(map(set, links)) for name, links in links_of(again).items()
    }
