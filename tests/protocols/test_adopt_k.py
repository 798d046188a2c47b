"""One test per rule of ADOPT(k) (Gutierrez, Meseguer, Yeoh, IJCAI 2011), against ADOPT, BnB-ADOPT+ and brute force."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization import adopt_messages as adopt
from robochoc.protocols.optimization.adopt import ADOPT
from robochoc.protocols.optimization.adopt_k import ADOPTk, ADOPTkSettings, Value
from robochoc.protocols.optimization.bnb_adopt_messages import Cost
from robochoc.protocols.optimization.bounding import BoundingProtocol
from robochoc.protocols.optimization.bounding_messages import Terminate
from robochoc.run import solve
from tests.support.agents import after, replies, value
from tests.support.cases import cases, looped
from tests.support.cost_problems import random_cost_team
from tests.support.pseudo_trees import context, middle, root, to
from tests.support.random_options import random_options
from tests.support.spent import spent


def kind(of_k: float) -> type[ADOPTk]:
    """ADOPT(k) for one k."""

    class Kind(ADOPTk):
        settings = ADOPTkSettings(k=of_k if of_k == INFINITE else int(of_k))

    return Kind


def informed(k: float, allowance: float = 0, threshold: float = INFINITE) -> ADOPTk:
    """B, when it knows the values above, both 1, and its thresholds: its own values cost 0 and 4."""
    return after(middle(kind(k)), ("RZ", Value((1,), 1)), ("RA", Value((1,), 1, threshold, allowance)))


@looped(("k", "kept"), [(1, 5), (3, 7), (9, 9)])
def test_a_value_is_left_when_its_lower_bound_is_k_above_the_first_threshold(k: int, kept: int) -> None:
    """With 9, it is left at 10: it has reached the threshold of BnB-ADOPT."""
    robot = after(informed(k, allowance=5, threshold=10), ("RC", Cost(context(B=1), kept, INFINITE)))
    assert value(robot) == (1,)
    replies(robot, ("RC", Cost(context(B=1), kept + 1, INFINITE)))
    assert value(robot) == (2,)


def test_a_value_is_left_when_its_lower_bound_is_the_best_known_cost() -> None:
    robot = after(informed(99), *((child, Cost(context(B=1), 4, 4)) for child in ("RC", "RD")))
    assert (robot.lb, robot.ub, value(robot)) == (4, 8, (2,))


def test_the_first_threshold_stays_between_lb_and_ub_and_is_ub_for_the_value_with_the_least_upper_bound() -> None:
    for allowance, bound in ((1, 4), (99, 18)):
        robot = informed(9, allowance=allowance)
        assert robot.allowance == allowance
        replies(robot, *((child, Cost(context(B=1), 3, 9)) for child in ("RC", "RD")))
        assert (robot.lb, robot.ub, robot.allowance) == (4, 18, bound)
    robot = after(informed(9, allowance=9), *((child, Cost(context(B=2), 0, 1)) for child in ("RC", "RD")))
    assert (robot.lb, robot.ub, value(robot)) == (0, 6, (2,))


def test_the_first_threshold_is_split_among_the_children_within_their_bounds() -> None:
    robot = informed(9, allowance=3)
    asked = [("RC", Cost(context(B=1), 1, 2, True)), ("RD", Cost(context(B=1, A=1), 1, 9, True))]
    assert replies(robot, *asked) == [
        ("RC", Value((1,), 1, 10, 2)),
        ("RD", Value((1,), 1, 10, 1)),
        ("RA", Cost(context(A=1, Z=1), 2, 11)),
    ]


def test_what_is_split_is_no_less_than_the_value_costs_and_a_lower_share_is_told_but_no_higher_one() -> None:
    """The value may cost more than the first threshold, by less than k."""
    robot = after(informed(9), ("RC", Cost(context(B=1), 3, 9)), ("RD", Cost(context(B=1), 2, 9)))
    assert value(robot) == (1,)
    assert robot.allowance == robot.lb == 4
    assert [t[0] for t in robot.t.values()] == [3, 2]
    robot = informed(9)
    assert replies(robot, ("RA", Value((1,), 1, INFINITE, 5))) == []
    replies(robot, ("RC", Cost(context(B=1), 0, INFINITE, True)))
    assert replies(robot, ("RA", Value((1,), 1, INFINITE, 2))) == [("RC", Value((1,), 1, INFINITE, 2))]


def test_a_changed_value_voids_both_thresholds_and_a_threshold_of_a_pseudo_parent_is_none() -> None:
    robot = informed(9, allowance=3, threshold=8)
    said = replies(robot, ("RZ", Value((2,), 2)))
    assert (robot.threshold, robot.allowance) == (INFINITE, robot.lb)
    assert to("RA", said) == [Cost(context(A=1, Z=(2, 2)), 2, INFINITE, True)], "they are asked for"
    robot = after(informed(9, allowance=3), ("RZ", Value((1,), 2, 7, 1)))
    assert (robot.threshold, robot.allowance) == (INFINITE, 3)


def test_after_the_parent_s_end_a_robot_ends_when_ub_is_its_first_threshold() -> None:
    robot = after(informed(9, allowance=2), *((child, Cost(context(B=1), 0, 1)) for child in ("RC", "RD")))
    assert (robot.lb, robot.ub, robot.allowance) == (0, 2, 2)
    said = replies(robot, ("RA", Terminate(context(Z=1, A=1))))
    assert said[-2:] == [(child, Terminate(context(Z=1, A=1, B=1))) for child in ("RC", "RD")]


def test_a_root_that_finds_all_values_infinite_ends_the_search_of_all() -> None:
    robot = after(root(kind(1)), ("RC", Cost(context(B=1), INFINITE, INFINITE)))
    assert value(robot) == (2,)
    assert replies(robot, ("RC", Cost(context(B=(2, 2)), INFINITE, INFINITE))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


# What it is between


def told(chance: Random, robot: BoundingProtocol) -> tuple[str, Cost]:
    """Better bounds of a random child of `robot`, for one of the values of B."""
    child, number = chance.choice(["RC", "RD"]), chance.choice([1, 2])
    bounds = robot.bounds[child]
    low, high = bounds.lb[number - 1], min(bounds.ub[number - 1], 12)
    lb = chance.randint(int(low), int(high))
    return child, Cost(context(B=number), lb, chance.randint(lb, int(high)))


def test_with_k_1_it_decides_as_adopt_does() -> None:
    """The same value, the same threshold, the same shares, after each of the same messages."""
    with cases() as each:
        for seed in range(40):
            with each(seed):
                decide_alike(Random(f"as adopt {seed}"))


def decide_alike(chance: Random) -> None:
    robot, other = informed(1), middle(ADOPT)
    replies(other, ("RZ", adopt.Value((1,), 1)), ("RA", adopt.Value((1,), 1)))
    for _ in range(20):
        if chance.random() < 0.3:
            threshold = chance.randint(0, 20)
            replies(robot, ("RA", Value((1,), 1, INFINITE, threshold)))
            replies(other, ("RA", adopt.Threshold(threshold, {})))
        else:
            child, cost = told(chance, other)
            replies(robot, (child, cost))
            replies(other, (child, adopt.Cost(cost.context, cost.lb, cost.ub)))
        assert (value(robot), robot.allowance, robot.t) == (value(other), other.threshold, other.t)


def test_with_an_infinite_k_a_run_is_bnb_adopt_s() -> None:
    """The same messages, checks and values, under every schedule."""
    chance = Random("as BnB-ADOPT")
    for _ in range(6):
        team = random_cost_team(chance)
        options = replace(random_options(team, "adopt-k", chance), settings={"k": "inf"}, delay=0)
        one, other = solve(team, options), solve(team, replace(options, protocol="bnb-adopt", settings={}))
        assert one.metrics.messages == other.metrics.messages
        assert (one.metrics.ncccs, one.metrics.checks) == (other.metrics.ncccs, other.metrics.checks)
        assert one.assignment == other.assignment


def test_the_larger_k_the_fewer_values_are_told() -> None:
    """ADOPT returns to values again and again."""
    teams = [random_csp(6, 3, 0.6, 0, seed, connected=True, max_cost=10) for seed in range(3)]
    one, four, infinite = (spent(teams, "adopt-k", k=k).by_type["Value"] for k in ("1", "4", "inf"))
    assert one > four > infinite


# Completeness for every k


@looped("k", [0, -1, 2.5, -INFINITE, float("nan")])
def test_k_is_a_whole_number_from_1_or_infinite(k: float) -> None:
    with pytest.raises(ValueError, match="whole number, 1 or more, or inf"):
        ADOPTkSettings(k=k)
