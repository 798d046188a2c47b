"""One test per rule of CoCoA (van Leeuwen, Pawelczak, AAAI 2017), named for it."""

from __future__ import annotations

import doctest
from itertools import pairwise
from random import Random

import pytest

import robochoc.protocols.local_search.cocoa
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Decided, Sent
from robochoc.model.message import Value
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.cocoa import CoCoA, State
from robochoc.protocols.local_search.messages.cocoa import Costs, Hold, Inquiry, SetValue
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import replies, value
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, domains_of, robot_of, started
from tests.support.problems import team_of

SOFT = Relation("S", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (4, 1, 2, 7))
TWO: list[Value] = [(1,), (2,)]


def chain(*, names: str = "ABC") -> Team:
    """Each with the next, and B in the middle."""
    return team_of(dict.fromkeys(names, (1, 2)), [Constraint("C", SOFT, pair, pair) for pair in pairwise(names)])


def idle(name: str, *chances: float, team: Team | None = None) -> CoCoA:
    robot = robot_of(CoCoA, team or chain(), name, *chances)
    started(robot)
    return robot


def active(*chances: float) -> CoCoA:
    """B, active because A has taken the value 1."""
    robot = idle("RB", *chances)
    replies(robot, ("RA", SetValue((1,))))
    assert robot.state is State.ACTIVE
    return robot


def test_who_has_the_highest_priority_among_its_neighbours_begins_and_asks_them() -> None:
    assert started(robot_of(CoCoA, chain(), "RA")) == [("RB", Inquiry(TWO, {}))]
    assert started(robot_of(CoCoA, chain(), "RB")) == []
    assert started(robot_of(CoCoA, chain(), "RC")) == []


def test_a_neighbour_answers_with_the_least_cost_of_each_value() -> None:
    assert replies(idle("RB"), ("RA", Inquiry(TWO, {}))) == [("RA", Costs([(0, 1), (0, 2)]))]


def test_an_answer_counts_what_is_known_of_others() -> None:
    """B's 1 would cost 4 with C's 1, and its 2 would cost 2."""
    asked = ("RA", Inquiry(TWO, {"RC": (1,), "RZ": (9,)}))
    assert replies(idle("RB"), asked) == [("RA", Costs([(0, 3), (0, 6)]))]


def test_who_is_done_answers_for_its_value() -> None:
    robot = active()
    replies(robot, ("RC", Costs([(0, 0), (0, 4)])))
    assert value(robot) == (1,)
    assert replies(robot, ("RC", Inquiry(TWO, {}))) == [("RC", Costs([(0, 8), (0, 5)]))]


@pytest.mark.parametrize("news", [SetValue((1,)), Hold()])
def test_an_idle_robot_becomes_active_when_a_neighbour_has_chosen_or_waits(news: SetValue | Hold) -> None:
    robot = idle("RB")
    said = replies(robot, ("RA", news))
    assert robot.state is State.ACTIVE
    assert ("RC", Inquiry(TWO, {"RA": (1,)} if isinstance(news, SetValue) else {})) in said


def test_an_idle_robot_stays_idle_while_a_neighbour_only_asks() -> None:
    robot = idle("RB")
    replies(robot, ("RA", Inquiry(TWO, {})))
    assert robot.state is State.IDLE


def test_who_is_done_is_not_asked() -> None:
    robot = idle("RB")
    assert replies(robot, ("RA", SetValue((1,)))) == [("RC", Inquiry(TWO, {"RA": (1,)}))]


def test_when_all_have_answered_the_value_with_the_least_sum_is_taken_and_told() -> None:
    """1 costs 4 with A's 1, and 2 costs 1; C would charge 3 more for 2."""
    assert replies(active(), ("RC", Costs([(0, 0), (0, 2)]))) == [("RC", SetValue((2,)))]
    assert replies(active(), ("RC", Costs([(0, 0), (0, 4)]))) == [("RC", SetValue((1,)))]


def test_a_broken_constraint_weighs_more_than_any_cost() -> None:
    assert replies(active(), ("RC", Costs([(0, 99), (1, 0)]))) == [("RC", SetValue((1,)))]


def test_too_many_equally_good_values_are_a_reason_to_wait() -> None:
    robot = active()
    assert replies(robot, ("RC", Costs([(0, 0), (0, 3)]))) == [("RC", Hold())]
    assert (robot.state, value(robot)) == (State.HOLD, None)


def test_who_waits_asks_again_when_a_neighbour_has_chosen() -> None:
    robot = idle("RB")
    replies(robot, ("RA", Hold()))
    assert replies(robot, ("RA", Costs([(0, 0), (0, 0)])), ("RC", Costs([(0, 0), (0, 0)])))[-1] == ("RC", Hold())
    assert replies(robot, ("RA", SetValue((1,)))) == [("RC", Inquiry(TWO, {"RA": (1,)}))]
    assert robot.bound == 1


def test_who_waits_accepts_more_equally_good_values_when_nobody_around_goes_on() -> None:
    robot = active(0.9)
    replies(robot, ("RC", Costs([(0, 0), (0, 3)])))
    assert replies(robot, ("RC", Hold())) == [("RC", Inquiry(TWO, {"RA": (1,)}))]
    assert robot.bound == 2
    assert replies(robot, ("RC", Costs([(0, 0), (0, 3)]))) == [("RC", SetValue((2,)))]


def test_who_waits_does_not_go_on_while_a_neighbour_is_active_or_idle() -> None:
    robot = active()
    replies(robot, ("RC", Costs([(0, 0), (0, 3)])))
    replies(robot, ("RC", Inquiry(TWO, {})))
    assert (robot.state, robot.bound) == (State.HOLD, 1)


def test_an_answer_of_one_that_has_chosen_meanwhile_is_not_used() -> None:
    """By C's answer 1 would be best; with its value 1, the own 1 costs 4 and the own 2 costs 2."""
    robot = active()
    replies(robot, ("RC", SetValue((1,))), ("RC", Costs([(0, 0), (0, 99)])))
    assert value(robot) == (2,)


def test_when_all_others_have_chosen_one_of_the_best_values_is_drawn() -> None:
    equal = Relation("E", 2, Semantics.SOFT, ((1, 1),), (1,), 0)
    team = team_of(dict.fromkeys("AB", (1, 2, 3)), [Constraint("C", equal, ("A", "B"), ("A", "B"))])
    robot = idle("RB", 0.9, team=team)
    assert replies(robot, ("RA", SetValue((1,)))) == []
    assert (robot.bound, value(robot)) == (1, (3,))


def test_an_n_ary_constraint_counts_once_when_all_but_two_have_values() -> None:
    rows = Relation("T", 3, Semantics.SOFT, ((1, 1, 1),), (5,), 1)
    scope = ("A", "B", "C")
    team = team_of(dict.fromkeys("ABC", (1, 2)), [Constraint("T", rows, scope, scope)])
    assert replies(idle("RB", team=team), ("RA", Inquiry(TWO, {}))) == [("RA", Costs([(0, 0), (0, 0)]))]
    robot = idle("RB", team=team)
    replies(robot, ("RA", SetValue((1,))))
    assert robot.state is State.ACTIVE
    asked = ("RC", Inquiry(TWO, {"RA": (1,)}))
    assert replies(robot, asked) == [("RC", Costs([(0, 1), (0, 1)]))]


@pytest.mark.parametrize(
    ("sender", "message"),
    [("RC", Costs([(0, 0)])), ("RA", Costs([(0, 0), (0, 0)])), ("RZ", Hold()), ("RZ", SetValue((1,)))],
)
def test_what_cannot_be_is_refused(sender: str, message: Costs | Hold | SetValue) -> None:
    with pytest.raises(ValueError, match=r"has not asked for|is no neighbour"):
        replies(active(), (sender, message))


def test_nobody_answers_twice() -> None:
    robot = idle("RB")
    replies(robot, ("RA", Hold()))
    replies(robot, ("RA", Costs([(0, 0), (0, 0)])))
    with pytest.raises(ValueError, match="RA tells costs that RB has not asked for"):
        replies(robot, ("RA", Costs([(0, 0), (0, 0)])))


def test_a_robot_alone_takes_its_cheapest_value() -> None:
    prices = Relation("P", 1, Semantics.SOFT, ((1,), (2,), (3,)), (4, 0, 2))
    robot = idle("RA", team=team_of({"A": (1, 2, 3)}, [Constraint("P", prices, ("A",), ("A",))]))
    assert robot.assignment == {"A": 2}


def test_a_robot_with_an_empty_domain_ends_the_search() -> None:
    team = team_of({"A": (1,), "B": ()}, [Constraint("C", SOFT, ("A", "B"), ("A", "B"))])
    assert idle("RB", team=team).verdict is Verdict.NO_SOLUTION


@count("teams", 100, 3000)
def test_it_always_ends_and_each_robot_takes_one_value(teams: int) -> None:
    chance = Random("cocoa")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if not all(domains_of(team).values()):
            continue
        events: list[AnyEvent] = []
        run = Simulation(
            team, CoCoA, any_schedule(chance), observer=events.append, parameters=RunParameters(seed)
        ).search()
        assert run.verdict is Verdict.SOLUTION
        assert all(run.assignments.values())
        decided = [event.robot for event in events if isinstance(event, Decided)]
        assert sorted(decided) == sorted(team.order)
        assert_few_messages(team, events)


def assert_few_messages(team: Team, events: list[AnyEvent]) -> None:
    domains = domains_of(team)
    for robot in team.robots:
        kinds = [event.type for event in events if isinstance(event, Sent) and event.sender == robot.name]
        neighbours = len(robot_of(CoCoA, team, robot.name).problem.neighbours)
        activations = neighbours + len(domains[robot.variables[0].name])
        assert len(kinds) - kinds.count("Costs") <= 2 * neighbours * activations
        assert kinds.count("Inquiry") <= neighbours * activations


def test_the_example_in_the_documentation() -> None:
    assert doctest.testmod(robochoc.protocols.local_search.cocoa).failed == 0
