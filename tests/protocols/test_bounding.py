"""What ADOPT and BnB-ADOPT+ have in common: each rule, for both."""

from __future__ import annotations

from random import Random
from typing import NamedTuple

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import PseudoTreeNode, Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization import adopt, adopt_messages, bnb_adopt, bnb_adopt_messages
from robochoc.protocols.optimization.bounding import BoundingProtocol
from robochoc.protocols.optimization.bounding_messages import Terminate
from robochoc.run.incumbent import lower_bound
from tests.support.agents import after, replies, robot_of, started, started_robot
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.pseudo_trees import context, middle, placed, priced, root, to


class Family(NamedTuple):
    """A protocol, and two of its messages."""

    protocol: type[BoundingProtocol]
    value: type[adopt_messages.Value | bnb_adopt_messages.Value]
    cost: type[adopt_messages.Cost | bnb_adopt_messages.Cost]

    def informed(self) -> BoundingProtocol:
        """B, when it knows the values above, both 1."""
        return after(middle(self.protocol), ("RZ", self.value((1,), 1)), ("RA", self.value((1,), 1)))


FAMILIES = [
    Family(adopt.ADOPT, adopt_messages.Value, adopt_messages.Cost),
    Family(bnb_adopt.BnBADOPT, bnb_adopt_messages.Value, bnb_adopt_messages.Cost),
]
both = looped("family", FAMILIES)


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
    protocol, value, cost = family
    said = replies(middle(protocol), ("RA", value((2,), 1)), ("RA", value((1,), 2)), ("RZ", value((2,), 1)))
    assert to("RA", said) == [cost(context(A=(1, 2), Z=2), 2, INFINITE)]


@both
def test_a_cost_without_the_own_value_only_tells_of_others_and_of_two_bounds_the_better_is_kept(family: Family) -> None:
    robot, cost = family.informed(), family.cost
    replies(robot, ("RC", cost(context(X=2), 4, 7)))
    assert robot.bounds["RC"].lb == [0, 0]
    assert robot.context == context(A=1, Z=1, X=2)
    replies(robot, ("RC", cost(context(B=1), 4, 6)), ("RC", cost(context(B=1), 3, 7)))
    assert (robot.bounds["RC"].lb, robot.bounds["RC"].ub) == ([4, 0], [6, INFINITE])


@both
def test_an_n_ary_constraint_is_paid_by_its_lowest_robot_once_it_knows_the_others(family: Family) -> None:
    protocol, value, cost = family
    team = priced("ABC", {"ABC": range(8)})
    top = placed(protocol, team, "RA", children=["RB"], pseudo_children=["RC"])
    assert list(top.lower) == [0, 0]
    robot = after(placed(protocol, team, "RC", "RB", pseudo_parents=["RA"]), ("RB", value((2,), 1)))
    assert list(robot.lower) == [0, 0]
    assert robot.problem.checks == 0
    assert replies(robot, ("RA", value((2,), 1))) == [("RB", cost(context(A=2, B=2), 6, 6))]


@both
def test_a_root_whose_bounds_meet_ends_and_says_so(family: Family) -> None:
    robot = after(root(family.protocol), ("RC", family.cost(context(B=1), 1, 1)))
    assert robot.findings.bound == 1
    assert not robot.terminated
    said = replies(robot, ("RD", family.cost(context(B=1), 0, 0)))
    assert said == [("RC", Terminate(context(B=1))), ("RD", Terminate(context(B=1)))]
    assert replies(robot, ("RC", family.cost(context(B=1), 7, 7))) == []


@both
def test_a_robot_alone_takes_its_cheapest_value_in_silence_or_ends_the_search(family: Family) -> None:
    robot = robot_of(family.protocol, priced("AB", {"A": [3, 1]}), "RA")
    assert started(robot) == []
    assert robot.assignment == {"A": 2}
    assert (robot.findings.place, robot.findings.bound) == (PseudoTreeNode(None), 1)
    none = started_robot(family.protocol, priced("AB", {"A": [INFINITE, INFINITE]}), "RA")
    assert none.verdict is Verdict.NO_SOLUTION


@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in (1, 2))])
@looped(("longest", "family"), [(longest, family) for longest in (0, 50, None) for family in FAMILIES])
def test_when_nobody_speaks_all_have_ended_and_the_roots_bounds_are_the_least_cost(
    longest: int | None, family: Family, batch: int
) -> None:
    ends: list[BoundingProtocol] = []

    def noted(robot: BoundingProtocol) -> None:
        ends.append(robot)
        family.protocol.start_in_tree(robot)

    noting = type("Noting", (family.protocol,), {"start_in_tree": noted})  # a compiled class cannot be patched
    chance = Random(f"quiet {longest} {batch}")
    for seed in range(10 if batch else 5):
        team = random_cost_team(chance)
        ends.clear()
        schedule = RandomChannels(seed) if longest is None else Concurrent(seed, longest)
        result = Simulation(team, noting, schedule).search()
        if (least := least_cost(team)) == INFINITE:
            assert result.verdict is Verdict.NO_SOLUTION
        else:
            assert len(ends) == len(team.robots)
            assert all(robot.terminated for robot in ends)
            assert lower_bound(result.findings) == least
