"""One test per rule of AAS (Silaghi, Sam-Haroud and Faltings 2000), named for it."""

from __future__ import annotations

import itertools
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, Relation, Semantics, Team
from robochoc.protocols.message import Message
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.aas import (
    AAS,
    AASSettings,
    AddLink,
    AggregateStore,
    Narrow,
    Nogood,
    Ok,
    covers,
    matching,
    met,
)
from robochoc.run import Runtime, solve
from tests.support.agents import replies, started_robot, value
from tests.support.examples import count
from tests.support.problems import random_team, team_of
from tests.support.random_options import random_schedule
from tests.support.small_teams import differ, different, triangle
from tests.support.spent import spent


def agent(team: Team, name: str, *packet: tuple[str, Message], largest: int = 4) -> AAS:
    kind = type("Limited", (AAS,), {"settings": AASSettings(largest)})
    return started_robot(kind, team, name, *packet)


def ok(*values: int) -> Ok:
    """An aggregate of a robot of one variable."""
    return Ok(tuple((one,) for one in values))


def aggregate(robot: AAS) -> list[int | None]:
    """The values that a robot of one variable proposes."""
    return [robot.problem.values[index][0] for index in robot.aggregate]


def test_a_robot_proposes_all_values_that_go_with_every_combination_up_to_the_largest_aggregate() -> None:
    for largest, proposed in ((4, ok(2, 3)), (1, ok(2))):
        robot = agent(triangle(3), "RC", largest=largest)
        assert replies(robot, ("RA", ok(1)), ("RB", ok(1))) == [("RD", proposed)]
        assert value(robot) == (2,)


def test_what_still_goes_with_the_view_is_kept_and_sent_only_when_it_has_changed() -> None:
    robot = agent(triangle(3), "RC", ("RA", ok(1)))
    assert replies(robot, ("RB", ok(2))) == [("RD", ok(3))]
    assert replies(robot, ("RB", ok(1))) == []


def test_where_no_value_goes_with_all_of_the_view_the_largest_part_is_asked_for_and_assumed() -> None:
    robot = agent(triangle(3), "RC")
    asked = [(name, Narrow(((2,), (3,)))) for name in ("RA", "RB")]
    assert replies(robot, ("RA", ok(1, 2, 3)), ("RB", ok(1, 2, 3))) == [("RD", ok(1)), *asked]
    assert replies(robot, ("RA", ok(2, 3)), ("RB", ok(2, 3))) == []


def test_an_empty_intersection_is_a_nogood_over_whole_aggregates_to_the_lowest_robot() -> None:
    team = team_of({"A": (1, 2), "B": (1, 3), "C": (3,)}, [differ("A", "B"), differ("A", "C"), differ("B", "C")])
    assert replies(agent(team, "RC"), ("RA", ok(1, 2)), ("RB", ok(3))) == [("RB", Nogood({}, ((3,),)))]
    never = Constraint("N", Relation("N", 2, Semantics.CONFLICTS, ((1, 1), (2, 1))), ("A", "C"), ("A", "C"))
    team = team_of({"A": (1, 2, 3), "C": (1,)}, [never])
    assert replies(agent(team, "RC"), ("RA", ok(1, 2))) == [("RA", Nogood({}, ((1,), (2,))))]


def test_whoever_is_asked_proposes_less_and_keeps_the_rest_for_later() -> None:
    robot = agent(triangle(3), "RA")
    assert replies(robot, ("RC", Narrow(((2,), (3,))))) == [("RB", ok(2, 3)), ("RC", ok(2, 3))]
    assert replies(robot, ("RC", Narrow(((1,),)))) == []
    assert replies(robot, ("RB", Narrow(((2,), (3,))))) == []
    assert replies(robot, ("RC", Nogood({}, ((1,),)))) == [], "a nogood about nothing that is proposed is obsolete"
    assert robot.store.all_open() == [0, 1, 2]
    assert replies(robot, ("RC", Nogood({}, ((2,), (3,))))) == [("RB", ok(1)), ("RC", ok(1))]


def test_a_nogood_rules_out_what_it_names_and_without_a_value_left_there_is_no_solution() -> None:
    said = replies(agent(triangle(3), "RA"), ("RB", Nogood({}, ((1,),))))
    assert said == [("RB", ok(2, 3)), ("RC", ok(2, 3))], "the rest of the aggregate stays"
    robot = agent(triangle(1), "RA")
    assert replies(robot, ("RB", Nogood({}, ((1,),)))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_a_nogood_holds_as_long_as_what_others_propose_is_covered_and_is_answered_otherwise() -> None:
    robot = agent(triangle(3), "RB", ("RA", ok(1, 2)), ("RC", Nogood({"RA": ((1,), (2,))}, ((3,),))))
    for proposed, held in ((ok(2), True), (ok(2, 3), False)):
        replies(robot, ("RA", proposed))
        assert robot.store[2] == ({"RA": ((1,), (2,))} if held else None)
    replies(robot, ("RA", ok(1)))
    assert replies(robot, ("RC", Nogood({"RA": ((2,),)}, ((2,),)))) == [("RC", ok(2, 3))]
    assert robot.store[1] is None


def test_add_link_asks_unknown_robots_of_a_nogood_for_their_aggregates() -> None:
    team = different("ABC", "AC BC", 2)
    said = replies(agent(team, "RB"), ("RC", Nogood({"RA": ((1,),)}, ((1,),))))
    assert said == [("RA", AddLink()), ("RC", ok(2))]
    assert replies(agent(team, "RA"), ("RB", AddLink())) == [("RB", ok(1, 2))]


def test_of_an_n_ary_constraint_the_lowest_robot_with_a_choice_is_asked() -> None:
    table = Relation("T", 3, Semantics.CONFLICTS, ((1, 1, 1), (2, 1, 1)))
    scope = ("A", "B", "C")
    team = team_of({"A": (1, 2), "B": (1, 2), "C": (1,)}, [Constraint("T", table, scope, scope)])
    robot = agent(team, "RC")
    assert replies(robot, ("RA", ok(1, 2)), ("RB", ok(1, 2))) == [("RB", Narrow(((2,),)))]
    assert aggregate(robot) == [1]


def test_messages_and_settings_that_cannot_be_are_refused() -> None:
    wrong: list[Message] = [Ok(()), ok(1, 2, 3, 4, 5), Nogood({}, ()), Narrow(((1, 2),)), Nogood({"RA": ()}, ((1,),))]
    wrong += [Nogood({name: ((1,),)}, ((1,),)) for name in ("RC", "RX")]
    for message in wrong:
        with pytest.raises(ValueError, match=r"RA|shorter|longer"):
            agent(triangle(3), "RB").receive("RA", message)
    with pytest.raises(ValueError, match="largest is 0; it must be 1 or more"):
        AASSettings(0)


def test_aggregates_intersect_in_all_variables_that_matter_in_either() -> None:
    assert met(((1, None), (2, None)), ((None, 5),)) == ((1, 5), (2, 5))
    assert met(((1, 5), (2, 6)), ((None, 5),)) == ((1, 5),)
    assert covers(((1, None),), ((1, 2), (1, 3)))
    assert not covers(((1, None),), ((1, 2), (2, 2)))
    assert matching(((1, None),), ((1, 2), (2, 2))) == ((1, 2),)


def test_a_resolvent_in_different_variables_is_no_larger_than_the_view() -> None:
    store = AggregateStore(PriorityOrder(("RA", "RB")), 2)
    store.add(0, {"RA": ((1, None), (2, None))})
    store.add(1, {"RA": ((None, 1), (None, 2))})
    assert store.resolve({"RA": ((1, 1), (2, 2))}) == {"RA": ((1, 1), (2, 2))}


@count("teams", 12, 1500)
def test_with_aggregates_of_one_value_it_is_abt_message_by_message(teams: int) -> None:
    for seed in range(teams):
        chance = Random(seed)
        team = random_team(chance)
        options = replace(random_schedule(chance), runtime=Runtime.SIMULATOR)
        one = solve(team, replace(options, protocol="aas", settings={"largest": "1"}))
        abt = solve(team, replace(options, protocol="abt"))
        assert (one.verdict, one.assignment) == (abt.verdict, abt.assignment)
        assert (one.metrics.messages, one.metrics.ncccs) == (abt.metrics.messages, abt.metrics.ncccs)


@count("teams", 25, 2000)
def test_at_the_end_every_combination_of_the_aggregates_is_a_solution(teams: int) -> None:
    proposed = 0
    for seed in range(teams):
        team = random_team(Random(seed))
        simulation = Simulation(team, AAS, Concurrent(seed))
        if simulation.search().verdict is not Verdict.SOLUTION:
            continue
        robots = {name: host.protocol for name, host in simulation._hosts.items()}  # noqa: SLF001 - what each proposes
        sets = [robot.aggregate for robot in robots.values() if isinstance(robot, AAS)]
        proposed += any(len(one) > 1 for one in sets)
        for chosen in itertools.islice(itertools.product(*sets), 200):
            placed = list(zip(robots.values(), chosen, strict=True))
            view = {robot.problem.agent: robot.problem.values[index] for robot, index in placed}
            assert all(robot.problem.conflict(index, view) is None for robot, index in placed)
    assert proposed > teams // 8


def before(first: str, second: str, by: int, largest: int) -> Constraint:
    """Return the constraint that `second` is at least `by` after `first`; values are up to `largest`."""
    pairs = itertools.product(range(1, largest + 1), repeat=2)
    late = Relation(f"R{by}", 2, Semantics.CONFLICTS, tuple((x, y) for x, y in pairs if x + by > y))
    return Constraint(f"{first}{second}", late, (first, second), (first, second))


def jobs(chance: Random) -> Team:
    """Return eight jobs with random orders between some of them, often impossible."""
    pairs = [pair for pair in itertools.combinations("ABCDEFGH", 2) if chance.random() < 0.35]
    ways = [pair if chance.random() < 0.6 else pair[::-1] for pair in pairs]
    return team_of(dict.fromkeys("ABCDEFGH", range(1, 13)), [before(*way, chance.randint(1, 3), 12) for way in ways])


def test_aggregates_save_messages_where_constraints_are_orders_of_numbers() -> None:
    """The paper's claim, on average: single problems go either way."""
    teams = [jobs(Random(seed)) for seed in range(4)]
    assert spent(teams, "aas", largest="4").messages < 0.5 * spent(teams, "aas", largest="1").messages
