"""The bounds of SFB's partial assignments, and how they are priced: a rule a test."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate
from random import Random

import pytest

from robochoc.communication.simulator.schedule import RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.problem import Team, Value
from robochoc.protocols.optimization import sfb_bounds
from robochoc.protocols.optimization.run_lengths import RunLengths
from robochoc.protocols.optimization.sfb import SFB, Explored
from robochoc.protocols.optimization.sfb_bounds import BOUND, COST, VALUES, ForwardBounds
from robochoc.protocols.order import PriorityOrder
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.pseudo_trees import priced
from tests.support.sfb_robots import CHAIN, cpas, grouped, introduced, rows, team
from tests.support.solver_networks import compiled_by_brute_force


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


def plainly_extended(
    before: Sequence[Sequence[int]], problem: LocalProblem, domains: dict[str, Sequence[Value]], ceiling: int, most: int
) -> list[list[int]]:
    """The extensions of rows by the rules on the page, entry by entry."""
    names = list(domains)
    rank = names.index(problem.agent)
    sizes = [len(domains[name]) for name in names[rank + 1 :]]
    first = VALUES + rank + len(problem.values)
    found = []
    for row in before:
        for value, cost in enumerate(row[VALUES + rank : first]):
            vectors = [*row[first:]]
            chosen = dict(zip(names, row[VALUES : VALUES + rank], strict=False))
            for name, start in zip(names[rank + 1 :], accumulate([0, *sizes]), strict=False):
                known = {other: domains[other] for other in [*names[:rank], name]}
                for table in problem.tables(known, lowest=name):
                    at, charges = tuple(chosen[other] for other in table.agents[:-1]), table.joined()
                    for place in range(len(domains[name])):
                        vectors[start + place] += int(min(charges[(*at, place, value)], ceiling))
            vectors = [min(entry, ceiling) for entry in vectors]
            paid = row[COST] + cost
            ends = [*accumulate(sizes)]
            bound = paid + sum(min(vectors[end - size : end]) for size, end in zip(sizes, ends, strict=True))
            if bound < most:
                found.append([bound, paid, *row[VALUES : VALUES + rank], value, *vectors])
    return sorted(found, key=lambda row: (row[BOUND], sum(row[VALUES + rank + 1 :])))


@count("teams", 40, 3000)
def test_rows_are_those_of_a_plain_computation(monkeypatch: pytest.MonkeyPatch, teams: int) -> None:
    monkeypatch.setattr(sfb_bounds, "FEW_COLUMNS", 0)
    monkeypatch.setattr(sfb_bounds, "MANY_COLUMNS", 2)
    chance = Random("plain rows")
    partly = entirely = 0
    for seed in range(teams):
        few = random_csp(chance.randrange(4, 12), 3, chance.uniform(0.1, 0.6), 0.1, seed=seed, max_cost=9)
        made: Team = chance.choice((few, random_cost_team(chance)))
        parts = agent_problems(compiled_by_brute_force(made), shared_scopes=True)
        order = PriorityOrder(made.order)
        problems = [LocalProblem(parts[name]) for name in order.names]
        domains: dict[str, Sequence[Value]] = {robot.agent: robot.values for robot in problems}
        if not all(domains.values()):
            continue
        known = RunLengths(*grouped([robot.values for robot in problems]))
        bounds = [ForwardBounds(robot, order, known) for robot in problems]
        charges = [robot.costs({}) for robot in problems]
        ceiling = 1 + sum(one.most for one in bounds)
        ceiling += sum(int(max((cost for cost in one if cost < math.inf), default=0)) for one in charges)
        for one in bounds:
            one.count_up_to(ceiling)
        most = chance.randrange(ceiling // 2, ceiling + 1)
        several = bounds[0].below(bounds[0].nothing(charges), most)
        for one, robot in zip(bounds[:-1], problems, strict=False):
            if not len(several):
                break
            wanted = plainly_extended(several.tolist(), robot, domains, ceiling, most)
            extended = one.extended(several, most)
            assert extended.tolist() == wanted
            partly += not one._all  # noqa: SLF001 - both ways of computing must occur
            entirely += one._all  # noqa: SLF001 - as above
            several = extended[: chance.randrange(1, 30)]
    assert partly > teams
    assert entirely > teams
