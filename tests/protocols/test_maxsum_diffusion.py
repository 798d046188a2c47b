"""One test for each rule of max-sum diffusion (Werner, TPAMI 29(7), 2007), and tests of its lower bound."""

from __future__ import annotations

import itertools
import math
from random import Random

import pytest

from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.maxsum import MaxSum, MaxSumSettings, R
from robochoc.protocols.inference.maxsum_diffusion import STEPS, divided, rounded, share_of_bound
from robochoc.protocols.shared.cycles import Domain
from robochoc.run import Options, Runtime, solve
from robochoc.run.incumbent import lower_bound
from tests.support.agents import replies, robot_of, started
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team, random_tree, with_costs
from tests.support.examples import are_the_same, count, drawn
from tests.support.local_search_runs import any_schedule, domains_of, played
from tests.support.problems import team_of

COSTS = Relation("C", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (3, 1, 4, 6))
CHAIN = team_of(
    dict.fromkeys("ABC", (1, 2)),
    [Constraint("F", COSTS, ("A", "B"), ("A", "B")), Constraint("S", COSTS, ("B", "C"), ("B", "C"))],
)


def shares(result: SearchResult) -> list[float]:
    return [found.share for found in result.findings.values() if found.share is not None]


def test_variable_and_functions_have_equal_costs_afterwards() -> None:
    costs, r = [0.0, 3.0], [[3.0, 1.0], [4.0, 2.0]]
    z = [7.0, 6.0]
    q = divided(r, z)
    assert [[cost + moved for cost, moved in zip(*rows, strict=True)] for rows in zip(r, q, strict=True)] == [
        pytest.approx([7 / 3, 2])
    ] * 2
    assert [cost - sum(row[place] for row in q) for place, cost in enumerate(costs)] == pytest.approx([7 / 3, 2])


def test_a_value_that_is_impossible_stays_so() -> None:
    assert divided([[INFINITE, 2.0], [4.0, 1.0]], [INFINITE, 3.0]) == [[INFINITE, -1.0], [INFINITE, 0.0]]
    assert rounded([INFINITE, 2 / 3]) == [INFINITE, round(2 / 3 * STEPS) / STEPS]


def test_q_of_the_middle_of_a_chain() -> None:
    """B has R [3, 1] from its function with A, and [1, 4] from C: z is [4, 5], and its third is [4/3, 5/3]."""
    robot = robot_of(MaxSum, CHAIN, "RB")
    robot.settings = MaxSumSettings(preference=0, damping=0.5, diffusion="yes")  # type: ignore[misc]
    started(robot)
    replies(robot, ("RA", Domain([(1,), (2,)])))
    ((name, message),) = replies(robot, ("RC", R([[1, 4]])))
    assert (name, message.rows) == ("RC", [rounded([4 / 3, 0.0])])  # type: ignore[attr-defined]
    assert robot.edges == [rounded([0.0, 7 / 6]), rounded([4 / 3, 0.0])]  # half of [0, 7/3] and of [8/3, 0]


def test_the_share_is_the_least_cost_of_the_variable_and_its_own_functions() -> None:
    q, r = [[0.0, 2.0], [1.0, 0.0]], [[3.0, 2.0]]
    assert share_of_bound([4.0, 6.0], q, r) == min(4 - 1, 6 - 2) + min(3 + 0, 2 + 2)
    assert share_of_bound([4.0, 6.0], [[0.0, INFINITE]], []) == 4
    assert share_of_bound([4.0, 6.0], [[INFINITE, INFINITE]], []) is None
    assert share_of_bound([4.0, 2.0**40], q, r) is None
    assert share_of_bound([4.0, 6.0], [], []) == 4


def test_shares_are_summed_if_all_robots_have_one() -> None:
    assert lower_bound({"A": Findings(share=3.25), "B": Findings(share=-1.0)}) == 3
    assert lower_bound({"A": Findings(share=-3.25), "B": Findings(share=1.0)}) == 0
    assert lower_bound({"A": Findings(share=3.25), "B": Findings()}) is None


def test_the_bound_does_not_fall_from_cycle_to_cycle() -> None:
    chance = drawn("diffusion rises")
    for arity, damping in [(2, 0.5)] * 8 + [(3, 0.7)] * 8:
        team = of_functions(chance, arity)
        bounds = [
            math.fsum(
                shares(
                    played(team, MaxSum, Concurrent(0), diffusion="yes", preference=0, cycles=cycles, damping=damping)
                )
            )
            for cycles in (1, 2, 3, 4, 6, 9, 15)
        ]
        assert all(after > before - 0.01 for before, after in itertools.pairwise(bounds)), bounds


def of_functions(chance: Random, arity: int) -> Team:
    """Return a random team in which each constraint is over `arity` robots."""
    domains = {f"X{number}": range(1, chance.randint(3, 4)) for number in range(5)}
    constraints = []
    for number in range(6):
        scope = tuple(chance.sample(list(domains), arity))
        rows = tuple(itertools.product(*(domains[name] for name in scope)))
        costs = tuple(chance.randint(0, 20) for _ in rows)
        constraints.append(Constraint(f"C{number}", Relation("R", arity, Semantics.SOFT, rows, costs), scope, scope))
    return team_of(domains, constraints)


@count("teams", 60, 2000)
def test_the_bound_is_never_above_the_optimum(teams: int) -> None:
    """Also if messages are lost."""
    chance, met, lossy = drawn("diffusion"), 0, 0
    for seed in range(teams):
        team = random_cost_team(chance)
        if not all(domains_of(team).values()):
            continue
        least, loss = least_cost(team), chance.choice((0, 0, 0.05))
        settings = {"diffusion": "yes", "damping": chance.choice(("0", "0.3", "0.5", "0.9"))}
        settings["cycles"] = chance.choice(("1", "5", "30"))
        options = Options(protocol="maxsum", runtime=Runtime.SIMULATOR, seed=seed, settings=settings, message_loss=loss)
        outcome = solve(team, options)
        if outcome.verdict is Verdict.NO_SOLUTION:
            assert least == INFINITE
            continue
        assert outcome.bound is None or outcome.bound <= least
        assert outcome.verdict is not Verdict.OPTIMAL or outcome.cost == least
        met += outcome.verdict is Verdict.OPTIMAL
        lossy += outcome.metrics.lost_messages > 0
    assert (met > teams // 10 and lossy > teams // 10) or not are_the_same()


def test_trees_are_solved_with_a_proof() -> None:
    chance, proven = Random("diffusion on trees"), 0
    for seed in range(20):
        team = with_costs(random_tree(chance))
        options = Options(protocol="maxsum", runtime=Runtime.SIMULATOR, seed=seed, settings={"diffusion": "yes"})
        outcome = solve(team, options)
        least = least_cost(team)
        proven += outcome.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL)
    assert proven == 20


def test_the_schedule_does_not_change_the_bound() -> None:
    chance = drawn("diffusion schedules")
    for seed in range(4):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            one, two = (played(team, MaxSum, any_schedule(chance), seed, diffusion="yes", cycles=6) for _ in "ab")
            assert shares(one) == shares(two)


def test_robots_without_neighbours_have_a_share() -> None:
    alone = Relation("U", 1, Semantics.SOFT, ((1,), (2,)), (7, 5))
    team = with_costs(team_of({"A": (1, 2)}, [Constraint("F", alone, ("A",), ("A",))]))
    options = Options(protocol="maxsum", runtime=Runtime.SIMULATOR, settings={"diffusion": "yes"})
    outcome = solve(team, options)
    assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, 5)


def test_other_variants_are_refused() -> None:
    for other in ({"split": 0.5}, {"reweight": 0.5}):
        with pytest.raises(ValueError, match="diffusion cannot be combined with split or reweight"):
            MaxSumSettings(diffusion="yes", **other)  # type: ignore[arg-type]
