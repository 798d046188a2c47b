"""One test per rule of ABT_DO-Retro (Zivan, Meisels 2006; Zivan, Zazone, Meisels 2009), named for it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from random import Random

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.journal.events import Event, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.abt_do import ABTDORetro, CurrentOrder
from robochoc.protocols.satisfaction.abt_do_messages import AddLink, Counters, Nogood, Ok, Order
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.cases import cases, looped
from tests.support.problems import random_team, team_of
from tests.support.small_teams import differ, different, odd_triple


def clique(values: int = 3) -> Team:
    """Four robots, each different from each; a fifth, the lowest, that has nothing to do with them."""
    pairs = [(left, right) for left in "ABCD" for right in "ABCD" if left < right]
    return team_of(dict.fromkeys("ABCDE", range(1, values + 1)), [differ(*pair) for pair in pairs])


agent = partial(started_robot, ABTDORetro)


def names(text: str) -> tuple[str, ...]:
    return tuple(f"R{letter}" for letter in text)


def order(text: str, *counters: tuple[int, str]) -> Order:
    return Order(names(text), counters)


def orders(said: Sequence[tuple[str, Message]]) -> list[tuple[str, Message]]:
    return [(receiver, message) for receiver, message in said if isinstance(message, Order)]


# ABT, under the first order


def test_start_takes_the_first_value_and_tells_it_to_lower_neighbours_only() -> None:
    assert started(robot_of(ABTDORetro, clique(), "RC")) == [("RD", Ok((1,), 3))]


def test_ok_tells_how_many_values_are_left_and_a_value_that_the_view_allows_is_kept() -> None:
    assert replies(agent(clique(), "RB"), ("RA", Ok((1,), 3))) == [("RC", Ok((2,), 2)), ("RD", Ok((2,), 2))]
    abt = agent(clique(), "RB")
    assert replies(abt, ("RA", Ok((2,), 3))) == []
    assert value(abt) == (1,)


def test_backtrack_tells_the_lowest_robot_at_present_and_how_many_values_are_left_without_it() -> None:
    abt = agent(clique(), "RD")
    packet = [("RA", Ok((1,), 3)), ("RB", Ok((2,), 2)), ("RC", Ok((3,), 1))]
    assert replies(abt, *packet) == [("RC", Nogood({"RA": (1,), "RB": (2,)}, (3,), 1))]
    assert "RC" not in abt.view
    assert value(abt) == (3,)
    abt = agent(clique(), "RD", ("RC", order("CBADE", (1, "RA"))))
    assert replies(abt, *packet) == [("RA", Nogood({"RB": (2,), "RC": (3,)}, (1,), 1))]


def test_an_empty_nogood_ends_the_search_without_solution() -> None:
    abt = agent(clique(1), "RA")
    assert orders(replies(abt, ("RB", Nogood({}, (1,), 1)))) == []
    assert abt.verdict is Verdict.NO_SOLUTION
    assert replies(abt, ("RB", AddLink()), ("RB", Nogood({}, (1,), 1))) == []


def test_an_obsolete_nogood_about_the_present_value_is_answered_once_a_packet_and_one_about_another_is_not() -> None:
    abt = agent(clique(), "RB", ("RA", Ok((2,), 3)))
    obsolete = Nogood({"RA": (3,)}, (1,), 1)
    for packet in ([obsolete], [obsolete, obsolete]):
        assert replies(abt, *(("RD", nogood) for nogood in packet)) == [("RD", Ok((1,), 3))]
    replies(abt, ("RA", Ok((1,), 3)))
    assert replies(abt, ("RD", Nogood({"RA": (1,)}, (1,), 1))) == []


def test_unknown_robots_of_the_left_side_are_asked_and_meanwhile_believed() -> None:
    abt = agent(different("ABC", "AC BC", 2), "RB")
    assert replies(abt, ("RC", Nogood({"RA": (1,)}, (1,), 1))) == [("RA", AddLink()), ("RC", Ok((2,), 1))]
    assert abt.view == {"RA": (1,)}


def test_who_asks_for_a_link_is_told_the_value_now_and_whenever_it_is_lower() -> None:
    abt = agent(clique(), "RA")
    assert replies(abt, ("RE", AddLink()), ("RE", AddLink())) == [("RE", Ok((1,), 3))], "twice is one link"
    assert ("RE", Ok((2,), 2)) in replies(abt, ("RB", Nogood({}, (1,), 0)))
    assert replies(abt, ("RB", order("EBCDA", (1, "RB")))) == []
    assert ("RE", Ok((2,), 2)) in replies(abt, ("RB", order("ABCDE", (2, "RB"))))


# Dynamic ordering


@looped(
    ("older", "newer"),
    [
        ((), ((1, "RA"),)),
        (((1, "RA"),), ((2, "RA"),)),
        (((1, "RA"), (5, "RB")), ((2, "RA"),)),
        (((1, "RA"),), ((1, "RA"), (0, ""), (1, "RB"))),
        (((1, "RA"),), ((1, "RB"),)),
    ],
)
def test_of_two_orders_the_one_with_the_larger_counters_holds(older: Counters, newer: Counters) -> None:
    abt = agent(clique(), "RB")
    replies(abt, ("RA", order("BACDE", *older)), ("RC", order("CBADE", *newer)), ("RA", order("BACDE", *older)))
    assert isinstance(abt.order, CurrentOrder)
    assert (abt.order.names, abt.order.counters) == (names("CBADE"), newer)


def test_an_accepted_nogood_moves_its_sender_right_below_the_receiver() -> None:
    """It is moved above if it has fewer values left, and not at all if it is there, or higher, already."""
    abt = agent(clique(), "RA")
    moved = order("ACBDE", (0, ""), (1, "RA"))
    assert orders(replies(abt, ("RC", Nogood({}, (1,), 3)))) == [(name, moved) for name in ("RC", "RB", "RD", "RE")]
    assert value(abt) == (2,)
    abt = agent(clique(), "RA")
    assert orders(replies(abt, ("RC", Nogood({}, (1,), 1))))[0] == ("RC", order("CABDE", (1, "RA")))
    assert abt.order.names == names("CABDE")
    assert orders(replies(agent(clique(), "RA"), ("RB", Nogood({}, (1,), 3)))) == []
    assert orders(replies(agent(clique(), "RB"), ("RA", Nogood({}, (1,), 0)))) == []


def test_a_sender_passes_only_those_that_are_known_to_have_more_values_left() -> None:
    for left_a, left_b, left, expected in (
        (3, 3, 1, "DABCE"),
        (1, 3, 1, "ADBCE"),
        (3, 1, 1, "ABDCE"),
        (3, None, 0, "ABDCE"),
        (3, None, 1, "ABDCE"),
    ):
        abt = agent(clique(), "RC")
        known = [("RA", Ok((2,), left_a)), *([] if left_b is None else [("RB", Ok((3,), left_b))])]
        replies(abt, *known)
        replies(abt, ("RD", Nogood({}, (1,), left)))
        assert abt.order.names == names(expected)


def test_a_sender_does_not_pass_the_second_last_robot_of_the_nogood() -> None:
    abt = agent(clique(), "RC", ("RA", Ok((2,), 3)), ("RB", Ok((3,), 3)))
    said = replies(abt, ("RD", Nogood({"RA": (2,)}, (1,), 0)))
    moved = order("ADBCE", (0, ""), (1, "RC"))
    assert orders(said) == [("RD", moved), ("RB", moved), ("RE", moved)], "not RA: for it nothing has changed"


def test_a_new_order_raises_the_counter_of_its_place_and_drops_those_below() -> None:
    current = CurrentOrder(names("ABCDE"))
    current.adopt(order("ABCDE", (7, "RA"), (4, "RA"), (2, "RC"), (1, "RB")))
    assert current.moved("RE", 2, "RC") == order("ABECD", (7, "RA"), (4, "RA"), (3, "RC"))
    assert current.moved("RE", 4, "RC") == order("ABCDE", (7, "RA"), (4, "RA"), (2, "RC"), (1, "RB"), (1, "RC"))


def test_who_adopts_an_order_tells_its_value_to_those_newly_lower_and_drops_nogoods_that_rest_on_them() -> None:
    said = replies(agent(clique(), "RC"), ("RA", order("CABDE", (1, "RA"))))
    assert said == [("RA", Ok((1,), 3)), ("RB", Ok((1,), 3))]
    abt = agent(clique(), "RC", ("RA", Ok((1,), 3)), ("RB", Ok((2,), 3)))
    assert value(abt) == (3,)
    assert list(abt.store) == [{"RA": (1,)}, {"RB": (2,)}]
    assert replies(abt, ("RA", order("ACBDE", (0, ""), (1, "RA")))) == [("RB", Ok((3,), 2))]
    assert list(abt.store) == [{"RA": (1,)}]


def test_only_robots_that_are_higher_at_present_are_looked_at() -> None:
    abt = agent(clique(), "RC", ("RA", order("BCADE", (1, "RA"))))
    assert replies(abt, ("RA", Ok((1,), 3))) == []
    assert value(abt) == (1,)
    assert ("RA", Ok((2,), 2)) in replies(abt, ("RB", Ok((1,), 3)))
    abt = agent(clique(), "RB", ("RC", Ok((1,), 3)))
    assert value(abt) == (1,)
    replies(abt, ("RA", order("CABDE", (1, "RA"))))
    assert value(abt) == (2,), "the value counts as soon as its robot is higher"


def test_a_nogood_that_rests_on_a_robot_that_is_lower_at_present_is_answered() -> None:
    abt = agent(clique(), "RB", ("RA", Ok((2,), 3)))
    replies(abt, ("RC", order("BACDE", (1, "RC"))))
    assert replies(abt, ("RD", Nogood({"RA": (2,)}, (1,), 1))) == [("RD", Ok((1,), 3))]


def test_an_n_ary_constraint_is_checked_by_the_lowest_robot_at_present() -> None:
    abt = agent(odd_triple(), "RA", ("RB", Ok((1,), 2)), ("RC", Ok((1,), 2)), ("RB", order("BAC", (1, "RB"))))
    assert abt.problem.checks == 0
    replies(abt, ("RB", order("CBA", (2, "RB"))))
    assert value(abt) == (2,)
    assert list(abt.store) == [{"RB": (1,), "RC": (1,)}]


def test_what_is_known_to_hold_is_not_checked_again() -> None:
    abt = agent(clique(), "RB", ("RA", Ok((2,), 3)))
    assert (checks := abt.problem.checks)
    replies(abt, ("RA", Ok((2,), 3)), ("RC", Ok((1,), 3)))
    assert abt.problem.checks == checks


# Why it ends


def test_every_order_is_unique_and_robots_before_a_place_change_only_with_its_counters() -> None:
    """Check the assumptions of the docstring's argument for all orders that are sent in some runs."""
    passed = 0
    with cases() as each:
        for seed in range(60):
            team = random_team(Random(f"orders {seed}"))
            made = orders_made(team, seed)
            with each(seed):
                check_orders(team, made)
            passed += sum(one.counters[-1][1] in one.names[len(one.counters) :] for one in made)
    assert passed > 60, "senders pass receivers in such runs: orders are retroactive"


def check_orders(team: Team, made: list[Order]) -> None:
    seen: dict[Counters, tuple[str, ...]] = {}
    for message in made:
        assert seen.setdefault(message.counters, message.names) == message.names
        assert sorted(message.names) == sorted(team.order)
    padded = {counters + ((0, ""),) * (len(team.order) - len(counters)): told for counters, told in seen.items()}
    for place in range(len(team.order)):
        before: dict[Counters, tuple[str, ...]] = {}
        for counters, told in padded.items():
            assert before.setdefault(counters[:place], told[:place]) == told[:place]
    values = sum(len(variable.domain) for variable in team.variables.values())
    assert max((counters[0][0] for counters in seen), default=0) <= values, "each nogood without a left side once"


def orders_made(team: Team, seed: int) -> list[Order]:
    made: list[Order] = []

    def observe(event: Event) -> None:
        if isinstance(event, Sent) and event.type == "Order":
            made.append(Order(**event.content))

    schedule = Concurrent(seed, 20) if seed % 2 else RandomChannels(seed)
    Simulation(team, ABTDORetro, schedule, observer=observe).run(60)
    return made
