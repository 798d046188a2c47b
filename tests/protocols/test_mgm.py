"""One test per rule of MGM (Maheswaran, Pearce, Tambe, PDCS 2004), named for it."""

from __future__ import annotations

from random import Random

from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.mgm import MGM, Gain
from robochoc.protocols.shared.cycles import Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cases import looped
from tests.support.cost_problems import random_cost_team, random_hard_team
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

HARD = Relation("H", 2, Semantics.CONFLICTS, ((1, 1),))
SOFT = Relation("S", 2, Semantics.SOFT, ((1, 1), (2, 2), (3, 3)), (5, 1, 1), 0)


def star() -> Team:
    """B in the middle."""
    pairs = (("A", "B"), ("B", "C"))
    return team_of(dict.fromkeys("ABC", (1, 2, 3)), [Constraint("C", SOFT, pair, pair) for pair in pairs])


def middle(*chances: float) -> MGM:
    """B, which begins with the value 1."""
    robot = robot_of(MGM, star(), "RB", 0.0, *chances)
    started(robot)
    return robot


def informed(*chances: float) -> MGM:
    """B, which has heard that its neighbours have the value 1 too."""
    robot = middle(*chances)
    assert replies(robot, ("RA", Value((1,)))) == []
    assert replies(robot, ("RC", Value((1,)))) == [("RA", Gain(0, 10)), ("RC", Gain(0, 10))], "of the best move"
    return robot


def test_the_first_value_is_drawn_by_lot_and_told() -> None:
    assert started(robot_of(MGM, star(), "RB", 0.99)) == [("RA", Value((3,))), ("RC", Value((3,)))]


def test_who_gains_most_moves_who_does_not_stays_and_both_tell_their_value() -> None:
    for chance, rival, own in ((0.9, 9, 3), (0.0, 11, 1)):
        said = replies(informed(chance), ("RA", Gain(0, 5)), ("RC", Gain(0, rival)))
        assert said == [("RA", Value((own,))), ("RC", Value((own,)))]


@looped(("left", "right", "moves"), [(10, 0, False), (0, 10, True)])
def test_of_equal_gains_the_first_in_the_order_moves(left: int, right: int, moves: bool) -> None:  # noqa: FBT001
    robot = informed()
    replies(robot, ("RA", Gain(0, left)), ("RC", Gain(0, right)))
    assert value(robot) == ((2,) if moves else (1,))


def test_who_gains_nothing_stays_though_nobody_gains_more() -> None:
    robot = middle()
    assert replies(robot, ("RA", Value((2,))), ("RC", Value((2,)))) == [("RA", Gain(0, 0)), ("RC", Gain(0, 0))]
    replies(robot, ("RA", Gain(0, 0)), ("RC", Gain(0, 0)))
    assert value(robot) == (1,)


def test_a_broken_constraint_weighs_more_than_any_cost() -> None:
    constraints = [Constraint("H", HARD, ("A", "B"), ("A", "B")), Constraint("C", SOFT, ("B", "C"), ("B", "C"))]
    robot = robot_of(MGM, team_of(dict.fromkeys("ABC", (1, 2)), constraints), "RB", 0.0)
    started(robot)
    packet = [("RA", Value((1,))), ("RC", Value((2,)))]
    assert replies(robot, *packet) == [("RA", Gain(1, -1)), ("RC", Gain(1, -1))]
    replies(robot, ("RA", Gain(0, 99)), ("RC", Gain(0, 99)))
    assert value(robot) == (2,)


@count("teams", 30, 200)
def test_the_cost_never_rises_and_the_end_is_a_local_optimum(teams: int) -> None:
    chance = Random("mgm")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            course = assignments_by_cycle(team, played(team, MGM, any_schedule(chance), seed, cycles=30))
            assert never_rises([cost_of_assignment(team, values) for values in course])
            assert is_optimal(team, course[-1], together=1)
