"""One test per rule of ATWB (Grinshpoun, Grubshtein, Zivan, Netzer, Meisels, JAIR 47, 2013), named for it."""

from __future__ import annotations

import math
from random import Random

import pytest

from robochoc.model.assembly import Extras, assemble
from robochoc.model.message import Value
from robochoc.model.problem import INFINITE, Domain, ProblemKind, Team, Variable
from robochoc.protocols.asymmetric.atwb import ATWB
from robochoc.protocols.asymmetric.messages.atwb import Side, SideRequest
from robochoc.protocols.optimization.messages.afb import CPA, FBCPA, FBEstimate, NewSolution
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.agent_problem import RunParameters, agent_problems
from robochoc.solver.compiled import LocalProblem
from tests.support.agents import replies, value
from tests.support.asymmetric_bytes import watched_entries, what_is_not_needed_changed
from tests.support.asymmetric_problems import priced_part, random_asymmetric_team, spent_on_asymmetric
from tests.support.compiled import plain_python_only
from tests.support.examples import count
from tests.support.pkc_bytes import nothing_hidden, run

NOBODY_WITHDRAWS = RunParameters()


def chain() -> Team:
    """A, B, C, D, two values each. A, C and B, C share costs; A pays 2 at least to C with its second value."""
    parts = {
        "RA": [priced_part("AC", {(1, 1): 7, (2, 1): 5, (2, 2): 2})],
        "RB": [priced_part("BC", {(1, 1): 3, (2, 2): INFINITE})],
        "RC": [priced_part("AC", {(1, 1): 1, (1, 2): 2}), priced_part("BC", {(1, 1): 4})],
        "RD": [],
    }
    own = {f"R{name}": [Variable(name, Domain("D", (range(1, 3),)))] for name in "ABCD"}
    return assemble("chain", own, [], kind=ProblemKind.DISWCSP, extras=Extras(parts=parts))


def agent(name: str, parameters: RunParameters = NOBODY_WITHDRAWS) -> ATWB:
    """The protocol object of one robot, started, with nothing left to say."""
    team = chain()
    problems = agent_problems(team, parameters=parameters, shared_scopes=True)
    robot = ATWB(LocalProblem(problems[name]), PriorityOrder(team.order))
    robot.start()
    robot.outbox.clear()
    return robot


def assigned(*assignments: tuple[int, int]) -> list[tuple[Value, int]]:
    return [((own,), counter) for own, counter in assignments]


def cpa(*assignments: tuple[int, int], least: list[float], bound: float = math.inf) -> CPA:
    return CPA(assigned(*assignments), bound, least)


AB = cpa((1, 1), (2, 1), least=[0, 0, 0])
"""A = 1 and B = 2: C pays 1 for its value 1, and 2 for its value 2."""


def holder() -> ATWB:
    """C, which holds the CPA with A = 1 and B = 2, and has asked for the sides of its value 1."""
    robot = agent("RC")
    replies(robot, ("RB", AB))
    return robot


def test_robots_before_are_asked_for_their_sides_and_robots_after_for_bounds_at_once() -> None:
    said = replies(agent("RC"), ("RB", AB))
    assert said == [
        ("RA", SideRequest((1,), 1, 1)),
        ("RB", SideRequest((1,), 1, 1)),
        ("RD", FBCPA(assigned((1, 1), (2, 1), (1, 1)))),
        ("RB", FBEstimate([1, 1], [0, 1, 1])),
    ]


def test_a_robot_before_tells_what_its_side_adds() -> None:
    robot = agent("RB")
    replies(robot, ("RA", cpa((1, 1), least=[0, 0])))
    assert replies(robot, ("RC", SideRequest((1,), 5, 1))) == [("RC", Side(5, 3))]
    assert replies(robot, ("RC", SideRequest((2,), 6, 1))) == [("RC", Side(6, 0))]


def test_what_it_pays_in_any_case_is_in_the_cpa_already() -> None:
    robot = agent("RA")
    said = replies(robot, ("RB", CPA(assigned((1, 1)), math.inf, [])))
    assert said[0] == ("RB", cpa((2, 2), least=[0, 2]))
    assert replies(robot, ("RC", SideRequest((1,), 5, 2))) == [("RC", Side(5, 3))]


def test_of_robots_that_may_withdraw_nothing_is_expected() -> None:
    robot = agent("RA", RunParameters(withdrawal_cost=9))
    assert robot.least == {"RC": [0, 0, 0]}


def test_what_its_side_forbids_is_infinite() -> None:
    robot = agent("RB")
    replies(robot, ("RA", cpa((1, 1), least=[0, 0])))
    replies(robot, ("RC", CPA(assigned((1, 1), (1, 1)), math.inf, [])))
    assert value(robot) == (2,)
    assert replies(robot, ("RC", SideRequest((2,), 5, 2))) == [("RC", Side(5, INFINITE))]


def test_a_request_about_a_value_that_was_given_up_is_dropped() -> None:
    robot = agent("RB")
    replies(robot, ("RA", cpa((1, 1), least=[0, 0])))
    replies(robot, ("RC", CPA(assigned((1, 1), (1, 1)), math.inf, [])))
    assert replies(robot, ("RC", SideRequest((1,), 5, 1))) == []


def test_the_cpa_goes_on_with_its_exact_cost_when_all_sides_are_known() -> None:
    robot = holder()
    assert replies(robot, ("RA", Side(1, 7))) == []
    (on,) = replies(robot, ("RB", Side(1, 0)))
    assert on == ("RD", cpa((1, 1), (2, 1), (1, 1), least=[0, 1, 1, 8]))


def test_the_next_value_is_taken_as_soon_as_the_sum_reaches_b() -> None:
    robot = holder()
    replies(robot, ("RD", NewSolution([(1,), (1,), (2,), (1,)], 8)))
    said = replies(robot, ("RA", Side(1, 7)))
    assert said[:2] == [("RA", SideRequest((2,), 2, 1)), ("RB", SideRequest((2,), 2, 1))]
    assert value(robot) == (2,)


def test_so_it_is_by_both_sides_and_the_bounds_of_robots_after() -> None:
    robot = holder()
    replies(robot, ("RD", NewSolution([(1,), (1,), (2,), (1,)], 8)), ("RA", Side(1, 5)))
    assert value(robot) == (1,)
    replies(robot, ("RD", FBEstimate([1, 1, 1], [0, 0, 0, 2])))
    assert value(robot) == (2,)


def test_an_answer_about_a_value_that_was_given_up_is_dropped() -> None:
    robot = holder()
    replies(robot, ("RD", NewSolution([(1,), (1,), (2,), (1,)], 8)), ("RA", Side(1, 7)))
    before = robot.cost
    assert replies(robot, ("RB", Side(1, 5))) == []
    assert robot.cost == before


def test_a_side_is_asked_for_once() -> None:
    robot = holder()
    replies(robot, ("RA", Side(1, 7)), ("RB", Side(1, 0)))
    said = replies(robot, ("RB", cpa((1, 1), (1, 2), least=[0, 0, 0])))
    assert said[0] == ("RA", SideRequest((2,), 2, 1))  # now the cheaper value: 2, and not 1 + 4 + 7
    replies(robot, ("RA", Side(2, 0)), ("RB", Side(2, 0)))
    said = replies(robot, ("RD", CPA(assigned((1, 1), (1, 2), (2, 2)), math.inf, [])))
    assert said[0] == ("RB", SideRequest((1,), 3, 2))
    assert said[1][0] == "RD"


def test_what_is_known_of_a_side_is_in_the_estimate() -> None:
    robot = holder()
    replies(robot, ("RA", Side(1, 7)), ("RB", Side(1, 0)))
    said = replies(robot, ("RA", FBCPA(assigned((1, 1)))))
    assert said == [("RA", FBEstimate([1], [0, 2]))]  # before: 1


def test_a_robot_that_shares_nothing_above_sends_the_cpa_on_at_once() -> None:
    assert replies(agent("RB"), ("RA", cpa((1, 1), least=[0, 0])))[0] == ("RC", cpa((1, 1), (1, 1), least=[0, 0, 0]))


@pytest.mark.parametrize("message", [Side(1, 3), SideRequest((1,), 1, 1)])
def test_what_nobody_asked_for_or_may_ask_is_refused(message: Side | SideRequest) -> None:
    with pytest.raises(ValueError, match=r"has not asked for|is not below"):
        replies(holder(), ("RD", message))


@pytest.mark.parametrize("wrong", [(), (3,), (1, 1)])
def test_a_request_with_a_value_that_cannot_be_is_refused(wrong: Value) -> None:
    robot = agent("RB")
    replies(robot, ("RA", cpa((1, 1), least=[0, 0])))
    with pytest.raises(ValueError, match="RC"):
        replies(robot, ("RC", SideRequest(wrong, 5, 1)))


def test_it_needs_fewer_messages_and_checks_than_syncabb() -> None:
    """The paper's point."""
    ours, syncabb = spent_on_asymmetric("atwb"), spent_on_asymmetric("syncabb")
    assert ours.messages < syncabb.messages / 3
    assert ours.ncccs < syncabb.ncccs / 5


@plain_python_only
@count("teams", 8, 100)
def test_what_a_robot_does_not_need_of_its_part_changes_no_message(teams: int) -> None:
    """Towards robots after it: all but the least entry of each own value, and those that it was asked about."""
    chance = Random("bytes atwb")
    others = 0
    for seed in range(teams):
        team = random_asymmetric_team(chance, simple=True)
        with pytest.MonkeyPatch.context() as patch:
            asked = watched_entries(team, patch)
            before = run(team, ATWB, seed)
        nothing_hidden(ATWB, before.envelopes)
        elsewhere = what_is_not_needed_changed(team, asked, chance)
        others += elsewhere != team
        assert [one[:3] for one in run(elsewhere, ATWB, seed).envelopes] == [one[:3] for one in before.envelopes]
    assert others > teams // 2
