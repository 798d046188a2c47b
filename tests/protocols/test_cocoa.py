"""One test per rule of CoCoA (van Leeuwen, Pawelczak, AAAI 2017), named for it."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from random import Random

from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import AnyEvent, Decided, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.local_search.cocoa import CoCoA, Costs, CostsAt, FinalSide, Hold, Inquiry, SearchState, SetValue
from robochoc.protocols.message import Value
from robochoc.solver.agent_problem import RunParameters
from tests.support.agents import after, assert_refused, replies, robot_of, started, started_robot, value
from tests.support.asymmetric_problems import divided_pair as divided
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.cost_problems import random_cost_team, random_hard_team
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, domains_of
from tests.support.problems import team_of

SOFT = Relation("S", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), (4, 1, 2, 7))
TWO: list[Value] = [(1,), (2,)]


def chain(*, names: str = "ABC") -> Team:
    """Each with the next, and B in the middle."""
    return team_of(dict.fromkeys(names, (1, 2)), [Constraint("C", SOFT, pair, pair) for pair in pairwise(names)])


def idle(name: str, *chances: float, team: Team | None = None) -> CoCoA:
    return started_robot(CoCoA, team or chain(), name, chances=chances)


def active(*chances: float) -> CoCoA:
    """B, active because A has taken the value 1."""
    robot = after(idle("RB", *chances), ("RA", SetValue((1,))))
    assert robot.state is SearchState.ACTIVE
    return robot


def test_who_has_the_highest_priority_among_its_neighbours_begins_and_asks_them() -> None:
    assert started(robot_of(CoCoA, chain(), "RA")) == [("RB", Inquiry(TWO, {}))]
    assert started(robot_of(CoCoA, chain(), "RB")) == []
    assert started(robot_of(CoCoA, chain(), "RC")) == []


def test_a_neighbour_answers_with_the_least_cost_of_each_value_and_counts_what_is_known_of_others() -> None:
    """B's 1 would cost 4 with C's 1, and its 2 would cost 2."""
    assert replies(idle("RB"), ("RA", Inquiry(TWO, {}))) == [("RA", Costs([(0, 1), (0, 2)]))]
    asked = ("RA", Inquiry(TWO, {"RC": (1,), "RZ": (9,)}))
    assert replies(idle("RB"), asked) == [("RA", Costs([(0, 3), (0, 6)]))]


def test_who_is_done_answers_for_its_value() -> None:
    robot = after(active(), ("RC", Costs([(0, 0), (0, 4)])))
    assert value(robot) == (1,)
    assert replies(robot, ("RC", Inquiry(TWO, {}))) == [("RC", Costs([(0, 8), (0, 5)]))]


def test_an_idle_robot_becomes_active_when_a_neighbour_has_chosen_or_waits_and_asks_those_that_have_not() -> None:
    both = [("RA", Inquiry(TWO, {})), ("RC", Inquiry(TWO, {}))]
    for news, asked in ((SetValue((1,)), [("RC", Inquiry(TWO, {"RA": (1,)}))]), (Hold(), both)):
        robot = after(idle("RB"), ("RA", Inquiry(TWO, {})))
        states = [robot.state]
        assert replies(robot, ("RA", news)) == asked
        assert [*states, robot.state] == [SearchState.IDLE, SearchState.ACTIVE]


def test_when_all_have_answered_the_value_with_the_least_sum_is_taken_and_told() -> None:
    """1 costs 4 with A's 1, and 2 costs 1; C would charge 3 more for 2."""
    for first, second, taken in (((0, 0), (0, 2), 2), ((0, 0), (0, 4), 1), ((0, 99), (1, 0), 1)):
        assert replies(active(), ("RC", Costs([first, second]))) == [("RC", SetValue((taken,)))]
    robot = active()
    assert replies(robot, ("RC", Costs([(0, 0), (0, 3)]))) == [("RC", Hold())], "too many are equally good"
    assert (robot.state, value(robot)) == (SearchState.HOLD, None)


def test_who_waits_asks_again_when_a_neighbour_has_chosen() -> None:
    robot = after(idle("RB"), ("RA", Hold()))
    assert replies(robot, ("RA", Costs([(0, 0), (0, 0)])), ("RC", Costs([(0, 0), (0, 0)])))[-1] == ("RC", Hold())
    assert replies(robot, ("RA", SetValue((1,)))) == [("RC", Inquiry(TWO, {"RA": (1,)}))]
    assert robot.bound == 1


def test_who_waits_accepts_more_equally_good_values_when_nobody_around_goes_on() -> None:
    robot = after(active(0.9), ("RC", Costs([(0, 0), (0, 3)])))
    replies(robot, ("RC", Inquiry(TWO, {})))
    assert (robot.state, robot.bound) == (SearchState.HOLD, 1), "a neighbour is active"
    assert replies(robot, ("RC", Hold())) == [("RC", Inquiry(TWO, {"RA": (1,)}))]
    assert robot.bound == 2
    assert replies(robot, ("RC", Costs([(0, 0), (0, 3)]))) == [("RC", SetValue((2,)))]


def test_an_answer_of_one_that_has_chosen_meanwhile_is_not_used() -> None:
    """By C's answer 1 would be best; with its value 1, the own 1 costs 4 and the own 2 costs 2."""
    robot = after(active(), ("RC", SetValue((1,))), ("RC", Costs([(0, 0), (0, 99)])))
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
    robot = after(idle("RB", team=team), ("RA", SetValue((1,))))
    assert robot.state is SearchState.ACTIVE
    asked = ("RC", Inquiry(TWO, {"RA": (1,)}))
    assert replies(robot, asked) == [("RC", Costs([(0, 1), (0, 1)]))]


def answered() -> CoCoA:
    """B, which A has answered."""
    robot = after(idle("RB"), ("RA", Hold()))
    replies(robot, ("RA", Costs([(0, 0), (0, 0)])))
    return robot


def test_what_cannot_be_is_refused() -> None:
    wrong = [("RC", Costs([(0, 0)])), ("RA", Costs([(0, 0), (0, 0)])), ("RZ", Hold()), ("RZ", SetValue((1,)))]
    assert_refused(active, wrong, "RC sent costs of 1, but RB has 2 values|without an inquiry|is not a neighbour")
    assert_refused(answered, [("RA", Costs([(0, 0), (0, 0)]))], "RA sent costs without an inquiry from RB")
    values: list[list[Value]] = [[(1,)], [(1,), (9,)], [(1,), (1, 1)]]
    sides = [CostsAt([(0, 0)], [(1,), (1,)]), *(CostsAt([(0, 0), (0, 0)], one) for one in values)]
    assert_refused(asking, [("RB", one) for one in (*sides, FinalSide([(0, 0), (0, 0)]))], "RB")


# Asymmetric costs


def asking() -> CoCoA:
    robot = robot_of(CoCoA, divided(), "RA")
    assert started(robot) == [("RB", Inquiry(TWO, {}))]
    return robot


def test_a_neighbour_with_a_part_tells_its_own_side_at_least_and_with_which_value() -> None:
    asked = ("RA", Inquiry(TWO, {}))
    assert replies(idle("RB", team=divided()), asked) == [("RA", CostsAt([(0, 0), (0, 5)], [(1,), (1,)]))]


def test_the_asker_adds_its_own_side_at_the_values_that_it_is_told() -> None:
    """By B's side alone the first value would be better: (1, 1) costs A 3, and (2, 1) nothing."""
    for dearer, with_first, taken in ((2, 1, 2), (4, 1, 1), (2, 2, 1)):
        told = CostsAt([(0, 0), (0, dearer)], [(with_first,), (1,)])
        assert replies(asking(), ("RB", told)) == [("RB", SetValue((taken,)))]


def test_who_is_done_tells_what_its_side_charges_with_its_value() -> None:
    for told, side in (
        (CostsAt([(0, 9), (0, 0)], [(1,), (1,)]), FinalSide([(0, 0), (0, 0)])),
        (CostsAt([(0, 0), (0, 9)], [(1,), (1,)]), FinalSide([(0, 3), (0, 1)])),
    ):
        robot = after(asking(), ("RB", told))
        assert replies(robot, ("RB", Inquiry(TWO, {}))) == [("RB", side)]


def test_a_neighbour_with_a_part_that_is_done_is_asked_and_its_side_counts() -> None:
    """With A's 2, B's own 1 costs it 5, and 2 costs 9: not if A pays 7 for 1.

    A neighbour that answered before it took its value is asked again at once.
    """
    for has_answered, side, own in ((False, 7, 2), (True, 0, 1)):
        robot = idle("RB", team=divided())
        if has_answered:
            replies(robot, ("RA", Hold()))
            robot.receive("RA", CostsAt([(0, 1), (0, 1)], [(1,), (2,)]))
        assert replies(robot, ("RA", SetValue((2,)))) == [("RA", Inquiry(TWO, {"RA": (2,)}))]
        assert value(robot) is None
        replies(robot, ("RA", FinalSide([(0, side), (0, 0)])))
        assert value(robot) == (own,)


def kinds_sent(team: Team, chance: Random, seed: int) -> dict[str, list[str]]:
    """Return the types of the messages that each robot sends in a run, at the end of which all have a value."""
    events: list[AnyEvent] = []
    simulation = Simulation(
        team, CoCoA, any_schedule(chance), observer=events.append, parameters=RunParameters(seed)
    ).search()
    assert simulation.verdict is Verdict.SOLUTION
    assert all(simulation.assignments.values())
    decided = [event.robot for event in events if isinstance(event, Decided)]
    assert sorted(decided) == sorted(team.order), "each takes one value"
    sent = [event for event in events if isinstance(event, Sent)]
    return {name: [event.type for event in sent if event.sender == name] for name in team.order}


def bounds(team: Team) -> Iterator[tuple[str, int, int]]:
    """Yield for each robot its neighbours, and how often it may become active."""
    domains = domains_of(team)
    for robot in team.robots:
        neighbours = len(robot_of(CoCoA, team, robot.name).problem.neighbours)
        yield robot.name, neighbours, neighbours + len(domains[robot.variables[0].name])


@count("teams", 10, 1000)
def test_with_asymmetric_costs_it_ends_with_at_most_one_question_more_for_each_neighbour(teams: int) -> None:
    chance = Random("divided cocoa")
    told = 0
    for seed in range(teams):
        team = random_asymmetric_team(chance, simple=True)
        if all(domains_of(team).values()):
            sent = kinds_sent(team, chance, seed)
            for name, neighbours, activations in bounds(team):
                assert sent[name].count("Inquiry") <= neighbours * (activations + 1)
                told += sent[name].count("FinalSide")
    assert told


@count("teams", 60, 3000)
def test_it_always_ends_and_each_robot_takes_one_value(teams: int) -> None:
    chance = Random("cocoa")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            sent = kinds_sent(team, chance, seed)
            for name, neighbours, activations in bounds(team):
                assert len(sent[name]) - sent[name].count("Costs") <= 2 * neighbours * activations
                assert sent[name].count("Inquiry") <= neighbours * activations
