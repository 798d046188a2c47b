"""One test per rule of DBA (Yokoo and Hirayama, ICMAS 1996), named for it."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.satisfaction.dba import DBA, DBASettings, Improve
from robochoc.protocols.shared.cycles import Value
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import RunParameters
from robochoc.verification.checker import violations
from tests.support.agents import replies, started_robot, value
from tests.support.cases import looped
from tests.support.cost_problems import random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule
from tests.support.loose_problems import minimum_cost
from tests.support.problems import team_of
from tests.support.small_teams import DIFFERENT


def path(*names: str, relation: Relation = DIFFERENT, values: int = 2) -> Team:
    pairs = list(itertools.pairwise(names))
    return team_of(dict.fromkeys(names, range(1, values + 1)), [Constraint("C", relation, p, p) for p in pairs])


def middle(*chances: float, relation: Relation = DIFFERENT, values: int = 2) -> DBA:
    """B between A and C, with the value 1."""
    return started_robot(DBA, path("A", "B", "C", relation=relation, values=values), "RB", chances=(0.0, *chances))


def hears(it: DBA, left: int, right: int) -> Improve:
    (_, said), _ = replies(it, ("RA", Value((left,))), ("RC", Value((right,))))
    assert isinstance(said, Improve)
    return said


def is_told(it: DBA, left: Improve, right: Improve) -> None:
    replies(it, ("RA", left), ("RC", right))


def test_the_largest_reduction_of_weights_is_told_and_that_something_may_be_violated_where_a_value_is_missed() -> None:
    for left, right, told in ((1, 1, Improve(2, 2, 0)), (1, 2, Improve(0, 1, 0)), (2, 2, Improve(0, 0, 0))):
        assert hears(middle(), left, right) == told
    robot = middle()
    robot.miss("RC")
    (_, said), _ = replies(robot, ("RA", Value((2,))))
    assert said == Improve(0, 1, 0)


def test_who_misses_a_reduction_stays_and_counts_from_0_and_does_not_give_up_for_all() -> None:

    class Short(DBA):
        settings = DBASettings(cycles=1)

    robot = started_robot(Short, path("A", "B", "C"), "RB")
    hears(robot, 1, 1)
    robot.miss("RA")
    replies(robot, ("RC", Improve(0, 1, 0)))
    assert (value(robot), robot.counter, robot.verdict) == ((1,), 0, None)


@looped(("left", "right", "moves"), [(1, 1, True), (1, 2, True), (2, 1, False), (3, 0, False), (0, 3, False)])
def test_who_reduces_most_moves_and_of_equals_the_first(left: int, right: int, moves: bool) -> None:  # noqa: FBT001
    it = middle()
    hears(it, 1, 1)
    is_told(it, Improve(left, 3, 0), Improve(right, 3, 0))
    assert value(it) == ((2,) if moves else (1,))
    assert not it.weights


def test_what_is_violated_in_a_quasi_local_minimum_weighs_more() -> None:
    it = middle()
    hears(it, 1, 2)
    is_told(it, Improve(1, 1, 0), Improve(0, 0, 0))
    assert not it.weights
    hears(it, 1, 2)
    is_told(it, Improve(0, 1, 0), Improve(0, 0, 0))
    assert list(it.weights.values()) == [2]
    assert hears(it, 1, 2) == Improve(1, 2, 0)


def test_of_several_best_values_one_is_drawn() -> None:
    it = middle(0.9, values=3)
    hears(it, 1, 1)
    is_told(it, Improve(0, 1, 0), Improve(0, 1, 0))
    assert value(it) == (3,)


def test_the_counter_counts_while_nobody_near_violates_anything_and_at_the_largest_distance_it_stops() -> None:
    it = middle()
    assert hears(it, 2, 2).counter == 0
    is_told(it, Improve(0, 0, 0), Improve(0, 0, 5))
    assert hears(it, 2, 2).counter == 1
    is_told(it, Improve(0, 0, 1), Improve(0, 1, 0))
    assert (it.counter, it.finished) == (0, False)
    hears(it, 2, 2)
    is_told(it, Improve(0, 0, 0), Improve(0, 0, 0))
    hears(it, 2, 2)
    assert replies(it, ("RA", Improve(0, 0, 1)), ("RC", Improve(0, 0, 1))) == []
    assert it.finished
    assert it.verdict is None


def test_without_a_solution_it_gives_up_after_so_many_cycles() -> None:
    none = Relation("N", 2, Semantics.CONFLICTS, ((1, 1), (1, 2), (2, 1), (2, 2)))
    team = path("A", "B", relation=none)
    outcome = solve(team, Options(protocol="dba", runtime=Runtime.SIMULATOR, settings={"cycles": "7"}))
    assert outcome.verdict is Verdict.UNKNOWN
    assert outcome.metrics.messages == {"Improve": 14, "Value": 14}


@count("teams", 30, 1000)
def test_who_stops_violates_nothing(teams: int) -> None:
    """Most that have a solution are solved. All that are connected stop in the same cycle, and nobody is told."""
    chance = Random("breakout")
    solved = soluble = 0
    for seed in range(teams):
        team = random_hard_team(chance)
        parameters = RunParameters(seed, {"cycles": "200"})
        result = Simulation(team, DBA, any_schedule(chance), parameters=parameters).search()
        possible = minimum_cost(team) < INFINITE
        soluble += possible
        if result.verdict is Verdict.SOLUTION:
            solved += 1
            found = {name: val for own in result.assignments.values() for name, val in own.items()}
            assert not list(violations(team, found, ()))
        elif result.verdict is Verdict.NO_SOLUTION:
            assert not possible
    assert solved > 0.9 * soluble > 0
