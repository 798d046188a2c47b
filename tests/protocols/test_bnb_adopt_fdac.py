"""One test per rule of BnB-ADOPT+ with soft arc consistency (Gutierrez, Meseguer, ECAI 2010), and brute force."""

from __future__ import annotations

import math

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.optimization import bnb_adopt_fdac
from robochoc.protocols.optimization.bnb_adopt_fdac import (
    BnBADOPTFDAC,
    BnBADOPTFDACSettings,
    Cost,
    Domain,
    Moved,
    Value,
)
from robochoc.protocols.optimization.bounding_messages import Terminate
from tests.support.agents import after, assert_refused, replies, value
from tests.support.pseudo_trees import context, placed, priced, to
from tests.support.spent import spent

TEAM = priced(
    "ZABCDE",
    {"B": [4, 1], "ZB": [0, 1, 2, 0], "AB": [5, 3, 6, 2], "BC": [0] * 4, "BD": [0] * 4, "BE": [0] * 4, "ZAE": [0] * 8},
)
"""B stands below A and, further up, Z; C and D are its children, and E is a pseudo-child."""
DOMAIN = Domain([(1,), (2,)])


class ArcConsistent(BnBADOPTFDAC):
    """BnB-ADOPT+-AC."""

    settings = BnBADOPTFDACSettings("ac")


def middle(kind: type[BnBADOPTFDAC] = BnBADOPTFDAC, team: Team = TEAM) -> BnBADOPTFDAC:
    """B, after it has begun."""
    return placed(kind, team, "RB", "RA", pseudo_parents=["RZ"], children=["RC", "RD"], pseudo_children=["RE"])


def moved(kind: type[BnBADOPTFDAC] = BnBADOPTFDAC) -> BnBADOPTFDAC:
    """B, when it has moved costs: 0 and 3 are moved to it in all."""
    robot = middle(kind)
    robot.outbox.clear()
    replies(robot, ("RC", Moved([0, 1])), ("RD", Moved([0, 0])), ("RE", Moved([0, 2])))
    replies(robot, ("RA", DOMAIN), ("RZ", DOMAIN))
    return robot


def informed() -> BnBADOPTFDAC:
    """B, when it also knows the values above, both 1."""
    return after(moved(), ("RZ", Value((1,), 1)), ("RA", Value((1,), 1)))


# Before the search


def test_values_are_told_to_all_below_with_a_binary_constraint_and_to_children() -> None:
    assert middle().outbox == [(name, DOMAIN) for name in ("RC", "RD", "RE")]


def test_a_pseudo_child_of_a_ternary_constraint_is_told_nothing_and_a_child_is() -> None:
    team = priced("BCD", {"BCD": [0] * 8})
    robot = placed(BnBADOPTFDAC, team, "RB", children=["RC"], pseudo_children=["RD"])
    assert robot.outbox == [("RC", DOMAIN)]
    assert to("RD", replies(robot, ("RC", Moved([0, 3])))) == [Value((1,), 1)]


def test_costs_are_moved_when_those_from_below_and_the_values_above_have_come() -> None:
    robot = middle()
    robot.outbox.clear()
    assert replies(robot, ("RC", Moved([0, 1])), ("RA", DOMAIN), ("RE", Moved([0, 2])), ("RD", Moved([0, 0]))) == []
    said = replies(robot, ("RZ", DOMAIN))
    # B costs 4 and 1, to which 0 and 3 have come; with A at 1 it costs 5 and 3 more, with A at 2 it costs 6 and 2.
    assert to("RA", said) == [Moved([min(4 + 5, 4 + 3), min(4 + 6, 4 + 2)])]
    # Of B's value 1 all 4 are kept but for what A's values 1 and 2 need: 2 and 0. With Z at 1 it costs 0 and 1.
    assert to("RZ", said) == [Moved([1, 0])]


def test_with_ac_costs_are_moved_out_of_constraints_only_but_for_the_least_own_cost() -> None:
    robot = middle(ArcConsistent)
    robot.outbox.clear()
    replies(robot, ("RC", Moved([0, 1])), ("RD", Moved([0, 0])), ("RE", Moved([0, 2])))
    said = replies(robot, ("RA", DOMAIN), ("RZ", DOMAIN))
    # What is left with A is 2 and 0, or 4 and 0: 2 comes down to the value 1 of B, so B costs 6 and 4.
    assert to("RA", said) == [Moved([3 + 4, 2 + 4])]
    assert to("RZ", said) == [Moved([0, 0])]
    assert robot.unary == [2, 0]


def test_a_leaf_on_a_tree_moves_all_that_it_costs() -> None:
    team = priced("AB", {"B": [4, 1], "AB": [5, 3, 6, 2]})
    robot = placed(BnBADOPTFDAC, team, "RB", "RA")
    assert replies(robot, ("RA", DOMAIN)) == [("RA", Moved([4, 3]))]
    said = replies(robot, ("RA", Value((2,), 1)))
    assert value(robot) == (2,)
    assert said == [("RA", Cost(context(A=2), 0, 0))]


def test_a_root_begins_with_the_value_that_costs_least_with_what_was_moved() -> None:
    team = priced("BC", {"B": [0, 2], "BC": [0] * 4})
    robot = placed(BnBADOPTFDAC, team, "RB", children=["RC"])
    robot.outbox.clear()
    said = replies(robot, ("RC", Moved([7, 4])))
    assert (value(robot), robot.lb) == ((2,), 6)
    assert said == [("RC", Value((2,), 2))]


def test_a_parent_without_a_constraint_gets_what_the_cheapest_value_costs() -> None:
    robot = placed(BnBADOPTFDAC, priced("ABC", {"B": [4, 1], "AC": [0] * 4, "BC": [0] * 4}), "RB", "RA")
    assert replies(robot, ("RA", DOMAIN)) == [("RA", Moved([1, 1]))]


def test_a_table_that_is_too_large_is_left_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bnb_adopt_fdac, "MAX_ENTRIES", 3)
    robot = placed(BnBADOPTFDAC, priced("AB", {"B": [4, 1], "AB": [5, 3, 6, 2]}), "RB", "RA")
    checks = robot.problem.checks
    assert replies(robot, ("RA", DOMAIN)) == [("RA", Moved([1, 1]))]
    assert robot.problem.checks == checks
    assert replies(robot, ("RA", Value((2,), 1))) == [("RA", Cost(context(A=2), 2, 2))]


def test_a_robot_that_has_no_value_left_ends_the_search_of_all() -> None:
    robot = moved()
    assert robot.verdict is None
    robot = after(middle(), ("RC", Moved([INFINITE, 0])), ("RD", Moved([0, INFINITE])), ("RE", Moved([0, 0])))
    assert replies(robot, ("RA", DOMAIN), ("RZ", DOMAIN))[-1:] == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_what_cannot_be_is_refused() -> None:
    """Also what is moved twice, and a value that a robot above has not told before."""
    costs: list[list[float]] = [[0], [0, -1], [0, math.nan]]
    domains = [("RC", DOMAIN), ("RA", Domain([])), ("RA", Domain([(9,)]))]
    assert_refused(middle, [*domains, ("RA", Moved([0, 0])), *(("RC", Moved(one)) for one in costs)], r"R[AC]")
    assert_refused(moved, [("RA", DOMAIN)], "RA")
    assert_refused(moved, [("RC", Moved([0, 0]))], "RC")
    assert_refused(moved, [("RA", Value((9,), 1))], "RA has no such value")


# The search


def test_delta_is_what_is_paid_with_what_was_moved_here_and_without_what_was_moved_up() -> None:
    """Of a robot above whose value is unknown only what was put in is missing."""
    robot = moved()
    assert robot.costs_in({}) == robot.unary == [1, 0]
    replies(robot, ("RA", Value((1,), 1)))
    assert list(robot.delta) == [1, 0]
    # With A and Z at 1: 4 + 5 + 0 + 0 and 1 + 3 + 1 + 3, of which 7 and 1 were moved up.
    assert list(informed().delta) == [9 - 8, 8 - 8]


def test_with_a_value_above_with_which_nothing_goes_all_own_values_cost_infinity() -> None:
    team = priced("AB", {"B": [4, 1], "AB": [5, INFINITE, INFINITE, INFINITE]})
    robot = placed(BnBADOPTFDAC, team, "RB", "RA")
    assert replies(robot, ("RA", DOMAIN)) == [("RA", Moved([9, INFINITE]))]
    said = replies(robot, ("RA", Value((2,), 1)))
    assert list(robot.delta) == [INFINITE, INFINITE]
    assert said == [("RA", Cost(context(A=2), INFINITE, INFINITE))]
    assert replies(robot, ("RA", Value((1,), 2))) == [("RA", Cost(context(A=(1, 2)), 0, 0))]


def test_nothing_is_told_before_the_parent_has_a_value() -> None:
    robot = moved()
    assert replies(robot, ("RZ", Value((1,), 1))) == []
    said = replies(robot, ("RA", Value((1,), 1)))
    assert to("RA", said) == [Cost(context(Z=1, A=1), 0, INFINITE)]
    assert to("RC", said) == [Value((2,), 1)]


def test_bounds_and_thresholds_are_on_what_is_left_and_the_end_is_bnb_adopt_s() -> None:
    robot = informed()
    said = replies(robot, ("RC", Cost(context(B=2), 0, 2)), ("RD", Cost(context(B=2), 0, 0, True)))
    assert to("RA", said) == [Cost(context(Z=1, A=1), 0, 2)]
    assert to("RD", said) == [Value((2,), 1, 2)]
    replies(robot, ("RC", Cost(context(B=2), 0, 0)))
    said = replies(robot, ("RA", Terminate(context(Z=1, A=1))))
    assert said == [(child, Terminate(context(Z=1, A=1, B=2))) for child in ("RC", "RD")]


# Against others, and against brute force


def test_two_messages_for_each_pair_save_more_than_they_cost() -> None:
    teams = [random_csp(8, 4, 0.4, 0, seed, connected=True, max_cost=20) for seed in range(4)]
    plain = spent(teams, "bnb-adopt").messages
    for level in ("ac", "fdac"):
        assert spent(teams, "bnb-adopt-fdac", level=level).messages < 0.8 * plain


def test_on_a_tree_the_first_values_are_the_last_ones() -> None:
    for seed in range(4):
        team = random_csp(9, 4, 8 / 36, 0, seed, connected=True, max_cost=20)
        messages = spent([team], "bnb-adopt-fdac").by_type
        assert {messages[kind] for kind in ("Domain", "Moved", "Value", "Terminate")} == {8}
