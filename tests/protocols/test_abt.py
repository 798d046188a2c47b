"""One test per rule of ABT (Bessiere, Maestre, Brito, Meseguer, AIJ 161, 2005, Figure 1), named for it."""

from __future__ import annotations

from functools import partial

from robochoc.model.outcome import Verdict
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.small_teams import different, odd_triple, triangle

agent = partial(started_robot, ABT)


def test_start_takes_the_first_value_and_tells_it_to_lower_neighbours_only() -> None:
    assert started(robot_of(ABT, triangle(), "RB")) == [("RC", Ok((1,)))]


def test_process_info_changes_a_value_that_the_view_forbids_and_keeps_one_that_it_allows() -> None:
    assert replies(agent(triangle(), "RB"), ("RA", Ok((1,)))) == [("RC", Ok((2,)))]
    abt = agent(triangle(), "RB")
    assert replies(abt, ("RA", Ok((2,)))) == []
    assert value(abt) == (1,)


def test_the_view_is_checked_once_a_packet_has_been_read() -> None:
    assert replies(agent(triangle(3), "RC"), ("RA", Ok((1,))), ("RB", Ok((2,)))) == [("RD", Ok((3,)))]


def test_backtrack_sends_the_nogood_to_the_lowest_robot_in_it_and_forgets_its_value() -> None:
    abt = agent(triangle(), "RC")
    said = replies(abt, ("RA", Ok((1,))), ("RB", Ok((2,))))
    assert said == [("RB", Nogood({"RA": (1,)}, (2,))), ("RD", Ok((2,)))]
    assert "RB" not in abt.view


def test_an_empty_nogood_ends_the_search_without_solution_and_nothing_is_said_after_it() -> None:
    abt = agent(triangle(1), "RA")
    assert replies(abt, ("RB", Nogood({}, (1,)))) == []
    assert abt.verdict is Verdict.NO_SOLUTION
    assert replies(abt, ("RB", AddLink()), ("RB", Nogood({}, (1,)))) == []


def test_resolve_conflict_accepts_a_coherent_nogood_and_takes_another_value() -> None:
    abt = agent(triangle(), "RA")
    assert replies(abt, ("RB", Nogood({}, (1,)))) == [("RB", Ok((2,))), ("RC", Ok((2,)))]


def test_resolve_conflict_answers_an_obsolete_nogood_about_the_present_value_and_no_other() -> None:
    abt = agent(triangle(), "RB", ("RA", Ok((2,))))
    assert replies(abt, ("RC", Nogood({"RA": (1,)}, (1,)))) == [("RC", Ok((1,)))]
    assert value(abt) == (1,)
    replies(abt, ("RA", Ok((1,))))
    assert replies(abt, ("RC", Nogood({"RA": (1,)}, (1,)))) == []


def test_check_add_link_asks_unknown_robots_of_the_left_side_and_believes_it() -> None:
    abt = agent(different("ABC", "AC BC", 2), "RB")
    assert replies(abt, ("RC", Nogood({"RA": (1,)}, (1,)))) == [("RA", AddLink()), ("RC", Ok((2,)))]
    assert abt.view == {"RA": (1,)}


def test_set_link_tells_the_value_to_the_new_child_now_and_later_once() -> None:
    abt = agent(triangle(), "RA")
    assert replies(abt, ("RD", AddLink())) == [("RD", Ok((1,)))]
    replies(abt, ("RD", AddLink()))
    assert replies(abt, ("RB", Nogood({}, (1,)))).count(("RD", Ok((2,)))) == 1


def test_nogoods_go_when_their_left_side_no_longer_stands_and_of_two_the_one_with_the_higher_robot_is_kept() -> None:
    abt = agent(triangle(), "RB", ("RA", Ok((2,))), ("RC", Nogood({"RA": (2,)}, (1,))))
    replies(abt, ("RA", Ok((1,))))
    assert all(lhs == {"RA": (1,)} for lhs in abt.store)
    abt = agent(triangle(3), "RC", ("RB", Ok((1,))), ("RA", Ok((1,))))
    assert list(abt.store) == [{"RA": (1,)}]


def test_an_n_ary_constraint_is_checked_when_all_its_robots_are_known() -> None:
    abt = agent(odd_triple(), "RC")
    assert replies(abt, ("RA", Ok((1,)))) == []
    assert abt.problem.checks == 0
    replies(abt, ("RB", Ok((1,))))
    assert value(abt) == (2,)
    assert list(abt.store) == [{"RA": (1,), "RB": (1,)}]
