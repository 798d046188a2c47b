"""One test per rule of DisFC (Brito and Meseguer, CP 2003; Brito et al., Constraints 14, 2009), and what it hides."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from random import Random

import msgspec
import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.formats.team_reader import read_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Constraint, ConstraintModel, Team
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.disfc import DisFC
from robochoc.protocols.satisfaction.disfc_messages import AddLink, Nogood, Ok
from robochoc.solver import filters
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.filters import allows
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.examples import count
from tests.support.pkc_bytes import changed_where_nobody_was, nothing_hidden, renamed, restated, run
from tests.support.pkc_problems import (
    SECRETS,
    check_against_brute_force,
    pkc_pair,
    pkc_part,
    random_pkc_team,
    with_private_parts,
)
from tests.support.problems import random_team, team_of

EVERYTHING = b"\x07"
"""A filter of three values that lets all of them through."""


def tkc(pair: str, *forbidden: tuple[int, int]) -> Constraint:
    return replace(pkc_part(pair, *forbidden), model=ConstraintModel.TKC)


def differ(pair: str) -> Constraint:
    return tkc(pair, (1, 1), (2, 2), (3, 3))


def triangle() -> Team:
    """Three robots of three values, each different from each; a fourth that only the third knows."""
    return team_of(dict.fromkeys("ABCD", (1, 2, 3)), [differ(pair) for pair in ("AB", "AC", "BC", "CD")])


agent = partial(started_robot, DisFC)


def unsaid(team: Team, name: str) -> list[tuple[str, Message]]:
    """Return the first messages of a robot."""
    return started(robot_of(DisFC, team, name))


# The rules


def test_start_sends_lower_neighbours_a_counter_and_their_domains_filtered() -> None:
    robot = robot_of(DisFC, triangle(), "RA")
    assert started(robot) == [("RB", Ok(1, b"\x06")), ("RC", Ok(1, b"\x06"))]
    assert robot.problem.checks == 6, "every pair of a filter is a check"


def test_a_value_that_a_filter_takes_away_is_left() -> None:
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RA", Ok(5, b"\x06"))) == [("RC", Ok(2, b"\x05"))]
    assert robot.store[0] == {"RA": (5,)}


def test_of_two_filters_that_take_a_value_away_the_highest_robots_is_to_blame() -> None:
    robot = agent(triangle(), "RC")
    replies(robot, ("RB", Ok(1, b"\x06")), ("RA", Ok(1, b"\x06")))
    assert robot.store[0] == {"RA": (1,)}


def test_a_value_that_all_filters_allow_is_kept_with_its_counter() -> None:
    robot = agent(triangle(), "RC")
    assert replies(robot, ("RA", Ok(1, b"\x03")), ("RB", Ok(1, b"\x05"))) == []
    assert robot.counter == 1


def test_backtrack_tells_counters_to_the_lowest_robot_and_forgets_its_assignment() -> None:
    robot = agent(triangle(), "RC")
    said = replies(robot, ("RA", Ok(4, b"\x06")), ("RB", Ok(7, b"\x01")))
    assert said == [("RB", Nogood({"RA": 4}, 7)), ("RD", Ok(2, b"\x05"))]
    assert robot.view == {"RA": 4}
    assert set(robot.filters) == {"RA"}


def test_a_coherent_nogood_about_the_present_counter_is_accepted() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", Ok(1, EVERYTHING)))
    assert replies(robot, ("RC", Nogood({"RA": 1}, 1))) == [("RC", Ok(2, b"\x05"))]


def test_a_nogood_about_another_counter_is_ignored() -> None:
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RC", Nogood({}, 2))) == []
    assert robot.counter == 1


def test_an_obsolete_nogood_about_the_present_counter_is_answered() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", Ok(2, EVERYTHING)))
    assert replies(robot, ("RC", Nogood({"RA": 1}, 1))) == [("RC", Ok(1, b"\x06"))]


def test_nogoods_go_with_the_assignments_they_rest_on() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", Ok(1, b"\x06")))
    replies(robot, ("RA", Ok(2, EVERYTHING)))
    assert list(robot.store) == []


def test_the_empty_nogood_ends_the_search() -> None:
    robot = agent(team_of({"A": (1,), "B": (1,)}, [differ("AB")]), "RA")
    assert replies(robot, ("RB", Nogood({}, 1))) == []
    assert robot.verdict is Verdict.NO_SOLUTION
    assert replies(robot, ("RB", AddLink())) == []


def test_a_value_that_comes_back_has_a_new_counter() -> None:
    robot = agent(triangle(), "RB")
    replies(robot, ("RA", Ok(1, b"\x06")))
    replies(robot, ("RA", Ok(2, b"\x01")))
    assert (robot.value, robot.counter) == (0, 3)


def test_strangers_in_a_nogood_are_asked_for_a_link() -> None:
    team = team_of(dict.fromkeys("ABC", (1, 2)), [differ("AC"), differ("BC")])
    robot = agent(team, "RB")
    assert replies(robot, ("RC", Nogood({"RA": 3}, 1))) == [("RA", AddLink()), ("RC", Ok(2, b"\x01"))]
    assert robot.view == {"RA": 3}


def test_who_asked_for_a_link_gets_a_filter_that_allows_everything_now_and_later() -> None:
    robot = agent(triangle(), "RA")
    assert replies(robot, ("RD", AddLink())) == [("RD", Ok(1, EVERYTHING))]
    assert ("RD", Ok(2, EVERYTHING)) in replies(robot, ("RB", Nogood({}, 1)), ("RD", AddLink()))


def test_parts_go_down_and_up() -> None:
    team = pkc_pair(pkc_part("AB", (1, 2)), pkc_part("AB", (1, 1)))
    assert unsaid(team, "RA") == [("RB", Ok(1, b"\x02"))]
    assert unsaid(team, "RB") == [("RA", Ok(1, b"\x03"))]


def test_a_higher_robot_outside_a_filter_from_below_says_so() -> None:
    robot = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RA")
    assert replies(robot, ("RB", Ok(1, b"\x03"))) == []
    assert replies(robot, ("RB", Ok(2, b"\x02"))) == [("RB", Nogood({"RA": 1}, 2))]
    assert replies(robot) == []


def test_a_new_assignment_is_held_against_the_filters_from_below() -> None:
    robot = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RA")
    replies(robot, ("RB", Ok(4, b"\x01")))
    assert replies(robot, ("RB", Nogood({}, 1))) == [("RB", Ok(2, b"\x03")), ("RB", Nogood({"RA": 2}, 4))]


def test_filters_are_over_the_declared_domain_of_all_that_the_receiver_shows() -> None:
    domains = dict.fromkeys(("A", "b", "B"), (1, 2))
    constraints = [
        replace(pkc_part("Ab", (1, 1)), model=ConstraintModel.TKC),
        replace(pkc_part("AB", (1, 2)), model=ConstraintModel.TKC),
    ]
    team = complex_team({"RA": ["A"], "RB": ["b", "B"]}, domains, constraints)
    (_, ok), *_ = [*unsaid(team, "RA")]
    assert isinstance(ok, Ok)
    rows = [(1, 1), (1, 2), (2, 1), (2, 2)]
    assert [row for place, row in enumerate(rows) if allows(ok.allowed, place)] == [(2, 1)]


def test_a_domain_too_large_for_a_filter_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(filters, "MAX_FILTER_BITS", 2)
    Simulation(pkc_pair(pkc_part("AB"), None), DisFC, Concurrent(0))
    with pytest.raises(UnsupportedError, match="RA has 3 combinations of interface values"):
        Simulation(triangle(), DisFC, Concurrent(0))


def test_a_filter_that_is_too_short_allows_nothing_more() -> None:
    assert [allows(b"\x02", place) for place in (0, 1, 8, 100)] == [False, True, False, False]


# The truth


@count("teams", 60, 500)
def test_disfc_agrees_with_brute_force(teams: int) -> None:
    chance = Random("pkc disfc")
    seen = Counter(check_against_brute_force(random_pkc_team(chance), DisFC, chance) for _ in range(teams))
    assert min(seen.values()) > teams // 4, seen


@count("teams", 15, 60)
def test_disfc_agrees_where_all_is_known_and_where_all_is_split(teams: int) -> None:
    chance = Random("disfc split")
    for _ in range(teams):
        team = random_team(chance, n_ary=False)
        check_against_brute_force(team, DisFC, chance)
        check_against_brute_force(with_private_parts(team, chance), DisFC, chance)


@count("teams", 16, 60)
def test_disfc_agrees_on_complex_robots(teams: int) -> None:
    chance = Random("disfc complex")
    seen = Counter[bool]()
    while seen.total() < teams:
        team = random_complex_team(chance)
        if all(len({team.owner[name] for name in c.variables}) < 3 for robot in team.robots for c in robot.shared):
            split = seen.total() % 2 == 1
            team = with_private_parts(team, chance) if split else team
            check_against_brute_force(team, DisFC, chance)
            seen[split] += 1


def test_the_example_is_solved() -> None:
    team = read_team(SECRETS)
    for result in (Simulation(team, DisFC, Concurrent(0)).run(60), ProcessesRun(team, DisFC).run(60)):
        assert result.verdict is Verdict.SOLUTION
        assert result.assignments == {"Survey": {"V1": 2}, "Freight": {"V2": 4}, "Press": {"V3": 1}}


# What is said


@pytest.fixture(scope="module")
def private_queens() -> Team:
    return with_private_parts(queens3d(4), Random("queens"))


def hides(team: Team, seed: int, chance: Random) -> tuple[bool, bool]:
    """Nothing but places in declared domains is said. Returns whether some row could be changed, and some was told."""
    before = run(team, DisFC, seed)
    nothing_hidden(DisFC, before.envelopes)
    assert run(restated(team, chance), DisFC, seed).envelopes == before.envelopes
    other, maps = renamed(team, chance)
    after = run(other, DisFC, seed)
    assert after.envelopes == before.envelopes
    assert after.result.assignments == {
        robot: {name: maps[name][value] for name, value in own.items()}
        for robot, own in before.result.assignments.items()
    }
    unused = changed_where_nobody_was(team, before.taken, chance)
    assert run(unused, DisFC, seed).envelopes == before.envelopes
    everywhere = changed_where_nobody_was(team, {}, chance)
    return unused != team, run(everywhere, DisFC, seed).envelopes != before.envelopes


@count("teams", 15, 60)
def test_no_value_and_no_row_of_a_value_that_was_not_taken_can_be_seen(teams: int) -> None:
    chance = Random("hides")
    seen = Counter(hides(random_pkc_team(chance), chance.getrandbits(32), chance) for _ in range(teams))
    assert seen[True, True] > teams // 2, seen


def test_counters_count_assignments_and_nothing_else(private_queens: Team) -> None:
    decoder = msgspec.msgpack.Decoder(DisFC.messages)
    last: dict[str, int] = {}
    for envelope in run(private_queens, DisFC, 3).envelopes:
        message = decoder.decode(envelope.content)
        if isinstance(message, Ok):
            before = last.get(envelope.sender, 0)
            assert message.counter in ({before, before + 1} if before else {1})
            last[envelope.sender] = message.counter
    assert max(last.values()) > len(private_queens["Robot1.1"].variables[0].domain)


def test_no_value_of_a_queen_can_be_seen(private_queens: Team) -> None:
    hides(private_queens, 1, Random(1))


def test_private_queens_have_no_solution(private_queens: Team) -> None:
    assert run(private_queens, DisFC, 0).result.verdict is Verdict.NO_SOLUTION
