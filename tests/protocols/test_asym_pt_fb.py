"""One test per rule of AsymPT-FB (Litov, Meisels, AIJ 252, 2017), named for it; PT-FB's are in `test_pt_fb`."""

from __future__ import annotations

import pytest

from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.asymmetric.asym_pt_fb import AsymPTFB, Row, RowRequest
from robochoc.protocols.optimization.branching import Members, Report, Request, Result
from robochoc.protocols.optimization.pt_fb import CPA, Reduce
from tests.support.agents import after, replies
from tests.support.asymmetric_problems import priced_part, two_valued
from tests.support.pseudo_trees import placed


def team() -> Team:
    """A, B and C, two values each, all with costs of their own; A pays 3 at least to B with its first value."""
    parts = {
        "RA": [priced_part("AB", {(1, 1): 3, (1, 2): 8}), priced_part("AC", {(1, 1): 5, (2, 2): INFINITE})],
        "RB": [priced_part("AB", {(1, 1): 1, (2, 2): 2}), priced_part("BC", {(1, 1): 6})],
        "RC": [priced_part("AC", {(1, 1): 4}), priced_part("BC", {(1, 1): 1, (1, 2): 2, (2, 2): 9})],
    }
    return two_valued("ABC", parts)


def top() -> AsymPTFB:
    """A, the root, which has asked B and C for bounds with its value 2."""
    robot = placed(AsymPTFB, team(), "RA", children=["RB"], pseudo_children=["RC"])
    assert replies(robot, ("RB", Members({"RA": ["RB", "RC"]}))) == [("RB", Request((2,))), ("RC", Request((2,)))]
    return robot


def middle() -> AsymPTFB:
    """B, which knows that A = 1, and has been told to search."""
    robot = after(placed(AsymPTFB, team(), "RB", "RA", children=["RC"]), ("RC", Members({"RB": ["RC"], "RA": ["RC"]})))
    assert replies(robot, ("RA", Request((1,)))) == [("RA", Report(0))]
    return robot


def leaf() -> AsymPTFB:
    """C, which knows that A = 1 and B = 1."""
    robot = placed(AsymPTFB, team(), "RC", "RB", pseudo_parents=["RA"])
    robot.outbox.clear()
    assert replies(robot, ("RA", Request((1,)))) == [("RA", Report(0))]
    assert replies(robot, ("RB", Request((1,)))) == [("RB", Report(2))]
    return robot


def test_the_least_cost_of_the_own_side_counts_from_the_beginning_and_the_rest_is_told_when_asked() -> None:
    robot = top()
    assert (robot.least, robot.local) == ({"RB": [3, 0], "RC": [0, 0]}, [3, 0])
    replies(robot, ("RB", Report(0)), ("RC", Report(0)))
    assert replies(robot, ("RC", RowRequest([(1,), (2,)]))) == [("RC", Row([0, INFINITE]))]
    replies(robot, ("RB", Result(7, {"RB": (1,), "RC": (1,)})), ("RB", Report(0)), ("RC", Report(0)))
    assert replies(robot, ("RB", RowRequest([(1,), (2,)]))) == [("RB", Row([0, 5]))]


def test_before_it_searches_a_robot_asks_those_above_for_their_sides_and_then_counts_them() -> None:
    robot = middle()
    assert replies(robot, ("RA", CPA(INFINITE, {}))) == [("RA", RowRequest([(1,), (2,)]))]
    assert not robot.searching
    assert replies(robot, ("RA", Row([0, 5]))) == [("RC", Request((1,)))]
    assert robot.local == [1, 5]
    robot = after(middle(), ("RA", CPA(INFINITE, {})), ("RA", Reduce(1)))
    said = replies(robot, ("RA", Row([0, 5])))
    assert said == [("RA", Result(INFINITE, {}))], "the bound fell while sides were asked for"


def test_a_side_is_asked_for_once_for_each_value_above() -> None:
    robot = after(middle(), ("RA", CPA(7, {})), ("RA", Row([9, 9])))
    assert replies(robot, ("RA", Request((2,)))) == [("RA", Report(0))]
    assert replies(robot, ("RA", Request((1,)))) == [("RA", Report(9))]
    assert replies(robot, ("RA", CPA(3, {}))) == [("RA", Result(INFINITE, {}))]


def test_a_leaf_asks_before_it_returns_its_cost_and_answers_its_parent_with_it_afterwards() -> None:
    robot = leaf()
    asked = [("RB", RowRequest([(1,), (2,)])), ("RA", RowRequest([(1,), (2,)]))]
    assert replies(robot, ("RB", CPA(INFINITE, {}))) == asked
    assert replies(robot, ("RB", Row([6, 0]))) == []
    assert replies(robot, ("RA", Row([5, 0]))) == [("RB", Result(2, {"RC": (2,)}))]
    assert replies(robot, ("RB", Request((1,)))) == [("RB", Result(2, {"RC": (2,)}))]


def test_what_nobody_asked_for_or_may_ask_is_refused() -> None:
    robot = middle()
    with pytest.raises(ValueError, match="did not request"):
        replies(robot, ("RA", Row([1, 2])))
    replies(robot, ("RA", CPA(INFINITE, {})))
    for sender, message, why in (
        ("RA", CPA(INFINITE, {}), "is already asking for sides"),
        ("RA", Row([1]), "did not request"),
        ("RA", RowRequest([(1,)]), "is not known to be below"),
        ("RC", RowRequest([(1,)]), "which has no open request"),
    ):
        with pytest.raises(ValueError, match=why):
            replies(robot, (sender, message))
    with pytest.raises(ValueError, match="RB"):
        replies(top(), ("RB", RowRequest([(3,)])))
