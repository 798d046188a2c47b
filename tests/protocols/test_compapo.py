"""One test per rule of CompAPO (Mailler and Lesser 2004; Grinshpoun and Meisels 2008), named for it."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Message
from robochoc.protocols.satisfaction.compapo import (
    Assign,
    CompAPO,
    Evaluate,
    Evaluation,
    Free,
    Init,
    Ok,
    Release,
    Wait,
)
from robochoc.protocols.satisfaction.mediation import AllowedTable, Mediation, allows
from robochoc.run import Options, Runtime, solve
from tests.support.agents import after, assert_refused, replies, robot_of, started, value
from tests.support.examples import count
from tests.support.random_options import random_schedule
from tests.support.small_teams import graph_team, triangle

TWO = ((1,), (2,))
UNEQUAL = bytes([0b0110])
"""Two robots of two values each that differ."""


def agent(team: Team, name: str, *packet: tuple[str, Message]) -> CompAPO:
    """The protocol object of one robot, which knows its neighbours' domains, after it has read `packet`."""
    robot = robot_of(CompAPO, team, name)
    robot.start()
    for neighbour in robot.linked:
        robot.receive(neighbour, Init(tuple((one,) for one in team[neighbour].variables[0].domain)))
    robot.outbox.clear()
    if packet:
        replies(robot, *packet)
    return robot


def session(*edges: str, domains: dict[str, int] | None = None) -> CompAPO:
    """RA, whose session with the other robots begins."""
    robot = agent(graph_team(edges or ("AB",), domains), "RA")
    robot.repairs = 9
    replies(robot)
    return robot


def table(*robots: str) -> AllowedTable:
    return AllowedTable(robots, (2, 2), UNEQUAL)


def mediator() -> CompAPO:
    """RA of the triangle, in a conflict with RB and RC that no value of its own repairs, which asks them."""
    robot = agent(triangle(), "RA")
    said = replies(robot, ("RC", Ok((2,), 1)))
    assert said == [("RB", Evaluate(1, 3, tables=True)), ("RC", Evaluate(1, 3, tables=True))]
    return robot


def test_start_tells_the_domain_to_those_with_a_constraint_and_nothing_is_done_before_all_are_known() -> None:
    said = started(robot_of(CompAPO, triangle(), "RC"))
    assert said == [(name, Init(TWO)) for name in ("RA", "RB", "RD")]
    robot = robot_of(CompAPO, triangle(), "RA")
    started(robot)
    assert replies(robot, ("RB", Init(TWO)), ("RB", Evaluate(1, 9, tables=False))) == []
    assert replies(robot, ("RC", Init(TWO))) == [("RB", Evaluation(1, 0, 0, ()))]


def test_check_agent_view_repairs_a_conflict_by_the_own_value_if_it_is_the_highest_of_it() -> None:
    assert replies(agent(triangle(), "RA")) == [("RB", Ok((2,), 1)), ("RC", Ok((2,), 1))]
    robot = agent(triangle(), "RB")
    assert replies(robot, ("RC", Ok((2,), 1))) == []
    assert value(robot) == (1,)


def test_a_robot_repairs_no_more_often_than_its_good_list_has_robots() -> None:
    robot = agent(graph_team(["AB"]), "RA")
    replies(robot)
    assert replies(robot, ("RB", Ok((2,), 1))) == [("RB", Ok((1,), 2))]
    assert replies(robot, ("RB", Ok((1,), 2)), ("RB", Ok((2,), 1))) == [("RB", Evaluate(1, 2, tables=True))]
    assert robot.view["RB"] == (1,), "an old value does not replace a new one"


def test_a_session_also_holds_the_robots_around_the_good_list() -> None:
    robot = mediator()
    assert robot.holder == "RA"
    tables = (table("RA", "RC"), table("RB", "RC"), table("RD", "RC"))
    assert replies(robot, ("RB", Evaluation(1, 0, 0, (table("RA", "RB"), table("RC", "RB"))))) == []
    assert replies(robot, ("RC", Evaluation(1, 1, 1, tables))) == [("RD", Evaluate(1, 3, tables=False))]


def test_a_table_allows_the_combinations_of_its_bits() -> None:
    bits = 0b1001_0110_1100
    one = AllowedTable(("RA", "RB"), (3, 4), bits.to_bytes(2, "little"))
    places = itertools.product(range(3), range(4))
    assert [one.allows(pair) for pair in places] == [bool(bits >> at & 1) for at in range(12)]


def test_a_good_list_without_a_solution_ends_the_search() -> None:
    robot = after(mediator(), ("RB", Evaluation(1, 0, 0, (table("RA", "RB"), table("RC", "RB")))))
    replies(robot, ("RC", Evaluation(1, 1, 1, (table("RA", "RC"), table("RB", "RC")))))
    assert robot.verdict is Verdict.NO_SOLUTION


def test_choose_solution_tells_each_its_value_and_its_neighbours_new_ones() -> None:
    robot = session("AB", "BC")
    tables = (table("RA", "RB"), table("RC", "RB"))
    assert replies(robot, ("RB", Evaluation(1, 0, 0, tables))) == [("RC", Evaluate(1, 2, tables=False))]
    assert replies(robot, ("RC", Evaluation(1, 1, 4, ()))) == [("RB", Assign(0, {"RA": (1, 1)})), ("RC", Release({}))]
    assert value(robot) == (2,)


def test_robots_outside_that_are_in_conflict_with_the_solution_join_the_good_list() -> None:
    robot = session("AB", "BC", domains={"A": 1})
    one = AllowedTable(("RA", "RB"), (1, 2), bytes([0b10]))
    replies(robot, ("RB", Evaluation(1, 0, 0, (one, table("RC", "RB")))))
    said = replies(robot, ("RC", Evaluation(1, 1, 1, ())))
    assert said == [("RB", Assign(1, {})), ("RC", Release({"RB": (1, 1)}))]
    assert robot.good_list == {"RA", "RB", "RC"}


def test_a_session_whose_conflict_is_gone_changes_nothing() -> None:
    robot = session()
    assert replies(robot, ("RB", Evaluation(1, 1, 1, (table("RA", "RB"),)))) == [("RB", Release({}))]
    assert robot.holder is None


def test_whoever_is_held_keeps_its_value() -> None:
    robot = agent(graph_team(["AB"]), "RA")
    assert replies(robot, ("RB", Evaluate(7, 2, tables=True))) == [("RB", Evaluation(7, 0, 0, (table("RB", "RA"),)))]
    assert replies(robot) == []
    assert replies(robot, ("RB", Release({"RB": (1, 1)}))) == []
    assert robot.view["RB"] == (2,)


def test_accept_takes_the_value() -> None:
    robot = agent(triangle(), "RB", ("RA", Evaluate(1, 3, tables=False)))
    assert replies(robot, ("RA", Assign(1, {}))) == []
    assert (value(robot), robot.count, robot.holder) == ((2,), 1, None)


def test_a_request_of_lower_priority_is_told_when_this_robot_is_free_and_a_higher_one_waits_for_its_turn() -> None:
    robot = agent(triangle(), "RB", ("RC", Ok((2,), 1)), ("RA", Evaluate(1, 3, tables=False)))
    assert replies(robot, ("RC", Evaluate(4, 3, tables=False))) == [("RC", Wait(4))]
    assert replies(robot, ("RA", Release({}))) == [("RC", Free())]
    replies(robot, ("RC", Evaluate(5, 3, tables=False)))
    assert replies(robot, ("RD", Evaluate(1, 4, tables=False)), ("RA", Evaluate(2, 3, tables=False))) == []
    assert replies(robot, ("RC", Release({}))) == [("RD", Evaluation(1, 0, 0, ())), ("RA", Wait(2))]


def test_a_mediator_that_is_refused_releases_all_and_asks_again_when_the_other_is_free() -> None:
    robot = mediator()
    assert replies(robot, ("RB", Wait(1))) == [("RC", Release({}))]
    assert replies(robot, ("RC", Evaluation(1, 1, 1, ())), ("RC", Free())) == []
    again = [("RB", Evaluate(2, 3, tables=True)), ("RC", Evaluate(2, 3, tables=True))]
    assert replies(robot, ("RB", Free())) == again


def test_what_cannot_be_is_refused() -> None:
    tables = ((0, 0, ()), (0, 0, (table("RA", "RC"),)), (0, 0, (table("RB", "Nobody"),)), (7, 0, (table("RA", "RB"),)))
    wrong: list[Message] = [*(Evaluation(1, *one) for one in tables), Evaluation(1, -1, 0, (table("RA", "RB"),))]
    wrong += [Assign(0, {}), Release({"RZ": (0, 1)}), Init(())]
    assert_refused(session, [("RB", message) for message in wrong], r".")
    sizes = (((2, 2), b"\x00\x00"), ((2, 2), b""), ((2,), b"\x00"), ((0, 2), b""), ((2**40, 2), b"\x01"))
    for each, allowed in sizes:
        with pytest.raises(ValueError, match="a table"):
            AllowedTable(("RA", "RB"), each, allowed)


def random_tables(chance: Random, names: str) -> list[AllowedTable]:
    """Tables over two or three of `names`, of two or three values each."""
    sizes = {name: chance.choice((2, 3)) for name in names}
    tables = []
    for scope in (*itertools.combinations(names, 2), *itertools.combinations(names, 3)):
        if chance.random() < 0.4:
            own = tuple(sizes[name] for name in scope)
            combinations = own[0] * own[1] * (own[2] if len(own) > 2 else 1)
            bits = sum((chance.random() < 0.7) << bit for bit in range(combinations))
            tables.append(AllowedTable(scope, own, bits.to_bytes(-(-combinations // 8), "little")))
    return tables


@count("problems", 60, 2000)
def test_the_mediator_breaks_as_little_outside_as_possible(problems: int) -> None:
    chance, solvable = Random(0), 0
    for _ in range(problems):
        tables = random_tables(chance, "ABCDE")
        sizes = {name: size for table in tables for name, size in zip(table.robots, table.sizes, strict=True)}
        members = {name: sizes[name] for name in "ABC" if name in sizes}
        met = [table for table in tables if members.keys() & {*table.robots}]
        places = {name: chance.randrange(size) for name, size in sizes.items()}
        best = None
        for chosen in itertools.product(*(range(size) for size in members.values())):
            after = {**places, **dict(zip(members, chosen, strict=True))}
            broken = [table for table in met if not allows(table, after)]
            if all({*table.robots} - members.keys() for table in broken):
                best = len(broken) if best is None else min(best, len(broken))
        found = Mediation(met, members, places).best()
        assert (found is None) is (best is None)
        if found is not None:
            solvable += 1
            assert sum(not allows(table, {**places, **found}) for table in met) == best
    assert solvable > problems // 2


@count("problems", 8, 1000)
def test_larger_problems_end_under_every_schedule(problems: int) -> None:
    """Many sessions meet here. Each run ends at rest, far below the limit, and as ABT's does."""
    chance, seen = Random(1), Counter[Verdict]()
    for seed in range(problems):
        team = random_csp(10, 4, 0.35, chance.choice((0.45, 0.6)), seed)
        options = replace(random_schedule(chance), protocol="compapo", messages=20_000)
        verdict = solve(team, options).verdict
        assert verdict is solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR)).verdict
        seen[verdict] += 1
    assert len(seen) == 2
