"""The bounds of SFB's partial assignments, and how they are priced: a rule a test."""

from __future__ import annotations

import math

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.protocols.optimization.sfb import SFB, Explored
from tests.support.agents import replies
from tests.support.cases import looped
from tests.support.pseudo_trees import priced
from tests.support.sfb_robots import CHAIN, cpas, introduced, rows, team


def test_a_cpa_tells_its_bound_its_cost_its_values_and_what_values_below_would_cost() -> None:
    """RA 1 costs RB 3 or 1, and RA 2, for which RA is charged 1, costs it 0 or 2."""
    _, said = introduced(team(CHAIN))
    assert sorted(rows(said[0])) == [[1, 0, 0, 3, 1, 0, 0], [1, 1, 1, 0, 2, 0, 0]]


def test_of_equal_bounds_those_that_leave_others_the_most_go_first() -> None:
    _, said = introduced(team({"AB": (2, 1, 1, 1)}))
    assert [row[2] for row in rows(said[0])] == [1, 0]


def test_lower_bounds_go_first() -> None:
    _, said = introduced(team({"AB": (2, 2, 1, 1)}))
    assert [row[:3] for row in rows(said[0])] == [[1, 0, 1], [2, 0, 0]]


def test_the_bound_adds_the_least_of_each_robot_below() -> None:
    _, said = introduced(team({"AB": (2, 3, 9, 9), "AC": (9, 4, 9, 9), "D": (1, 2)}))
    assert rows(said[0])[0][:3] == [2 + 4 + 1, 0, 0]


def test_what_cannot_become_cheaper_than_the_best_known_is_not_sent() -> None:
    robots, _ = introduced(team(CHAIN))
    said = replies(robots["RB"], ("RA", cpas([1, 1, 1, 0, 2, 0, 0], least=3, ceiling=10)))
    assert [row[:4] for row in rows(said[0][1])] == [[1, 1, 1, 0]]  # RB 2 would have paid 2, and RC 1


def test_where_nothing_is_left_to_send_the_robot_goes_back_at_once() -> None:
    robots, _ = introduced(team(CHAIN))
    assert replies(robots["RB"], ("RA", cpas([1, 1, 1, 0, 2, 0, 0], least=1, ceiling=10))) == [("RA", Explored())]


def test_a_broken_hard_constraint_reaches_the_ceiling() -> None:
    _, said = introduced(team({"AB": (math.inf, math.inf, 1, math.inf)}))
    assert rows(said[0]) == [[1, 0, 1, 1, 2]]


@looped("dear", [1, 100, 30_000, 1 << 20, 1 << 40])
def test_numbers_are_as_small_as_the_costs_allow_and_exact(dear: int) -> None:
    problem = team({"AB": (dear, dear + 1, dear + 1, dear + 1), "BC": (dear + 2, dear, dear, dear), "C": (1, 0)})
    result = Simulation(problem, SFB, RandomChannels(0)).run(60)
    assert {name: next(iter(own.values())) for name, own in result.assignments.items()} == {"RA": 1, "RB": 1, "RC": 2}
    best = result.findings["RA"].best
    assert best is not None
    assert best.cost == 2 * dear


def test_of_an_n_ary_constraint_the_last_but_one_adds_what_the_last_will_pay() -> None:
    """The first robot of the scope adds nothing."""
    robots, said = introduced(team({"ABC": (1, 2, 3, 4, 5, 6, 7, 8)}))
    assert [row[3:] for row in rows(said[0])] == [[0, 0, 0, 0]] * 2
    said_next = replies(robots["RB"], ("RA", cpas([0, 0, 1, 0, 0, 0, 0], ceiling=9)))
    assert rows(said_next[0][1]) == [[5, 0, 1, 0, 5, 6], [7, 0, 1, 1, 7, 8]]


def test_domains_may_be_of_different_sizes() -> None:
    _, said = introduced(priced("ABC", {"AB": (5, 4, 3, 9, 9, 9), "AC": (2, 7)}, {"B": 3, "C": 1}))
    assert rows(said[0])[0] == [3 + 2, 0, 0, 5, 4, 3, 2]


def test_all_constraint_checks_are_done_before_the_search() -> None:
    robots, said = introduced(team(CHAIN))
    checks = [robot.problem.checks for robot in robots.values()]
    assert replies(robots["RB"], ("RA", said[0]))
    assert [robot.problem.checks for robot in robots.values()] == checks
