"""One test per rule of LAMDLS-2 (Rachmut, Zivan, Yeoh, CP 2024, and their simulator), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.lamdls2 import LAMDLS2, NumberedColour
from robochoc.protocols.local_search.mgm2 import Accept, Gains, Offer
from robochoc.protocols.shared.cycles import Domain, Value
from tests.support.agents import replies, robot_of, started, value
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count, drawn
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

ROWS = ((1, 1), (1, 2), (2, 1), (2, 2))
EITHER = Relation("E", 2, Semantics.SOFT, ROWS, (3, 5, 5, 0))
"""A robot alone never leaves the pair of ones, and two robots together do."""
TWO = Domain([(1,), (2,)])


def path() -> Team:
    """A - B - C - D, with B and D linked as well."""
    pairs = (("A", "B"), ("B", "C"), ("C", "D"), ("B", "D"))
    return team_of(dict.fromkeys("ABCD", (1, 2)), [Constraint("C", EITHER, pair, pair) for pair in pairs])


def begun(name: str) -> LAMDLS2:
    """A robot with the value 1, whose neighbours have the value 1, too: it has told its domain and value."""
    robot = robot_of(LAMDLS2, path(), name)
    neighbours = robot.problem.neighbours
    assert started(robot) == [(one, TWO) for one in neighbours]
    assert replies(robot, *[(one, TWO) for one in neighbours]) == [(one, Value((1,))) for one in neighbours]
    return robot


def coloured(name: str, **colours: int) -> LAMDLS2:
    """The same after the first colouring."""
    robot = begun(name)
    replies(robot, *[(one, Value((1,))) for one in robot.problem.neighbours])
    for one, colour in colours.items():
        robot.receive(one, NumberedColour((1,), colour, 0.5))
    robot.outbox.clear()
    return robot


def test_robots_colour_themselves_in_order_and_move_alone_as_they_do() -> None:
    """A is first, and cannot gain alone. B waits for A, takes the next colour, and gains 1 by following A."""
    first = begun("RA")
    assert replies(first, ("RB", Value((1,)))) == [("RB", NumberedColour((1,), 0, 0.0))]
    second = begun("RB")
    assert replies(second, *[(one, Value((1,))) for one in ("RA", "RC", "RD")]) == []
    told = replies(second, ("RA", NumberedColour((2,), 0, 0.3)))
    assert told == [(one, NumberedColour((2,), 1, 0.0)) for one in ("RA", "RC", "RD")]


def test_a_robot_without_smaller_colours_offers_to_the_next_colour() -> None:
    robot = coloured("RA", RB=1)
    robot.settle()
    offer = Offer([[(0, 0), (0, -2)], [(0, -2), (0, 3)]])
    assert list(robot.outbox) == [("RB", offer)]


def test_of_several_neighbours_of_the_next_colour_the_smallest_number_gets_the_offer() -> None:
    """In the first colouring, priorities are the numbers. Without a neighbour of that colour, a robot moves alone."""
    robot = coloured("RD", RB=1, RC=1)
    robot.settle()
    assert robot.colour == 0
    assert [name for name, message in robot.outbox if isinstance(message, Offer)] == ["RB"]
    alone = coloured("RA", RB=2)
    alone.settle()
    assert list(alone.outbox) == [("RB", Value((1,)))]


def middle() -> LAMDLS2:
    """B of the second colour: A and D have the first one, C the third."""
    robot = begun("RB")
    replies(robot, *[(one, Value((1,))) for one in robot.problem.neighbours], ("RA", NumberedColour((1,), 0, 0.5)))
    assert replies(robot, ("RC", NumberedColour((1,), 2, 0.1)), ("RD", NumberedColour((1,), 0, 0.7))) == []
    return robot


def test_an_offer_is_accepted_when_all_others_of_smaller_colours_have_moved_or_offered() -> None:
    """A gains 3 if both take 2; B pays 5 instead of 3 to C, but D, at 2, costs 0 instead of 5."""
    robot = middle()
    assert replies(robot, ("RA", Offer([[(0, 0), (0, -2)], [(0, -2), (0, 3)]]))) == []
    told = replies(robot, ("RD", Value((2,))))
    assert told[0] == ("RA", Accept(1, 0, 6))
    assert told[1:] == [(one, Value((2,))) for one in ("RA", "RC", "RD")]
    assert value(robot) == (2,)


def test_a_pair_that_cannot_gain_keeps_its_values() -> None:
    robot = middle()
    told = replies(robot, ("RA", Offer([[(0, 0), (0, -2)], [(0, -2), (0, -1)]])), ("RD", Value((1,))))
    assert told[0] == ("RA", Accept(0, 0, 0))
    assert value(robot) == (1,)


def test_of_several_offers_the_one_of_the_smallest_number_is_accepted() -> None:
    """D, refused, receives B's value instead of an answer."""
    robot = middle()
    gains: Gains = [[(0, 0), (0, -2)], [(0, -2), (0, 3)]]
    told = replies(robot, ("RD", Offer(gains)), ("RA", Offer(gains)))
    assert [(name, type(message)) for name, message in told] == [
        ("RA", Accept), ("RA", Value), ("RC", Value), ("RD", Value),
    ]  # fmt: skip


def test_an_offerer_makes_the_move_that_its_partner_has_chosen() -> None:
    robot = coloured("RA", RB=1)
    robot.settle()
    robot.outbox.clear()
    assert replies(robot, ("RB", Accept(1, 0, 6))) == []
    assert value(robot) == (2,)
    assert replies(robot, ("RB", Value((2,)))) == [("RB", NumberedColour((2,), 0, 0.0))]


def test_a_refused_offerer_moves_alone() -> None:
    robot = coloured("RA", RB=1)
    robot.settle()
    robot.outbox.clear()
    assert replies(robot, ("RB", Value((2,))))[0] == ("RB", Value((2,)))


def test_invalid_messages_are_refused() -> None:
    with pytest.raises(ValueError, match="RA sent an offer that does not fit"):
        replies(middle(), ("RA", Offer([[(0, 0)]])), ("RD", Value((1,))))
    robot = coloured("RA", RB=1)
    robot.settle()
    with pytest.raises(ValueError, match="RB accepted an offer with the value number 2"):
        replies(robot, ("RB", Accept(2, 0, 1)))
    with pytest.raises(ValueError, match="RB did not send its value"):
        replies(begun("RA"), ("RB", Accept(0, 0, 0)))


@pytest.mark.fresh
@count("teams", 40, 1000)
def test_the_cost_never_rises_and_no_robot_waits_for_ever(teams: int) -> None:
    """Every run reaches its last cycle."""
    chance = drawn("lamdls-2")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            cycles = chance.choice((1, 2, 3, 12))
            course = assignments_by_cycle(team, played(team, LAMDLS2, any_schedule(chance), seed, cycles=cycles))
            assert len(course) == cycles + 1
            assert never_rises([cost_of_assignment(team, one) for one in course])


@count("teams", 8, 100)
def test_it_ends_in_a_2_optimum(teams: int) -> None:
    chance = Random("2-optimum")
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            end = assignments_by_cycle(team, played(team, LAMDLS2, Concurrent(0), seed, cycles=200))[-1]
            assert is_optimal(team, end, 1)
            assert is_optimal(team, end, 2)


@count("teams", 10, 100)
def test_delays_do_not_change_the_course(teams: int) -> None:
    chance = Random("delays")
    for seed in range(teams):
        team = random_cost_team(chance)
        if all(domains_of(team).values()):
            courses = [
                assignments_by_cycle(team, played(team, LAMDLS2, schedule, seed, cycles=10))
                for schedule in (Concurrent(0), any_schedule(chance))
            ]
            assert courses[0] == courses[1]
