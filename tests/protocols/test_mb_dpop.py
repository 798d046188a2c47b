"""One test per rule of MB-DPOP (Petcu and Faltings, IJCAI 2007), named for it, and its promises on random problems."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal
from functools import partial
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.journal.events import AnyEvent, Sent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.inference.dpop import UTIL, VALUE, Proceed
from robochoc.protocols.inference.mb_dpop import MBDPOP, Context, DomainAtDepth, Label, SeparatorAxis
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.solver.errors import UnsupportedError
from tests.support.agents import replies, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import minimum_withdrawal
from tests.support.dpop_robots import FEW, bounded, products, told
from tests.support.examples import count
from tests.support.loose_problems import loosened
from tests.support.problems import random_team
from tests.support.pseudo_trees import placed
from tests.support.random_options import random_options
from tests.support.wide_problems import wide_team

BOUNDED = ("mb-dpop", "rmb-dpop")


robot_of = partial(bounded, MBDPOP)


def place(depth: int, values: tuple[int, ...] = (1, 2, 3)) -> DomainAtDepth:
    return DomainAtDepth(depth, [(one,) for one in values])


def label(sizes: dict[str, tuple[int, int]], cut: dict[str, int], dearest: int = 9) -> Label:
    return Label({name: SeparatorAxis(*axis) for name, axis in sizes.items()}, cut, dearest, 1, FEW)


def last_label(robot: MBDPOP) -> Label:
    (said,) = [message for _, message in robot.outbox if isinstance(message, Label)]
    return said


# Labels


def test_who_is_below_is_told_the_depth_once_the_parent_has_told_its_own() -> None:
    robot = placed(MBDPOP, products("ABC", "AB BC"), "RB", "RA", children=["RC"])
    assert robot.outbox == []
    assert replies(robot, ("RA", place(3))) == [("RC", place(4))]


def test_a_separator_of_at_most_k_robots_is_not_cut() -> None:
    robot = robot_of(products("ABC", "AB BC AC"), "RC", "BA", k=2)
    assert last_label(robot).cut == {}


def test_of_a_larger_separator_the_highest_robots_are_cut_until_k_are_left() -> None:
    robot = robot_of(products("ABCD", "AB BC CD AD BD AC"), "RD", "CBA")
    assert last_label(robot).cut == {"RA": 3, "RB": 3}


def test_lists_of_children_are_taken_over_and_count() -> None:
    team = products("ABCD", "AB BC CD AD BD AC")
    robot = robot_of(team, "RC", "BA", "D")
    replies(robot, ("RD", label({"RC": (3, 2), "RB": (3, 1), "RA": (3, 0)}, {"RA": 3, "RB": 3})))
    assert robot.cut == {"RA": 3, "RB": 3}


def test_a_cluster_root_has_nobody_of_the_lists_above_it() -> None:
    robot = robot_of(products("ABCD", "AB BC BD CD"), "RB", "A", "C")
    replies(robot, ("RC", label({"RB": (3, 1)}, {"RB": 3, "RC": 3})))
    assert robot.enumerated == {"RB": 3, "RC": 3}
    assert robot.cut == {}


def test_clusters_are_joined_where_the_separator_is_still_too_large() -> None:
    team = products("ABCDE", "AC BC AB CD")
    robot = robot_of(team, "RC", "BA", "D")
    replies(robot, ("RD", label({"RC": (3, 2)}, {"RC": 3})))
    assert robot.enumerated == {}
    assert robot.cut == {"RC": 3, "RA": 3}


def test_without_lists_a_robot_is_one_of_dpop() -> None:
    robot = robot_of(products("AB", "AB"), "RB", "A")
    assert told(robot, ("RA", Proceed(["RA"]))) == [("RA", UTIL(1, bytes([1, 2, 3])))]
    replies(robot, ("RA", VALUE([2])))
    assert value(robot) == (1,)


# Contexts


def cut_leaf() -> MBDPOP:
    robot = robot_of(products("ABC", "AB BC AC"), "RC", "BA")
    replies(robot, ("RB", Proceed(["RB", "RA"])))
    return robot


def test_a_leaf_in_a_cluster_waits_for_a_context_and_sends_the_table_that_is_left() -> None:
    robot = cut_leaf()
    assert robot.outbox == []
    assert replies(robot, ("RB", Context([1]))) == [("RB", UTIL(1, bytes([3, 4, 5])))]
    assert replies(robot, ("RB", Context([0]))) == [("RB", UTIL(1, bytes([2, 3, 4])))]
    replies(robot, ("RB", VALUE([2, 0])))
    assert value(robot) == (1,)


def test_a_robot_that_is_fixed_does_not_choose_in_a_context() -> None:
    """B passes contexts on to C, and takes the value that it has in them."""
    robot = robot_of(products("ABC", "AB BC AC"), "RB", "A", "C")
    replies(robot, ("RC", label({"RB": (3, 1), "RA": (3, 0)}, {"RA": 3, "RB": 3})))
    told(robot, ("RA", Proceed(["RA"])))
    assert told(robot, ("RA", Context([2, 1]))) == [("RC", Context([2, 1]))]
    assert told(robot, ("RC", UTIL(1, bytes([7])))) == [("RA", UTIL(1, bytes([3 * 2 + 7])))]
    assert told(robot, ("RA", VALUE([2]))) == [("RC", VALUE([1, 2]))]
    assert value(robot) == (2,)


def test_a_cluster_root_tries_every_context_and_sends_the_best_once_more() -> None:
    robot = robot_of(products("AB", "AB", (1, 2)), "RA", below="B")
    assert told(robot, ("RB", label({"RA": (2, 0)}, {"RA": 2}))) == [("RB", Proceed(["RA"])), ("RB", Context([0]))]
    assert told(robot, ("RB", UTIL(1, bytes([3])))) == [("RB", Context([1]))]
    assert told(robot, ("RB", UTIL(1, bytes([5])))) == [("RB", Context([0]))]
    assert robot.findings.bound == 3
    assert told(robot, ("RB", UTIL(1, bytes([3])))) == [("RB", VALUE([0]))]
    assert value(robot) == (1,)


def test_the_last_context_is_not_sent_again_if_it_was_the_best() -> None:
    robot = robot_of(products("AB", "AB", (1, 2)), "RA", below="B")
    replies(robot, ("RB", label({"RA": (2, 0)}, {"RA": 2})), ("RB", UTIL(1, bytes([6]))))
    assert told(robot, ("RB", UTIL(1, bytes([5])))) == [("RB", VALUE([1]))]


def test_a_child_outside_the_cluster_is_asked_once() -> None:
    robot = robot_of(products("ABC", "AB AC", (1, 2)), "RA", below="BC")
    packet = [("RB", label({"RA": (2, 0)}, {"RA": 2})), ("RC", label({"RA": (2, 0)}, {}))]
    replies(robot, *packet, ("RC", UTIL(1, bytes([1, 9]))), ("RB", UTIL(1, bytes([3]))))
    assert told(robot, ("RB", UTIL(1, bytes([2])))) == [("RB", Context([0]))]
    assert robot.findings.bound == 4


def test_a_context_without_a_solution_proves_nothing() -> None:
    robot = robot_of(products("AB", "AB", (1, 2)), "RA", below="B")
    replies(robot, ("RB", label({"RA": (2, 0)}, {"RA": 2})), ("RB", UTIL(1, bytes([255]))))
    assert robot.verdict is None
    replies(robot, ("RB", UTIL(1, bytes([255]))))
    assert robot.verdict is Verdict.NO_SOLUTION


def test_what_is_said_of_contexts_in_words() -> None:
    words = Wording("RA", "RB")
    assert label({"RA": (3, 0), "RB": (2, 1)}, {"RA": 3, "RC": 2}).in_words(words) == (
        "while RA and RC are fixed, my table has 2 cells over RB (2 values), and no cost above 9"
    )
    assert Context([0, 2]).in_words(words) == (
        "make your table for these values of the robots that are fixed, by number: 1 and 3"
    )


# What is no message of a well-behaved robot


@looped("values", [[], [3], [0, 0], [-1]])
def test_contexts_that_are_none_are_refused(values: list[int]) -> None:
    with pytest.raises(ValueError, match="are not values of RA"):
        replies(cut_leaf(), ("RB", Context(values)))


def test_a_context_for_who_needs_none_is_refused() -> None:
    robot = robot_of(products("AB", "AB"), "RB", "A")
    replies(robot, ("RA", Proceed(["RA"])))
    with pytest.raises(ValueError, match="unexpected context"):
        replies(robot, ("RA", Context([0])))


def test_a_label_of_a_larger_table_is_refused() -> None:
    robot = robot_of(products("ABC", "AB BC AC"), "RA", below="B")
    with pytest.raises(ValueError, match="2 dimensions"):
        replies(robot, ("RB", label({"RA": (3, 0), "RC": (3, 0)}, {})))


def test_values_that_are_not_those_of_the_context_are_refused() -> None:
    robot = cut_leaf()
    replies(robot, ("RB", Context([1])))
    with pytest.raises(ValueError, match="other fixed values"):
        replies(robot, ("RB", VALUE([0, 0])))


def test_a_table_before_a_context_is_refused() -> None:
    robot = robot_of(products("ABC", "AB BC AC"), "RB", "A", "C")
    replies(robot, ("RC", label({"RB": (3, 1), "RA": (3, 0)}, {"RA": 3, "RB": 3})), ("RA", Proceed(["RA"])))
    with pytest.raises(ValueError, match="without a request"):
        replies(robot, ("RC", UTIL(1, bytes([7]))))


# Its promises


def tables(team: Team, options: Options) -> tuple[float | Decimal | None, dict[str, int], list[Sent]]:
    """Solve `team`; return the cost, each robot's dimensions as it told them, and all messages."""
    events: list[AnyEvent] = []
    outcome = solve(team, options, observer=events.append)
    sent = [event for event in events if isinstance(event, Sent)]
    dimensions, cells = dict[str, int](), dict[str, int]()
    axes = dict[str, dict[str, int]]()
    for event in sent:
        if event.type in ("Label", "ClusterLabel"):
            cut = event.content.get("cut", ())
            axes[event.sender] = {
                name: axis.size for name, axis in event.content["separator"].items() if name not in cut
            }
        elif event.type == "Allocation":
            axes[event.receiver].pop(event.content["robot"], None)
        elif event.type in ("UTIL", "CutUTIL"):
            dimensions[event.sender] = len(axes[event.sender])
            cells[event.sender] = math.prod(axes[event.sender].values())
            assert len(event.content["costs"]) // event.content["width"] == cells[event.sender]
    return outcome.cost if outcome.verdict is Verdict.OPTIMAL else None, dimensions, sent


@looped("protocol", BOUNDED)
@count("problems", 15, 2000)
def test_the_least_cost_is_found_without_a_table_over_k_dimensions(protocol: str, problems: int) -> None:
    chance, cut = Random(f"bounded {protocol}"), 0
    for _ in range(problems):
        team = wide_team(chance)
        team = loosened(team, chance) if chance.random() < 0.3 else team
        k = chance.choice((1, 1, 1, 1, 2, 2, 3))
        options = replace(random_options(team, protocol, chance), settings={"k": str(k)})
        cost, dimensions, sent = tables(team, options)
        least = least_cost(team)
        assert cost == (None if least == INFINITE else least), (team, options)
        assert all(number <= k for number in dimensions.values())
        cut += any(event.type == "Context" for event in sent)
    assert cut > problems // 5


@looped("protocol", BOUNDED)
@count("problems", 2, 100)
def test_as_few_as_possible_withdraw_with_one_dimension(protocol: str, problems: int) -> None:
    chance = Random(f"withdrawal {protocol}")
    for _ in range(problems):
        team = random_team(chance)
        options = replace(random_options(team, protocol, chance), withdraw=Withdrawal.MINIMUM, settings={"k": "1"})
        outcome = solve(team, options)
        assert sum(team[name].weight for name in outcome.withdrawn) == minimum_withdrawal(team)


@pytest.mark.slow
@looped("protocol", BOUNDED)
def test_the_least_cost_is_found_in_processes_with_one_dimension(protocol: str) -> None:
    chance = Random(f"bounded processes {protocol}")
    for _ in range(20):
        team = wide_team(chance)
        outcome = solve(team, Options(protocol=protocol, settings={"k": "1"}))
        least = least_cost(team)
        assert outcome.verdict is (Verdict.NO_SOLUTION if least == INFINITE else Verdict.OPTIMAL)
        assert outcome.cost == (None if least == INFINITE else least)


@looped("protocol", BOUNDED)
def test_it_works_where_dpop_has_no_room_and_is_named_then(protocol: str) -> None:
    team = random_csp(9, 3, 0.9, 0, 4, max_cost=9)
    with pytest.raises(UnsupportedError, match=rf"induced width .*these do: .*\b{protocol}\b"):
        solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR, settings={"memory": "5000", "disk": "0"}))
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, settings={"memory": "5000", "k": "2"})
    assert solve(team, options).cost == solve(team, replace(options, protocol="dpop", settings={})).cost


@looped(("refused", "settings"), [
    ("dpop", {"memory": "5000", "disk": "0"}), ("count-dpop", {"memory": "5000"}), ("p-dpop", {"cells": "500"}),
])  # fmt: skip
def test_whose_tables_are_as_wide_is_not_named_then(refused: str, settings: dict[str, str]) -> None:
    team = random_csp(9, 3, 0.9, 0, 4, max_cost=9)
    with pytest.raises(UnsupportedError, match="these do: ") as told:
        solve(team, Options(protocol=refused, runtime=Runtime.SIMULATOR, settings=settings))
    named = str(told.value).partition("these do: ")[2].partition(" (--protocol)")[0].split(", ")
    assert {name for name in named if name.endswith("dpop")} <= {"mb-dpop", "rmb-dpop"}


def test_with_enough_dimensions_it_is_dpop() -> None:
    team = random_csp(9, 3, 0.5, 0, 4, max_cost=9)
    wide = solve(team, Options(protocol="mb-dpop", runtime=Runtime.SIMULATOR, settings={"k": "9"}))
    plain = solve(team, Options(protocol="dpop", runtime=Runtime.SIMULATOR))
    assert wide.cost == plain.cost
    assert wide.metrics.messages["UTIL"] == plain.metrics.messages["UTIL"]
    assert "Context" not in wide.metrics.messages or not wide.metrics.messages["Context"]
