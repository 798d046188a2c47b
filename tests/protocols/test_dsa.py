"""One test per rule of DSA (Zhang, Wang, Xing, Wittenburg, AIJ 161, 2005, Section 3), named for it."""

from __future__ import annotations

from random import Random

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.dsa import DSA, DSASettings
from robochoc.protocols.shared.cycles import Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team
from tests.support.examples import count
from tests.support.local_search_runs import assignments_by_cycle, cost_of_assignment, domains_of, played
from tests.support.problems import team_of

EQUAL_COSTS = Relation("E", 2, Semantics.SOFT, ((1, 1), (2, 2), (3, 3)), (1, 1, 1), 0)
MOVES, STAYS = 0.0, 0.99


def colours(values: int = 3) -> Team:
    """A star: B in the middle pays 1 for each neighbour with its own value."""
    pairs = (("A", "B"), ("B", "C"))
    constraints = [Constraint("C", EQUAL_COSTS, pair, pair) for pair in pairs]
    return team_of(dict.fromkeys("ABC", range(1, values + 1)), constraints)


def middle(*chances: float, variant: str = "A", values: int = 3) -> DSA:
    """B, which begins with the value 1."""
    robot = robot_of(DSA, colours(values), "RB", 0.0, *chances)
    robot.settings = DSASettings(variant=variant)  # type: ignore[arg-type, misc]
    started(robot)
    return robot


def hears(robot: DSA, left: int, right: int) -> tuple[int | None, ...] | None:
    replies(robot, ("RA", Value((left,))), ("RC", Value((right,))))
    return value(robot)


@looped(("lot", "first"), [(0.0, 1), (0.4, 2), (0.99, 3)])
def test_the_first_value_is_drawn_by_lot(lot: float, first: int) -> None:
    robot = robot_of(DSA, colours(), "RA", lot)
    assert started(robot) == [("RB", Value((first,)))]


def test_the_value_is_told_in_each_cycle_also_if_it_is_the_old_one() -> None:
    robot = middle()
    for _ in range(2):
        assert replies(robot, ("RA", Value((3,))), ("RC", Value((3,)))) == [("RA", Value((1,))), ("RC", Value((1,)))]


@looped("variant", ["A", "B", "C"])
def test_who_gains_moves_with_the_probability(variant: str) -> None:
    assert hears(middle(MOVES, variant=variant), 1, 2) == (3,)
    assert hears(middle(STAYS, variant=variant), 1, 2) == (1,)


@looped("variant", ["D", "E"])
def test_who_gains_always_moves_by_variants_d_and_e(variant: str) -> None:
    assert hears(middle(STAYS, variant=variant), 1, 2) == (3,)


@looped(("variant", "as_variant"), [("D", "B"), ("E", "C")])
def test_variants_d_and_e_move_sideways_as_b_and_c(variant: str, as_variant: str) -> None:
    for chance in (MOVES, STAYS):
        for heard in ((1, 2), (2, 2)):
            one, other = middle(chance, variant=variant, values=2), middle(chance, variant=as_variant, values=2)
            assert hears(one, *heard) == hears(other, *heard)


def test_the_probability_is_not_reached_by_itself() -> None:
    assert hears(middle(0.7), 1, 2) == (1,)
    assert hears(middle(0.69), 1, 2) == (3,)


def test_of_several_best_values_one_is_drawn() -> None:
    assert hears(middle(MOVES, 0.0), 1, 1) == (2,)
    assert hears(middle(MOVES, 0.9), 1, 1) == (3,)


@looped(("variant", "moves"), [("A", False), ("B", True), ("C", True)])
def test_in_conflict_b_and_c_move_to_a_value_that_is_as_good(variant: str, moves: bool) -> None:  # noqa: FBT001
    assert hears(middle(MOVES, variant=variant, values=2), 1, 2) == ((2,) if moves else (1,))


@looped(("variant", "moves"), [("A", False), ("B", False), ("C", True)])
def test_without_conflict_only_c_moves_to_a_value_that_is_as_good(variant: str, moves: bool) -> None:  # noqa: FBT001
    assert hears(middle(MOVES, variant=variant), 2, 2) == ((3,) if moves else (1,))


@looped("variant", ["A", "B", "C"])
def test_nobody_moves_to_a_value_that_is_worse(variant: str) -> None:
    assert hears(middle(MOVES, variant=variant, values=2), 2, 2) == (1,)


def test_what_the_own_value_costs_by_itself_is_no_conflict() -> None:
    prices = Relation("P", 1, Semantics.SOFT, ((1,), (2,), (3,)), (4, 4, 4))
    constraints = [Constraint("C", EQUAL_COSTS, ("A", "B"), ("A", "B")), Constraint("P", prices, ("B",), ("B",))]
    robot = robot_of(DSA, team_of(dict.fromkeys("AB", (1, 2, 3)), constraints), "RB", 0.0, MOVES)
    started(robot)
    replies(robot, ("RA", Value((3,))))
    assert value(robot) == (1,)


def test_breaking_less_is_better_than_paying_less() -> None:
    """1 breaks a constraint and costs nothing; 2 costs 9."""
    hard = Relation("H", 2, Semantics.CONFLICTS, ((1, 1),))
    prices = Relation("P", 1, Semantics.SOFT, ((2,),), (9,))
    constraints = [Constraint("C", hard, ("A", "B"), ("A", "B")), Constraint("P", prices, ("B",), ("B",))]
    robot = robot_of(DSA, team_of(dict.fromkeys("AB", (1, 2)), constraints), "RB", 0.0, MOVES)
    started(robot)
    replies(robot, ("RA", Value((1,))))
    assert value(robot) == (2,)


def test_an_n_ary_constraint_is_weighed_by_each_robot_of_its_scope() -> None:
    rows = Relation("even", 3, Semantics.SUPPORTS, ((1, 1, 2), (1, 2, 1), (2, 1, 1)))
    scope = ("A", "B", "C")
    team = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("E", rows, scope, scope)])
    for name, others in (("RA", ("RB", "RC")), ("RB", ("RA", "RC")), ("RC", ("RA", "RB"))):
        robot = robot_of(DSA, team, name, 0.0, MOVES)
        started(robot)
        replies(robot, *((other, Value((1,))) for other in others))
        assert value(robot) == (2,)


@count("teams", 30, 120)
def test_variant_a_gets_better_on_the_whole(teams: int) -> None:
    chance = Random("better")
    better = worse = 0
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            result = played(team, DSA, Concurrent(seed), seed, cycles=20, variant="A")
            assert result.verdict is Verdict.SOLUTION
            course = assignments_by_cycle(team, result)
            first, last = cost_of_assignment(team, course[0]), cost_of_assignment(team, course[-1])
            better += last < first
            worse += last > first
    assert better > teams * 2 // 3
    assert worse < teams // 15
