"""What ADOPT and BnB-ADOPT+ have in common: each rule, for both."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import PseudoTreeNode, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization import adopt, bnb_adopt
from robochoc.protocols.optimization.bounding import BoundingProtocol
from robochoc.protocols.optimization.messages import adopt as adopt_messages
from robochoc.protocols.optimization.messages import bnb_adopt as bnb_adopt_messages
from robochoc.protocols.optimization.messages.bounding import Terminate
from robochoc.run.incumbent import lower_bound
from tests.support.agents import replies
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.pseudo_trees import context, placed, priced, root, to, unplaced


class Family(NamedTuple):
    """A protocol, and two of its messages."""

    protocol: type[BoundingProtocol]
    value: type[adopt_messages.Value | bnb_adopt_messages.Value]
    cost: type[adopt_messages.Cost | bnb_adopt_messages.Cost]

    def middle(self) -> BoundingProtocol:
        """B, after it has begun: below A and, further up, Z; C and D are its children."""
        costs = {"ZA": [0] * 4, "ZB": [0, 1, 2, 0], "AB": [0, 3, 1, 0], "BC": [0] * 4, "BD": [0] * 4}
        team = priced("ZABCD", costs)
        robot = placed(self.protocol, team, "RB", "RA", pseudo_parents=["RZ"], children=["RC", "RD"])
        robot.outbox.clear()
        return robot

    def informed(self) -> BoundingProtocol:
        """B, when it knows the values above, both 1."""
        robot = self.middle()
        replies(robot, ("RZ", self.value((1,), 1)), ("RA", self.value((1,), 1)))
        return robot


FAMILIES = [
    Family(adopt.ADOPT, adopt_messages.Value, adopt_messages.Cost),
    Family(bnb_adopt.BnBADOPT, bnb_adopt_messages.Value, bnb_adopt_messages.Cost),
]
both = pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.protocol.__name__)


@both
def test_nothing_is_known_of_ub_before_all_neighbours_above_have_told_their_values(family: Family) -> None:
    protocol, value, cost = family
    team = priced("ZAB", {"ZB": [0, 1, 2, 0], "AB": [0, 3, 1, 0]})
    robot = placed(protocol, team, "RB", "RA", pseudo_parents=["RZ"])
    said = replies(robot, ("RA", value((2,), 1)))
    assert said == [("RA", cost({}, 0, INFINITE)), ("RA", cost(context(A=2), 0, INFINITE))]
    assert replies(robot, ("RZ", value((1,), 1))) == [("RA", cost(context(A=2, Z=1), 1, 1))]


@both
def test_one_decision_is_taken_for_all_that_has_come(family: Family) -> None:
    _, value, cost = family
    said = replies(family.middle(), ("RA", value((2,), 1)), ("RA", value((1,), 2)), ("RZ", value((2,), 1)))
    assert to("RA", said) == [cost(context(A=(1, 2), Z=2), 2, INFINITE)]


@both
def test_a_cost_that_does_not_know_the_own_value_only_tells_of_others(family: Family) -> None:
    robot = family.informed()
    replies(robot, ("RC", family.cost(context(X=2), 4, 7)))
    assert robot.bounds["RC"].lb == [0, 0]
    assert robot.context == context(A=1, Z=1, X=2)


@both
def test_of_two_bounds_in_one_context_the_better_one_is_kept(family: Family) -> None:
    robot = family.informed()
    replies(robot, ("RC", family.cost(context(B=1), 4, 6)), ("RC", family.cost(context(B=1), 3, 7)))
    assert (robot.bounds["RC"].lb, robot.bounds["RC"].ub) == ([4, 0], [6, INFINITE])


@both
def test_an_n_ary_constraint_is_paid_by_its_lowest_robot_once_it_knows_the_others(family: Family) -> None:
    protocol, value, cost = family
    team = priced("ABC", {"ABC": range(8)})
    top = placed(protocol, team, "RA", children=["RB"], pseudo_children=["RC"])
    assert list(top.lower) == [0, 0]
    robot = placed(protocol, team, "RC", "RB", pseudo_parents=["RA"])
    replies(robot, ("RB", value((2,), 1)))
    assert list(robot.lower) == [0, 0]
    assert robot.problem.checks == 0
    assert replies(robot, ("RA", value((2,), 1))) == [("RB", cost(context(A=2, B=2), 6, 6))]


@both
def test_a_root_whose_bounds_meet_ends_and_says_so(family: Family) -> None:
    robot = root(family.protocol)
    replies(robot, ("RC", family.cost(context(B=1), 1, 1)))
    assert robot.findings.bound == 1
    assert not robot.terminated
    said = replies(robot, ("RD", family.cost(context(B=1), 0, 0)))
    assert said == [("RC", Terminate(context(B=1))), ("RD", Terminate(context(B=1)))]
    assert replies(robot, ("RC", family.cost(context(B=1), 7, 7))) == []


def alone(family: Family, costs: list[float]) -> BoundingProtocol:
    """A robot that has no neighbours, when it has started."""
    robot = unplaced(family.protocol, priced("AB", {"A": costs}), "RA")
    robot.start()
    return robot


@both
def test_a_robot_alone_takes_its_cheapest_value_in_silence(family: Family) -> None:
    robot = alone(family, [3, 1])
    assert robot.assignment == {"A": 2}
    assert robot.outbox == []
    assert (robot.findings.place, robot.findings.bound) == (PseudoTreeNode(None), 1)


@both
def test_a_robot_alone_with_no_value_that_is_allowed_ends_the_search(family: Family) -> None:
    assert alone(family, [INFINITE, INFINITE]).verdict is Verdict.NO_SOLUTION


@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in (1, 2))])
@pytest.mark.parametrize("longest", [0, 50, None])
@pytest.mark.parametrize("protocol", [adopt.ADOPT, bnb_adopt.BnBADOPT])
def test_when_nobody_speaks_all_have_ended_and_the_roots_bounds_are_the_least_cost(
    protocol: type[BoundingProtocol], longest: int | None, batch: int
) -> None:
    ends: list[BoundingProtocol] = []

    def noted(robot: BoundingProtocol) -> None:
        ends.append(robot)
        protocol.begin(robot)

    noting = type("Noting", (protocol,), {"begin": noted})  # a compiled class cannot be patched
    chance = Random(f"quiet {longest} {batch}")
    for seed in range(10 if batch else 5):
        team = random_cost_team(chance)
        ends.clear()
        schedule = RandomChannels(seed) if longest is None else Concurrent(seed, longest)
        result = Simulation(team, noting, schedule).search()
        if least_cost(team) == INFINITE:
            assert result.verdict is Verdict.NO_SOLUTION
        else:
            assert all(robot.terminated for robot in ends)
            assert len(ends) == len(team.robots)
            assert lower_bound(result.findings) == least_cost(team)
