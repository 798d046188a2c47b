"""One test per rule of Synchronous Branch and Bound (Hirayama and Yokoo 1997), named for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from random import Random

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import Findings, Incumbent
from robochoc.protocols.message import Value
from robochoc.protocols.optimization.syncbb import Backtrack, BestPath, Cost, Path, SyncBB, Terminate
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.problems import team_of

NONE = BestPath(math.inf)


def priced(scope: str, costs: Mapping[tuple[int, ...], float]) -> Constraint:
    """What is not listed costs nothing."""
    relation = Relation("R", len(scope), Semantics.SOFT, tuple(costs), tuple(costs.values()), 0)
    return Constraint("C", relation, tuple(scope), tuple(scope))


def triangle() -> Team:
    """Three robots; A and B had better differ, C pays what its value is, and more if it is B's."""
    constraints = [
        priced("AB", {(1, 1): 5, (2, 2): 4}),
        priced("BC", {(1, 1): 2, (2, 2): 2}),
        priced("C", {(1,): 1, (2,): 2}),
    ]
    return team_of(dict.fromkeys("ABC", (1, 2)), constraints)


agent = partial(started_robot, SyncBB)


def path(*assignments: tuple[int, Cost], best: BestPath = NONE) -> Path:
    """A path of robots with one variable each: their values, and what each pays."""
    return Path([((own,), cost) for own, cost in assignments], best)


def best(bound: Cost, *values: int) -> BestPath:
    return BestPath(bound, tuple((own,) for own in values))


def test_the_first_robot_makes_the_path_and_the_others_wait() -> None:
    assert started(robot_of(SyncBB, triangle(), "RA")) == [("RB", path((1, 0)))]
    assert started(robot_of(SyncBB, triangle(), "RB")) == []


def test_a_robot_adds_its_first_value_and_what_it_costs() -> None:
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RA", path((1, 0)))) == [("RC", path((1, 0), (1, 5)))]
    assert value(robot) == (1,)


def test_a_value_with_which_the_path_costs_as_much_as_the_best_one_is_passed_over() -> None:
    bound = best(5, 2, 1, 2)
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RA", path((1, 0), best=bound))) == [("RC", path((1, 0), (2, 0), best=bound))]


def test_a_robot_without_a_value_left_sends_the_path_back_to_the_robot_before() -> None:
    bound = best(4, 2, 1, 2)
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", path((2, 0), best=bound)))
    assert replies(robot, ("RC", Backtrack(bound))) == [("RA", Backtrack(bound))]
    assert value(robot) is None


def test_the_robot_before_takes_its_next_value_and_does_not_price_the_first_ones_again() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", path((1, 0))))
    before = robot.problem.checks
    bound = best(8, 1, 1, 1)
    assert replies(robot, ("RC", Backtrack(bound))) == [("RC", path((1, 0), (2, 0), best=bound))]
    assert robot.problem.checks == before + 1


def test_the_last_robot_s_path_is_the_best_one_and_it_looks_on_for_a_cheaper_one() -> None:
    robot = agent(triangle(), "RC")
    assert replies(robot, ("RB", path((1, 0), (1, 5)))) == [("RB", Backtrack(best(7, 1, 1, 2)))]


def test_a_path_that_costs_as_much_as_the_new_bound_goes_back_without_a_look_at_other_values() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", path((2, 3))))
    before = robot.problem.checks
    assert replies(robot, ("RC", Backtrack(best(3, 1, 2, 1)))) == [("RA", Backtrack(best(3, 1, 2, 1)))]
    assert robot.problem.checks == before


def test_a_broken_hard_constraint_is_never_added() -> None:
    hard = team_of(dict.fromkeys("AB", (1, 2)), [priced("AB", {(1, 1): INFINITE, (1, 2): INFINITE})])
    assert replies(agent(hard, "RB"), ("RA", path((1, 0)))) == [("RA", Backtrack(NONE))]


def test_the_best_path_is_told_to_all_when_the_first_robot_has_no_value_left() -> None:
    robot = agent(triangle(), "RA")
    replies(robot, ("RB", Backtrack(best(4, 1, 2, 2))))
    found = best(1, 1, 2, 1)
    assert replies(robot, ("RB", Backtrack(found))) == [("RB", Terminate(found)), ("RC", Terminate(found))]
    assert value(robot) == (1,)
    assert robot.verdict is None


def test_nothing_is_said_after_the_verdict() -> None:
    hard = team_of({"A": (1,), "B": (1,)}, [priced("AB", {(1, 1): INFINITE})])
    robot = agent(hard, "RA")
    assert replies(robot, ("RB", Backtrack(NONE))) == []
    assert robot.verdict is Verdict.NO_SOLUTION
    assert replies(robot, ("RB", Terminate(best(1, 1, 1)))) == []
    assert value(robot) is None


def test_who_is_told_the_end_takes_its_value_in_the_best_path_and_is_silent() -> None:
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RA", Terminate(best(1, 1, 2, 1)))) == []
    assert value(robot) == (2,)


def test_there_is_no_solution_when_the_first_robot_has_heard_of_none() -> None:
    robot = agent(triangle(), "RA")
    replies(robot, ("RB", Backtrack(NONE)))
    assert replies(robot, ("RB", Backtrack(NONE))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_a_robot_with_an_empty_domain_says_so_at_once() -> None:
    assert agent(team_of({"A": (1, 2), "B": ()}, []), "RB").verdict is Verdict.NO_SOLUTION


def test_a_robot_alone_is_the_first_and_the_last() -> None:
    robot = agent(team_of({"A": (1, 2)}, [priced("A", {(1,): 3, (2,): 1})]), "RA")
    assert (robot.verdict, robot.assignment, robot.findings.bound) == (None, {"A": 2}, 1)


def test_an_n_ary_constraint_is_paid_by_its_lowest_robot() -> None:
    team = team_of(dict.fromkeys("ABC", (1, 2)), [priced("ABC", {(1, 1, 1): 7})])
    assert replies(agent(team, "RB"), ("RA", path((1, 0)))) == [("RC", path((1, 0), (1, 0)))]
    assert replies(agent(team, "RC"), ("RB", path((1, 0), (1, 0)))) == [("RB", Backtrack(best(0, 1, 1, 2)))]


def test_who_may_step_aside_does_so_last() -> None:
    team = team_of(dict.fromkeys("AB", (1,)), [priced("AB", {(1, 1): INFINITE})])
    robot = agent(team, "RB", parameters=RunParameters(withdrawal_cost=3))
    aside: Value = (None,)
    assert replies(robot, ("RA", path((1, 0)))) == [("RA", Backtrack(BestPath(3, ((1,), aside))))]
    replies(robot, ("RA", Terminate(BestPath(3, ((1,), aside)))))
    assert robot.assignment == {}


def test_the_best_path_and_a_bound_are_found_before_the_end() -> None:
    constraints = [priced("A", {(1,): 2, (2,): 3}), priced("AB", {(1, 2): 4})]
    robot = agent(team_of(dict.fromkeys("AB", (1, 2)), constraints), "RA")
    assert robot.findings == Findings(bound=2)
    replies(robot, ("RB", Backtrack(best(6, 1, 1))))
    assert robot.findings == Findings(best=Incumbent(6, {"RA": (1,), "RB": (1,)}), bound=3)
    assert agent(triangle(), "RB").findings == Findings()


@looped("seed", range(10))
def test_what_is_found_at_any_moment_is_on_both_sides_of_the_least_cost(seed: int) -> None:
    team = random_cost_team(Random(seed))
    least = least_cost(team)
    for messages in (1, 2, 5, 10, 20, 50, 100):
        findings = Simulation(team, SyncBB, Concurrent(seed)).search(60, messages).findings
        assert (findings[team.order[0]].bound or 0) <= least
        assert all(least <= found.best.cost for found in findings.values() if found.best is not None)


def test_one_robot_acts_at_a_time_so_all_checks_stand_in_a_row() -> None:
    for seed in range(10):
        metrics = Simulation(random_cost_team(Random(seed)), SyncBB, Concurrent(seed)).run().metrics
        assert metrics.ncccs == metrics.checks
