"""One test per rule of ATWB (Grinshpoun, Grubshtein, Zivan, Netzer, Meisels, JAIR 47, 2013), named for it."""

from __future__ import annotations

import math
from functools import partial

import pytest

from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.asymmetric.atwb import ATWB, Side, SideRequest
from robochoc.protocols.message import Value
from robochoc.protocols.optimization.afb import CPA, FBCPA, FBEstimate, NewSolution
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import after, assert_refused, replies, started_robot, value
from tests.support.asymmetric_problems import priced_part, two_valued


def chain() -> Team:
    """A, B, C, D, two values each. A, C and B, C share costs; A pays 2 at least to C with its second value."""
    parts = {
        "RA": [priced_part("AC", {(1, 1): 7, (2, 1): 5, (2, 2): 2})],
        "RB": [priced_part("BC", {(1, 1): 3, (2, 2): INFINITE})],
        "RC": [priced_part("AC", {(1, 1): 1, (1, 2): 2}), priced_part("BC", {(1, 1): 4})],
    }
    return two_valued("ABCD", parts)


agent = partial(started_robot, ATWB, chain())


def assigned(*assignments: tuple[int, int]) -> list[tuple[Value, int]]:
    return [((own,), counter) for own, counter in assignments]


def cpa(*assignments: tuple[int, int], least: list[float], bound: float = math.inf) -> CPA:
    return CPA(assigned(*assignments), bound, least)


AB = cpa((1, 1), (2, 1), least=[0, 0, 0])
"""A = 1 and B = 2: C pays 1 for its value 1, and 2 for its value 2."""


def holder() -> ATWB:
    """C, which holds the CPA with A = 1 and B = 2, and has asked for the sides of its value 1."""
    return agent("RC", ("RB", AB))


def test_robots_before_are_asked_for_their_sides_and_robots_after_for_bounds_at_once() -> None:
    said = replies(agent("RC"), ("RB", AB))
    assert said == [
        ("RA", SideRequest((1,), 1, 1)),
        ("RB", SideRequest((1,), 1, 1)),
        ("RD", FBCPA(assigned((1, 1), (2, 1), (1, 1)))),
        ("RB", FBEstimate([1, 1], [0, 1, 1])),
    ]


def test_a_robot_before_tells_what_its_side_adds_to_a_value_that_can_be() -> None:
    robot = agent("RB", ("RA", cpa((1, 1), least=[0, 0])))
    assert replies(robot, ("RC", SideRequest((1,), 5, 1))) == [("RC", Side(5, 3))]
    assert replies(robot, ("RC", SideRequest((2,), 6, 1))) == [("RC", Side(6, 0))]
    for wrong in ((), (3,), (1, 1)):
        with pytest.raises(ValueError, match="RC"):
            replies(robot, ("RC", SideRequest(wrong, 5, 1)))


def test_what_it_pays_in_any_case_is_in_the_cpa_already_unless_robots_may_withdraw() -> None:
    robot = agent("RA")
    said = replies(robot, ("RB", CPA(assigned((1, 1)), math.inf, [])))
    assert said[0] == ("RB", cpa((2, 2), least=[0, 2]))
    assert replies(robot, ("RC", SideRequest((1,), 5, 2))) == [("RC", Side(5, 3))]
    assert agent("RA", parameters=RunParameters(withdrawal_cost=9)).least == {"RC": [0, 0, 0]}


def test_what_its_side_forbids_is_infinite_and_a_request_about_a_value_that_was_given_up_is_dropped() -> None:
    robot = agent("RB", ("RA", cpa((1, 1), least=[0, 0])))
    replies(robot, ("RC", CPA(assigned((1, 1), (1, 1)), math.inf, [])))
    assert value(robot) == (2,)
    assert replies(robot, ("RC", SideRequest((2,), 5, 2))) == [("RC", Side(5, INFINITE))]
    assert replies(robot, ("RC", SideRequest((1,), 5, 1))) == []


def test_the_cpa_goes_on_with_its_exact_cost_when_all_sides_are_known_and_they_are_in_the_estimate() -> None:
    robot = holder()
    assert replies(robot, ("RA", Side(1, 7))) == []
    assert replies(robot, ("RB", Side(1, 0))) == [("RD", cpa((1, 1), (2, 1), (1, 1), least=[0, 1, 1, 8]))]
    said = replies(robot, ("RA", FBCPA(assigned((1, 1)))))
    assert said == [("RA", FBEstimate([1], [0, 2]))]  # before: 1


def test_the_next_value_is_taken_as_soon_as_the_sum_reaches_b() -> None:
    robot = after(holder(), ("RD", NewSolution([(1,), (1,), (2,), (1,)], 8)))
    said = replies(robot, ("RA", Side(1, 7)))
    assert said[:2] == [("RA", SideRequest((2,), 2, 1)), ("RB", SideRequest((2,), 2, 1))]
    assert value(robot) == (2,)
    before = robot.cost
    assert replies(robot, ("RB", Side(1, 5))) == [], "an answer about a value that was given up is dropped"
    assert robot.cost == before
    robot = after(holder(), ("RD", NewSolution([(1,), (1,), (2,), (1,)], 8)), ("RA", Side(1, 5)))
    assert value(robot) == (1,)
    replies(robot, ("RD", FBEstimate([1, 1, 1], [0, 0, 0, 2])))
    assert value(robot) == (2,), "both sides and the bounds of robots after count"


def test_a_side_is_asked_for_once() -> None:
    robot = after(holder(), ("RA", Side(1, 7)), ("RB", Side(1, 0)))
    said = replies(robot, ("RB", cpa((1, 1), (1, 2), least=[0, 0, 0])))
    assert said[0] == ("RA", SideRequest((2,), 2, 1))  # now the cheaper value: 2, and not 1 + 4 + 7
    replies(robot, ("RA", Side(2, 0)), ("RB", Side(2, 0)))
    said = replies(robot, ("RD", CPA(assigned((1, 1), (1, 2), (2, 2)), math.inf, [])))
    assert said[0] == ("RB", SideRequest((1,), 3, 2))
    assert said[1][0] == "RD"


def test_a_robot_that_shares_nothing_above_sends_the_cpa_on_at_once() -> None:
    assert replies(agent("RB"), ("RA", cpa((1, 1), least=[0, 0])))[0] == ("RC", cpa((1, 1), (1, 1), least=[0, 0, 0]))


def test_what_nobody_asked_for_or_may_ask_is_refused() -> None:
    assert_refused(holder, [("RD", Side(1, 3)), ("RD", SideRequest((1,), 1, 1))], r"did not request|is not below")
