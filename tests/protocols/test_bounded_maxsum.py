"""One test per rule of bounded Max-Sum (Rogers, Farinelli, Stranders, Jennings, AIJ 2011), named for it."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Mapping
from random import Random
from typing import NamedTuple

import pytest

from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.orders import with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.inference.bounded_maxsum import Assign, BoundedMaxSum, Branch, Dependency
from robochoc.protocols.inference.spanning import Fragment
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.shared.cycles import Domain
from robochoc.protocols.shared.cycles import Value as ValueMessage
from robochoc.run import Options, Runtime, solve
from robochoc.solver import exact_costs
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import assert_refused, replies, started_robot
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team, random_tree, with_costs
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, cost_of_assignment
from tests.support.problems import shuffled, team_of

COSTS = Relation("C", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (3, 1, 4, 6))
HARD = Relation("H", 2, Semantics.CONFLICTS, ((2, 1), (2, 2)))
TWO = Domain([(1,), (2,)])


def pair(relation: Relation = COSTS) -> Team:
    return team_of(dict.fromkeys("AB", (1, 2)), [Constraint("F", relation, ("A", "B"), ("A", "B"))])


def robot(team: Team, name: str) -> BoundedMaxSum:
    return started_robot(BoundedMaxSum, team, name)


class Run(NamedTuple):
    verdict: Verdict
    values: dict[str, int]
    messages: Mapping[str, int]
    robots: Mapping[str, BoundedMaxSum]

    @property
    def roots(self) -> list[BoundedMaxSum]:
        return [robot for robot in self.robots.values() if robot.optimum is not None]

    @property
    def bound(self) -> float:
        return sum(root.optimum or 0 for root in self.roots)

    @property
    def cut(self) -> float:
        return sum(root.cut for root in self.roots)


def run(team: Team, chance: Random) -> Run:
    robots: dict[str, BoundedMaxSum] = {}

    class Watched(BoundedMaxSum):
        def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
            super().__init__(problem, order)
            robots[problem.agent] = self

    result = Simulation(team, Watched, any_schedule(chance)).search()
    values = {name: one for given in result.assignments.values() for name, one in given.items()}
    return Run(result.verdict, values, result.metrics.messages, robots)


def soft_team(chance: Random, size: int) -> Team:
    """Any graph, also with several parts."""
    domains = {f"X{number}": range(1, chance.randint(2, 4)) for number in range(size)}
    constraints = []
    for one, other in itertools.combinations(domains, 2):
        if chance.random() < 0.5:
            rows = tuple(itertools.product(domains[one], domains[other]))
            relation = Relation("R", 2, Semantics.SOFT, rows, tuple(chance.randint(0, 9) for _ in rows))
            constraints.append(Constraint("C", relation, (one, other), (one, other)))
    return team_of(domains, constraints)


def test_the_weight_of_a_dependency_is_the_largest_difference_that_a_value_makes() -> None:
    """Of the costs by A's value: 1 or 5. By B's: 2 or 2, so B may be cut, and A keeps the least of each value.

    What is always forbidden, such as A's 2, makes no difference, and what sometimes is an infinite one.
    """
    equal = Relation("E", 2, Semantics.CONFLICTS, ((1, 1), (2, 2)))
    for relation, told in (
        (COSTS, Dependency(2, [1, 4])),
        (HARD, Dependency(0, [0, INFINITE])),
        (equal, Dependency(INFINITE, [])),
    ):
        assert replies(robot(pair(relation), "RB"), ("RA", TWO))[0] == ("RA", told)
    alone = robot(team_of({"C": (1, 2)}, []), "RC")
    assert (alone.optimum, alone.assignment) == (0, {"C": 1})


def test_costs_go_up_the_tree_and_values_down() -> None:
    """A is the root: B holds the function, and tells what A's values cost; A tells its value."""
    low = robot(pair(), "RB")
    said = replies(low, ("RA", TWO))
    assert said[1] == ("RA", Fragment("RB"))
    high = robot(pair(), "RA")
    heard = {"RA": [message for _, message in said]}
    for _ in range(6):
        answers = replies(high, *(("RB", message) for message in heard["RA"]))
        heard["RA"] = [message for _, message in replies(low, *(("RA", message) for _, message in answers))]
        if high.optimum is not None:
            break
        if any(isinstance(message, Branch) for message in heard["RA"]):
            assert heard["RA"] == [Branch([1, 4], 0, 6)]
    assert high.optimum == 1
    assert (high.assignment, low.assignment) == ({"A": 1}, {"B": 2})


@count("teams", 25, 600)
def test_the_tree_is_a_maximum_spanning_forest(teams: int) -> None:
    """By Kruskal's algorithm on what the robots say that functions weigh."""
    chance = Random("forest")
    for _ in range(teams):
        team = soft_team(chance, chance.randint(1, 8))
        robots = run(team, chance).robots
        edges = sorted(
            (-one.weights[name], team.order.index(name), team.order.index(one.problem.agent))
            for one in robots.values()
            for name in one.functions
        )
        part = list(range(len(team.order)))
        kept = set()
        for _, high, low in edges:
            if part[high] != part[low]:
                kept.add((high, low))
                part = [part[low] if one == part[high] else one for one in part]
        ends = {tuple(sorted(map(team.order.index, (name, one)))) for name, it in robots.items() for one in it.joined}
        assert ends == kept
        assert len([one for one in robots.values() if one.parent is None]) == len({*part})


@count("teams", 40, 2500)
def test_the_bound_is_below_the_optimum_and_the_result_within_what_was_cut(teams: int) -> None:
    """So the ratio (bound + cut) / bound is kept, too."""
    chance = Random("bounds")
    inexact = 0
    for _ in range(teams):
        team = soft_team(chance, chance.randint(2, 7))
        told = run(team, chance)
        least = least_cost(team)
        broken, cost = cost_of_assignment(team, told.values)
        assert told.verdict is Verdict.SOLUTION
        assert not broken
        assert told.bound <= least <= cost <= told.bound + told.cut
        inexact += told.bound < least
    assert inexact > teams // 20


@count("teams", 40, 2500)
def test_with_hard_constraints_the_bound_holds_and_what_is_proven_is_true(teams: int) -> None:
    chance = Random("hard")
    proofs = 0
    for _ in range(teams):
        team = random_cost_team(chance, n_ary=False)
        told = run(team, chance)
        least = least_cost(team)
        if told.verdict is Verdict.NO_SOLUTION:
            proofs += 1
            assert least == INFINITE
            continue
        assert told.bound <= least
        broken, cost = cost_of_assignment(team, told.values)
        assert told.cut == INFINITE or (not broken and cost <= told.bound + told.cut)
    assert proofs


@count("trees", 25, 600)
def test_on_a_tree_nothing_is_cut_and_the_result_is_the_optimum(trees: int) -> None:
    """A robot that holds the function below says what to take; others get a value."""
    chance = Random("trees")
    kinds = Counter[str]()
    for _ in range(trees):
        team = random_tree(chance)
        team = with_order(team, shuffled(chance, team))
        told = run(team, chance)
        kinds.update(told.messages)
        least = least_cost(team)
        assert (told.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            assert (told.cut, told.bound) == (0, least)
            assert cost_of_assignment(team, told.values) == (0, least)
    assert kinds[Assign.__name__]
    assert kinds[ValueMessage.__name__]


@count("teams", 20, 300)
def test_a_run_says_optimal_where_the_result_meets_the_bound(teams: int) -> None:
    """On trees always, elsewhere where nothing that was cut mattered; otherwise it tells the bound."""
    chance = Random("optimal")
    trees, unproven = 0, 0
    for number in range(teams):
        team = with_costs(random_tree(chance)) if number % 2 else random_cost_team(chance, n_ary=False)
        least = least_cost(team)
        options = Options(protocol="bounded-maxsum", runtime=Runtime.SIMULATOR, cache=False)
        outcome = solve(team, options)
        if least == INFINITE:
            assert outcome.verdict in {Verdict.NO_SOLUTION, Verdict.NO_SOLUTION if number % 2 else Verdict.UNKNOWN}
        elif outcome.verdict is Verdict.OPTIMAL:
            assert (outcome.cost, outcome.bound) == (least, None)
            trees += number % 2
        else:
            assert not number % 2
            assert outcome.verdict in {Verdict.SOLUTION, Verdict.UNKNOWN}
            assert outcome.bound is not None
            assert outcome.bound <= least
            assert outcome.cost is None or outcome.bound < outcome.cost
            unproven += outcome.verdict is Verdict.SOLUTION
    assert trees
    assert unproven


def test_what_cannot_be_is_refused() -> None:
    assert_refused(lambda: robot(pair(), "RA"), [("RB", Dependency(float("nan"), []))], "weight nan")
    assert_refused(lambda: robot(pair(), "RA"), [("RB", Dependency(1, [1, 2, 3]))], "must have 1 rows of 2 entries")


def test_costs_that_floats_do_not_hold_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_costs, "EXACT", 5)
    with pytest.raises(TooLargeError, match="2\\^53"):
        run(pair(), Random(0))
