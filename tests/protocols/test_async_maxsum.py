"""One test per rule of asynchronous Max-Sum, named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.orders import with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.inference.async_maxsum import AsyncMaxSum, AsyncMaxSumSettings, Q, R
from robochoc.protocols.settings import SettingsError, read_settings
from robochoc.protocols.shared.cycles import Domain
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import after, assert_refused, replies, robot_of, started, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_tree
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, cost_of_assignment
from tests.support.problems import team_of

COSTS = Relation("C", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (3, 1, 4, 6))
TWO = Domain([(1,), (2,)])


def middle(**settings: float) -> AsyncMaxSum:
    """B between A, whose function it holds, and C, who holds the other one; without preferences."""
    pairs = {"F": ("A", "B"), "S": ("B", "C")}
    team = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint(name, COSTS, pair, pair) for name, pair in pairs.items()])
    robot = robot_of(AsyncMaxSum, team, "RB")
    robot.settings = AsyncMaxSumSettings(**{"preference": 0.0, "damping": 0.0, **settings})  # type: ignore[misc, arg-type]
    assert started(robot) == [("RC", TWO)]
    return robot


def run(team: Team, chance: Random, seed: int, **settings: object) -> SearchResult:
    parameters = RunParameters(seed, {name: str(given) for name, given in settings.items()})
    return Simulation(team, AsyncMaxSum, any_schedule(chance), parameters=parameters).search()


def final(result: SearchResult) -> dict[str, int]:
    return {name: one for values in result.assignments.values() for name, one in values.items()}


def test_r_goes_up_as_soon_as_domains_are_known_and_each_arrival_is_answered_at_once_to_the_others() -> None:
    robot = middle()
    assert replies(robot, ("RA", TWO)) == [("RA", R([[1, 4]], settled=True))]
    assert replies(robot, ("RC", R([[0, 7]], settled=True))) == [
        ("RA", R([[3, 4]], settled=True)),
        ("RC", Q([[2, 0]], settled=True)),
    ]
    assert value(robot) == (1,)
    assert replies(robot, ("RA", Q([[5, 0]], settled=True))) == [("RC", Q([[0, 2]], settled=True))]
    assert replies(robot, ("RA", Q([[5, 0]], settled=True))) == []
    again = replies(robot, ("RA", Q([[5, 0]], settled=False)))
    assert again == [("RA", R([[3, 4]], settled=True))], "it is answered, as it is not settled"


def test_a_change_that_is_smaller_than_the_tolerance_is_not_told() -> None:
    robot = after(middle(tolerance=0.5), ("RA", TWO), ("RC", R([[0, 7]], settled=True)))
    assert replies(robot, ("RC", R([[0, 1.5]], settled=True))) == []  # A's value 1 costs 2.5 now, and not 3
    assert replies(robot, ("RC", R([[0, 1]], settled=True))) == [("RA", R([[2, 4]], settled=True))]


def test_what_is_damped_is_not_settled_and_is_told_on_when_the_receiver_answers() -> None:
    robot = after(middle(damping=0.25, tolerance=0.4), ("RA", TWO))
    replies(robot, ("RC", R([[0, 0]], settled=True)))
    assert replies(robot, ("RC", R([[0, 2]], settled=True))) == [("RA", R([[2.5, 4]], settled=False))]
    assert replies(robot, ("RA", Q([[0, 0]], settled=True))) == [("RA", R([[3, 4]], settled=True))]
    assert replies(robot, ("RA", Q([[0, 0]], settled=True))) == []


def test_after_so_many_messages_a_neighbour_hears_no_more() -> None:
    robot = after(middle(limit=1), ("RA", TWO))
    assert replies(robot, ("RC", R([[0, 7]], settled=True))) == [("RC", Q([[2, 0]], settled=True))]
    assert replies(robot, ("RC", R([[9, 0]], settled=True))) == []
    assert value(robot) == (2,)


def test_a_robot_all_of_whose_values_are_out_has_proven_that_there_is_no_solution() -> None:
    robot = after(middle(), ("RA", TWO))
    assert replies(robot, ("RC", R([[INFINITE, INFINITE]], settled=True))) == []
    assert robot.verdict is Verdict.NO_SOLUTION
    assert replies(robot, ("RA", Q([[0, 0]], settled=True))) == []


def test_what_has_the_wrong_size_or_comes_too_early_is_refused() -> None:
    assert_refused(middle, [("RA", Q([[0, 0]], settled=True))], "before it received R")
    assert_refused(middle, [("RC", R([[0, 0, 0]], settled=True))], "must have 1 rows of 2 entries")


@count("trees", 25, 500)
def test_on_a_tree_silence_is_an_optimum_damped_or_not(trees: int) -> None:
    """In any order, with preferences too small to matter."""
    chance = Random("silence")
    soluble = 0
    for seed in range(trees):
        team = random_tree(chance)
        team = with_order(team, chance.sample(team.order, len(team.order)))
        least = least_cost(team)
        result = run(team, chance, seed, damping=chance.choice((0, 0.5, 0.9)), preference=0.001, limit=10_000)
        assert (result.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            soluble += 1
            assert cost_of_assignment(team, final(result)) == (0, least)
    assert soluble > trees // 2


@count("teams", 20, 500)
def test_on_any_graph_it_falls_silent_and_what_is_proven_is_true(teams: int) -> None:
    chance = Random("silent")
    proofs = 0
    for seed in range(teams):
        team = random_cost_team(chance)
        result = run(team, chance, seed, limit=20)
        if result.verdict is Verdict.NO_SOLUTION:
            proofs += 1
            assert least_cost(team) == INFINITE
        else:
            assert result.verdict is Verdict.SOLUTION
            assert cost_of_assignment(team, final(result)) >= (0, 0)
            assert all(many <= 40 * 20 for many in result.metrics.messages.values())
    assert proofs


@looped(
    ("name", "given", "rule"),
    [
        ("damping", "1", "from 0 to below 1"),
        ("preference", "-1", "a number, 0 or more"),
        ("tolerance", "nan", "a number, 0 or more"),
        ("limit", "0", "1 or more"),
    ],
)
def test_settings_that_make_no_sense_are_refused(name: str, given: str, rule: str) -> None:
    with pytest.raises(SettingsError, match=rule):
        read_settings(AsyncMaxSum, {name: given})
