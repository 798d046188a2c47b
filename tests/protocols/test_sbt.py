"""One test per rule of synchronous backtracking (Yokoo, Durfee, Ishida, Kuwabara 1998), named for it."""

from __future__ import annotations

from functools import partial
from random import Random

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.satisfaction.sbt import SBT
from robochoc.protocols.satisfaction.sbt_messages import CPA, Backtrack
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.problems import random_team, team_of
from tests.support.small_teams import differ


def triangle(values: int = 3) -> Team:
    """Three robots, each different from each; a fourth that only the first knows."""
    domains = {name: range(1, values + 1) for name in ("A", "B", "C", "D")}
    pairs = (("A", "B"), ("A", "C"), ("B", "C"), ("A", "D"))
    return team_of(domains, [differ(*pair) for pair in pairs])


agent = partial(started_robot, SBT)


def test_the_first_robot_makes_the_cpa_and_the_others_wait() -> None:
    said = [started(robot_of(SBT, triangle(), name)) for name in ("RA", "RB", "RC", "RD")]
    assert said == [[("RB", CPA(((1,),)))], [], [], []]


def test_the_first_value_that_agrees_with_the_cpa_is_added_and_told_to_the_next_robot_only() -> None:
    sbt = agent(triangle(), "RB")
    assert replies(sbt, ("RA", CPA(((1,),)))) == [("RC", CPA(((1,), (2,))))]
    assert sbt.assignment == {"B": 2}


def test_a_robot_without_a_value_sends_the_cpa_back_to_the_robot_before() -> None:
    sbt = agent(triangle(2), "RC")
    assert replies(sbt, ("RB", CPA(((1,), (2,))))) == [("RB", Backtrack())]
    assert sbt.assignment == {}


def test_backtracking_is_chronological() -> None:
    """D's trouble is with A, and A only: still C is asked."""
    sbt = agent(team_of({"A": (1,), "C": (1, 2), "D": (1,)}, [differ("A", "D")]), "RD")
    assert replies(sbt, ("RC", CPA(((1,), (1,))))) == [("RC", Backtrack())]


def test_the_robot_before_takes_its_next_value_and_does_not_check_the_first_ones_again() -> None:
    sbt = agent(triangle(), "RB")
    replies(sbt, ("RA", CPA(((1,),))))
    before = sbt.problem.checks
    assert replies(sbt, ("RC", Backtrack())) == [("RC", CPA(((1,), (3,))))]
    assert sbt.problem.checks == before + 1


def test_a_new_cpa_lets_all_values_be_tried_again() -> None:
    sbt = agent(triangle(), "RB")
    replies(sbt, ("RA", CPA(((1,),))))
    assert replies(sbt, ("RC", Backtrack()))
    assert replies(sbt, ("RC", Backtrack())) == [("RA", Backtrack())]
    assert replies(sbt, ("RA", CPA(((2,),)))) == [("RC", CPA(((2,), (1,))))]


def test_the_last_robot_concludes_that_a_solution_stands() -> None:
    sbt = agent(triangle(), "RD")
    assert replies(sbt, ("RC", CPA(((1,), (2,), (3,))))) == []
    assert sbt.verdict is Verdict.SOLUTION
    assert sbt.assignment == {"D": 2}


def test_the_first_robot_concludes_that_there_is_none_when_its_domain_is_exhausted() -> None:
    sbt = agent(triangle(2), "RA")
    assert replies(sbt, ("RB", Backtrack())) == [("RB", CPA(((2,),)))]
    assert replies(sbt, ("RB", Backtrack())) == []
    assert sbt.verdict is Verdict.NO_SOLUTION
    assert replies(sbt, ("RB", Backtrack())) == [], "nothing is said after the verdict"


def test_a_robot_with_an_empty_domain_says_so_at_once() -> None:
    sbt = agent(team_of({"A": (1, 2), "B": ()}, []), "RB")
    assert sbt.verdict is Verdict.NO_SOLUTION


def test_a_robot_alone_is_the_first_and_the_last() -> None:
    sbt = agent(team_of({"A": (1, 2)}, []), "RA")
    assert (sbt.verdict, sbt.assignment) == (Verdict.SOLUTION, {"A": 1})


def test_an_n_ary_constraint_is_checked_by_its_lowest_robot() -> None:
    rows = Relation("even", 3, Semantics.SUPPORTS, ((1, 1, 2), (1, 2, 1), (2, 1, 1)))
    scope = ("A", "B", "C")
    team = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("E", rows, scope, scope)])
    second, third = agent(team, "RB"), agent(team, "RC")
    assert replies(second, ("RA", CPA(((1,),)))) == [("RC", CPA(((1,), (1,))))]
    assert second.problem.checks == 0
    replies(third, ("RB", CPA(((1,), (1,)))))
    assert third.assignment == {"C": 2}


@looped("seed", range(20))
def test_the_solution_is_the_first_one_in_the_order_of_robots_and_values(seed: int) -> None:
    """One robot acts at a time: all checks stand in a row."""
    team = random_team(Random(seed))
    truth = next(solutions(team), None)
    result = Simulation(team, SBT, Concurrent(seed)).run()
    assert result.verdict is (Verdict.NO_SOLUTION if truth is None else Verdict.SOLUTION)
    assert result.metrics.ncccs == result.metrics.checks
    if truth is not None:
        assert {name: value for own in result.assignments.values() for name, value in own.items()} == truth
