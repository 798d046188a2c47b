"""One test per rule of Max-Sum_AD (Zivan, Parash, Cohen, Peled, Okamoto 2017), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.orders import with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.inference.maxsum import Q, R
from robochoc.protocols.inference.maxsum_ad import MaxSumAD, MaxSumADSettings
from robochoc.protocols.message import Message
from robochoc.protocols.shared.cycles import Domain, Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_tree
from tests.support.examples import count
from tests.support.local_search_runs import (
    any_schedule,
    assignments_by_cycle,
    cost_of_assignment,
    domains_of,
    is_optimal,
    never_rises,
    played,
)
from tests.support.problems import team_of

COSTS = Relation("C", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (3, 1, 4, 6))
HARD = Relation("H", 2, Semantics.CONFLICTS, ((2, 1), (2, 2)))
TWO = Domain([(1,), (2,)])


def chain(first: Relation = COSTS) -> Team:
    """B between A, whose function it holds, and C, who holds the other one."""
    constraints = [Constraint("F", first, ("A", "B"), ("A", "B")), Constraint("S", COSTS, ("B", "C"), ("B", "C"))]
    return team_of(dict.fromkeys("ABC", (1, 2)), constraints)


def middle(variant: str = "AD", first: Relation = COSTS, cycles: int = 100) -> MaxSumAD:
    """B, without preferences, once domains have been told."""
    robot = robot_of(MaxSumAD, chain(first), "RB")
    robot.settings = MaxSumADSettings(variant=variant, preference=0, cycles=cycles)  # type: ignore[misc, arg-type]
    assert started(robot) == [("RC", TWO)]
    assert replies(robot, ("RA", TWO)) == []
    return robot


def said(robot: MaxSumAD, *messages: tuple[str, Message]) -> list[Message]:
    return [message for _, message in replies(robot, *messages)]


def test_odd_phases_go_up_with_r_and_even_ones_down_with_q() -> None:
    robot = middle()
    assert replies(robot, ("RC", R([[0, 7]]))) == [("RA", R([[3, 4]]))]
    assert replies(robot, ("RA", Q([[0, 0]]))) == [("RC", Q([[2, 0]]))]
    assert robot.cycle == 2


def test_the_last_messages_of_the_other_direction_count() -> None:
    robot = middle()
    replies(robot, ("RC", R([[0, 7]])))
    assert value(robot) == (1,)
    replies(robot, ("RA", Q([[5, 0]])))
    assert value(robot) == (1,)  # by A 4 and 6, by C 0 and 7
    assert said(robot, ("RC", R([[0, 0]]))) == [R([[1, 4]])]
    assert robot.functions.q == {"RA": [[5, 0]]}


def test_a_phase_is_one_message_to_each_neighbour_on_that_side() -> None:
    team = chain()
    one, two = (played(team, MaxSumAD, Concurrent(0), cycles=cycles).metrics.messages for cycles in (1, 2))
    assert one["R"] == one["Domain"] == two["R"] == two["Q"]
    assert "Q" not in one


def test_from_the_third_phase_on_a_value_is_told_instead_of_q() -> None:
    robot = middle("ADVP")
    replies(robot, ("RC", R([[0, 7]])), ("RA", Q([[0, 0]])))
    assert robot.cycle == 2
    assert said(robot, ("RC", R([[0, 7]]))) == [R([[3, 4]])]  # 1 costs A so much
    assert said(robot, ("RA", Value((2,)))) == [Value((1,))]
    assert robot.functions.q == {"RA": [[INFINITE, 0]]}
    assert robot.own == [[4, 6]]


@looped(("variant", "kinds"), [("AD", "QQQQQ"), ("ADVP", "QVVVV"), ("ADSSVP", "QVVQV")])
def test_which_phases_down_tell_values(variant: str, kinds: str) -> None:
    """Of phases 3, 4 | 6, 7 | 9, 10 values are told by ADSSVP, and of those 4, 6 and 10 go down."""
    robot = middle(variant)
    told = []
    for _ in kinds:
        replies(robot, ("RC", R([[0, 0]])))
        (message,) = said(robot, ("RA", Q([[0, 0]])))
        told.append(type(message).__name__[0])
    assert "".join(told) == kinds


def test_after_the_last_phase_nothing_is_awaited() -> None:
    robot = middle(cycles=1)
    assert len(said(robot, ("RC", R([[0, 0]])))) == 1
    assert said(robot, ("RA", Q([[0, 0]]))) == []
    assert robot.finished


def test_before_values_are_told_a_robot_without_a_value_has_a_proof_and_afterwards_it_breaks_the_fewest() -> None:
    robot = middle("ADVP")
    replies(robot, ("RC", R([[INFINITE, INFINITE]])))
    assert robot.verdict is Verdict.NO_SOLUTION
    robot = middle("ADVP", HARD)
    replies(robot, ("RC", R([[0, 0]])), ("RA", Q([[0, 0]])), ("RC", R([[INFINITE, 5]])), ("RA", Value((2,))))
    assert robot.verdict is None
    assert value(robot) == (2,)  # 1 violates both, 2 the function of A


def test_what_has_the_wrong_size_is_refused() -> None:
    robot = middle()
    with pytest.raises(ValueError, match="must have 1 rows of 2 entries"):
        replies(robot, ("RC", R([[0, 0, 0]])))
    robot = middle()
    replies(robot, ("RC", R([[0, 0]])))
    with pytest.raises(ValueError, match="must have 1 rows of 2 entries"):
        replies(robot, ("RA", Q([[0, 0, 0]])))
    robot = middle("ADVP")
    replies(robot, ("RC", R([[0, 0]])))
    with pytest.raises(ValueError, match="not in list"):
        replies(robot, ("RA", Value((9,))))


def test_q_of_another_number_of_functions_says_nothing() -> None:
    """The sender has not heard yet that a domain came late: of the functions as they were."""
    robot = middle()
    replies(robot, ("RC", R([[0, 0]])), ("RA", Q([[0, 9], [9, 0]])))
    assert robot.functions.q == {"RA": [[0, 0]]}


def test_who_has_no_r_from_below_tells_its_domain_again() -> None:
    robot = middle()
    robot.miss("RC")
    robot.settle()
    assert ("RC", Domain([(1,), (2,)])) in replies(robot, ("RA", Q([[0, 0]])))


@count("trees", 60, 500)
@looped("variant", ["AD", "ADVP", "ADSSVP"])
def test_on_a_tree_in_its_order_two_phases_find_the_optimum(variant: str, trees: int) -> None:
    """With preferences too small to matter. ADVP stays there."""
    chance = Random(f"trees {variant}")
    soluble = 0
    for seed in range(trees):
        team = random_tree(chance)
        least = least_cost(team)
        result = played(team, MaxSumAD, any_schedule(chance), seed, variant=variant, cycles=6, preference=0.001)
        assert (result.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            soluble += 1
            course = assignments_by_cycle(team, result)
            assert all(cost_of_assignment(team, values) == (0, least) for values in course[2:])
    assert soluble > trees // 2


@count("trees", 40, 300)
def test_on_a_tree_in_any_order_it_takes_a_phase_for_each_turn(trees: int) -> None:
    chance = Random("turns")
    later = 0
    for seed in range(trees):
        team = random_tree(chance)
        team = with_order(team, chance.sample(team.order, len(team.order)))
        least = least_cost(team)
        result = played(team, MaxSumAD, any_schedule(chance), seed, variant="AD", cycles=9, preference=0.001)
        assert (result.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            course = [cost_of_assignment(team, values) for values in assignments_by_cycle(team, result)]
            assert course[-1] == course[-2] == (0, least)
            later += course[2] != (0, least)
    assert later


@count("teams", 40, 500)
def test_with_value_propagation_the_cost_never_rises_and_the_search_settles(teams: int) -> None:
    """Between two robots each. In the end no robot alone can do better."""
    chance = Random("settles")
    settled = 0
    for seed in range(teams):
        team = random_cost_team(chance, n_ary=False)
        if not all(domains_of(team).values()):
            continue
        result = played(team, MaxSumAD, any_schedule(chance), seed, variant="ADVP", cycles=40, preference=0)
        if result.verdict is Verdict.NO_SOLUTION:
            assert least_cost(team) == INFINITE
            continue
        course = assignments_by_cycle(team, result)
        assert never_rises([cost_of_assignment(team, values) for values in course[4:]])
        assert course[-1] == course[-2] == course[-3]
        assert is_optimal(team, course[-1], 1)
        settled += 1
    assert settled > teams // 2


@count("teams", 25, 300)
@looped("variant", ["AD", "ADVP", "ADSSVP"])
def test_what_is_proven_is_true(variant: str, teams: int) -> None:
    chance = Random(f"proofs {variant}")
    proofs = 0
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            result = played(team, MaxSumAD, Concurrent(seed), seed, variant=variant, cycles=8)
            if result.verdict is Verdict.NO_SOLUTION:
                proofs += 1
                assert least_cost(team) == INFINITE
    assert proofs or teams < 100
