"""One test per rule of LAMDLS (Rachmut, Zivan, Yeoh, IJCAI 2022), named for it."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Decided, Sent
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.lamdls import LAMDLS, Colour
from robochoc.protocols.shared.cycles import Value
from robochoc.solver.agent_problem import RunParameters
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

SOFT = Relation("S", 2, Semantics.SOFT, ((1, 1), (2, 2), (3, 3)), (5, 1, 1), 0)


def triangle() -> Team:
    """A, B and C with each other, and D with C."""
    pairs = (("A", "B"), ("B", "C"), ("A", "C"), ("C", "D"))
    return team_of(dict.fromkeys("ABCD", (1, 2, 3)), [Constraint("C", SOFT, pair, pair) for pair in pairs])


def both(message: Value) -> list[tuple[str, Value]]:
    return [("RA", message), ("RC", message)]


def coloured(*chances: float) -> LAMDLS:
    """B, of the second colour, with the value 1: all neighbours have told their colours, and 1 as their value."""
    robot = robot_of(LAMDLS, triangle(), "RB", 0.0, *chances)
    assert started(robot) == []
    told = replies(robot, ("RA", Colour((1,), 0)))
    assert told == [("RA", Colour((1,), 1)), ("RC", Colour((1,), 1))]
    assert replies(robot, ("RC", Colour((1,), 2))) == []
    return robot


def test_who_has_no_neighbour_of_higher_priority_takes_the_first_colour_at_once() -> None:
    assert started(robot_of(LAMDLS, triangle(), "RA", 0.9)) == [("RB", Colour((3,), 0)), ("RC", Colour((3,), 0))]


@looped(("left", "right", "own"), [(0, 1, 2), (1, 2, 0), (0, 2, 1), (1, 1, 0)])
def test_the_smallest_colour_that_is_free_is_taken(left: int, right: int, own: int) -> None:
    robot = robot_of(LAMDLS, triangle(), "RC", 0.0)
    started(robot)
    assert replies(robot, ("RA", Colour((1,), left))) == []
    assert replies(robot, ("RB", Colour((1,), right)))[0] == ("RA", Colour((1,), own))


def test_a_robot_moves_when_neighbours_of_smaller_colours_have_moved() -> None:
    """Against A's new value 2, and C's first value 1."""
    assert replies(coloured(), ("RA", Value((2,)))) == both(Value((3,)))


def test_a_robot_of_the_first_colour_moves_when_all_colours_are_known() -> None:
    robot = robot_of(LAMDLS, triangle(), "RA", 0.0, 0.0)
    started(robot)
    assert replies(robot, ("RB", Colour((1,), 1))) == []
    assert replies(robot, ("RC", Colour((3,), 2))) == [("RB", Value((2,))), ("RC", Value((2,)))]


def test_the_next_step_waits_for_those_of_larger_colours_too() -> None:
    robot = coloured()
    replies(robot, ("RA", Value((2,))))
    assert replies(robot, ("RA", Value((3,)))) == []
    assert replies(robot, ("RC", Value((1,)))) == both(Value((2,)))


def test_of_several_best_values_one_is_drawn() -> None:
    robot = coloured(0.9)
    replies(robot, ("RA", Value((1,))))
    assert value(robot) == (3,)


def test_who_cannot_gain_keeps_its_value() -> None:
    robot = coloured(0.9)
    assert replies(robot, ("RA", Value((2,)))) == both(Value((3,)))
    assert replies(robot, ("RC", Value((1,))), ("RA", Value((2,)))) == both(Value((3,)))


def test_of_neighbours_with_the_same_colour_the_one_of_higher_priority_moves_first() -> None:
    """Where its colour is lost, a neighbour may choose the same one."""
    robot = robot_of(LAMDLS, triangle(), "RB", 0.0)
    started(robot)
    replies(robot, ("RA", Colour((1,), 0)), ("RC", Colour((1,), 1)))
    assert (robot.earlier, robot.later) == (("RA",), ("RC",))


def test_of_a_neighbour_whose_colour_is_lost_the_priority_decides() -> None:
    robot = robot_of(LAMDLS, triangle(), "RB", 0.0)
    started(robot)
    robot.miss("RA")
    robot.settle()
    assert robot.colour == 0
    replies(robot, ("RC", Colour((1,), 1)))
    assert (robot.earlier, robot.later) == (("RA",), ("RC",))


def test_a_value_instead_of_a_colour_is_refused() -> None:
    robot = robot_of(LAMDLS, triangle(), "RB", 0.0)
    started(robot)
    with pytest.raises(ValueError, match="RA sent no colour, which must come first"):
        replies(robot, ("RA", Value((1,))))


@count("teams", 25, 300)
def test_neighbours_never_move_at_the_same_time(teams: int) -> None:
    """Between two moves of neighbours, the second has heard of the first: so the cost falls at each move by itself."""
    chance = Random("one by one")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if not all(domains_of(team).values()):
            continue
        events: list[AnyEvent] = []
        parameters = RunParameters(seed, {"cycles": "12"})
        schedule = RandomChannels(seed)
        Simulation(team, LAMDLS, schedule, observer=events.append, parameters=parameters).search()
        now: dict[str, int] = {}
        costs = []
        for event in events:
            if isinstance(event, Decided):
                now |= event.assignment
                costs += [cost_of_assignment(team, now)] if len(now) == len(team.robots) else []
        assert never_rises(costs)


@count("teams", 25, 300)
def test_the_cost_never_rises_and_the_end_is_a_local_optimum(teams: int) -> None:
    chance = Random("lamdls")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            course = assignments_by_cycle(team, played(team, LAMDLS, any_schedule(chance), seed, cycles=30))
            assert never_rises([cost_of_assignment(team, values) for values in course])
            assert is_optimal(team, course[-1], together=1)


def test_a_cycle_takes_one_message_for_each_neighbour() -> None:
    events: list[AnyEvent] = []
    parameters = RunParameters(0, {"cycles": "10"})
    Simulation(triangle(), LAMDLS, Concurrent(0), observer=events.append, parameters=parameters).search()
    kinds = [event.type for event in events if isinstance(event, Sent)]
    assert (kinds.count("Colour"), kinds.count("Value")) == (8, 80)
