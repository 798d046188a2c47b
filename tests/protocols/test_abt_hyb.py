"""One test per rule of ABT-Hyb (Brito and Meseguer 2004), named for it; the rest is ABT's."""

from __future__ import annotations

from collections import Counter
from functools import partial
from random import Random

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.abt_hyb import ABTHyb
from robochoc.protocols.satisfaction.abt_messages import AddLink, Ok
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.run import ScheduleName
from tests.support.agents import replies, started_robot, value
from tests.support.examples import count
from tests.support.pkc_problems import check_against_brute_force, pkc_part, random_pkc_team, with_part
from tests.support.problems import team_of
from tests.support.small_teams import differ, triangle
from tests.support.spent import spent

DEAD_END: tuple[tuple[str, Message], ...] = (("RA", Ok((1,))), ("RB", Ok((2,))))
"""After these RC, which must differ from both, has no value left."""


agent = partial(started_robot, ABTHyb)


def waiting() -> ABTHyb:
    """RC of the triangle, which waits for RB after a nogood."""
    robot = agent(triangle(), "RC")
    assert replies(robot, *DEAD_END) == [("RB", Nogood({"RA": (1,)}, (2,)))]
    return robot


def test_after_a_nogood_the_view_stays_no_value_is_taken_and_no_second_nogood_is_sent() -> None:
    robot = waiting()
    assert value(robot) is None
    assert robot.view == {"RA": (1,), "RB": (2,)}
    assert replies(robot, ("RA", Ok((1,)))) == []
    assert robot.awaited == "RB"


def test_whoever_waits_drops_nogoods_and_sends_no_value_along_a_new_link_until_a_change_frees_a_value() -> None:
    robot = waiting()
    assert replies(robot, ("RD", Nogood({}, (2,))), ("RD", AddLink())) == []
    assert all("RD" not in lhs for lhs in robot.store)
    robot = waiting()
    assert replies(robot, ("RA", Ok((2,)))) == [("RD", Ok((1,)))]
    assert robot.awaited is None


def test_another_value_of_the_nogoods_receiver_ends_the_wait_and_the_same_one_brings_the_nogood_again() -> None:
    assert replies(waiting(), ("RB", Ok((1,)))) == [("RD", Ok((2,)))]
    assert replies(waiting(), ("RB", Ok((2,)))) == [("RB", Nogood({"RA": (1,)}, (2,)))]


def test_an_obsolete_nogood_about_the_present_value_is_answered_and_an_empty_one_ends_the_search() -> None:
    robot = agent(triangle(), "RB", ("RA", Ok((2,))))
    assert replies(robot, ("RC", Nogood({"RA": (1,)}, (1,)))) == [("RC", Ok((1,)))]
    robot = agent(triangle(1), "RA")
    assert replies(robot, ("RB", Nogood({}, (1,)))) == []
    assert robot.verdict is Verdict.NO_SOLUTION


def test_whoever_waits_refuses_no_pair_of_its_own_part_and_tests_all_once_it_has_a_value() -> None:
    team = team_of({"A": (1, 2), "B": (1,), "C": (1,)}, [differ("A", "B"), pkc_part("BC")])
    robot = agent(with_part(team, "RB", "RC", pkc_part("BC", (1, 1))), "RB")
    assert replies(robot, ("RA", Ok((1,))), ("RC", Ok((1,)))) == [("RA", Nogood({}, (1,)))]
    assert replies(robot, ("RA", Ok((2,)))) == [("RC", Ok((1,))), ("RC", Nogood({"RB": (1,)}, (1,)))]


@count("teams", 40, 2000)
def test_partially_known_constraints_agree_with_brute_force(teams: int) -> None:
    chance = Random(teams)
    seen = Counter(check_against_brute_force(random_pkc_team(chance), ABTHyb, chance) for _ in range(teams))
    assert min(seen.values()) > teams // 8
    assert len(seen) == 2


def test_waiting_saves_messages() -> None:
    """On problems at the peak, with messages read one by one: the paper's claim."""
    teams = [random_csp(12, 5, 0.4, 0.45, seed) for seed in range(4)]
    hybrid, abt = (spent(teams, protocol, ScheduleName.ONE_BY_ONE).messages for protocol in ("abt-hyb", "abt"))
    assert hybrid < 0.9 * abt
