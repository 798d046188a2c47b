"""One test per rule of RMB-DPOP (Chen et al., AAMAS 2020), named for it; its promises are tested with MB-DPOP's."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.protocols.inference.dpop import UTIL, VALUE, Proceed
from robochoc.protocols.inference.mb_dpop import Context, SeparatorAxis
from robochoc.protocols.inference.rmb_dpop import (
    RMBDPOP,
    Allocation,
    Candidate,
    ClusterLabel,
    CutUTIL,
    CutValue,
    SepDegree,
    best,
)
from robochoc.protocols.message import Message
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies, value
from tests.support.cases import looped
from tests.support.dpop_robots import FEW, bounded, products, told
from tests.support.wide_problems import wide_team

DONE = SepDegree({}, FEW)
Proposals = dict[str, tuple[int, int, int]]
"""The depth of each candidate, how many robots it relieves, and the depth of the lowest of these."""


robot_of = partial(bounded, RMBDPOP)


def candidates(proposals: Proposals) -> dict[str, Candidate]:
    return {name: Candidate(3, *rest) for name, rest in proposals.items()}


def label(separator: dict[str, int], proposals: Proposals | None = None) -> ClusterLabel:
    """The label of a robot with a separator of robots at these depths, each with three values."""
    axes = {name: SeparatorAxis(3, depth) for name, depth in separator.items()}
    return ClusterLabel(axes, candidates(proposals or {}), 9, len(separator), FEW)


def proposed(said: list[tuple[str, Message]]) -> Proposals:
    (message,) = [one for _, one in said if isinstance(one, ClusterLabel | SepDegree)]
    return {name: (one.depth, one.relieved, one.lowest) for name, one in message.candidates.items()}


# The choice of cut robots


def test_a_robot_proposes_all_of_a_separator_that_is_too_large_and_nobody_of_another() -> None:
    robot = robot_of(products("ABC", "AB BC AC"), "RC", "BA")
    assert proposed(list(robot.outbox)) == {"RB": (1, 1, 2), "RA": (0, 1, 2)}
    assert proposed(list(robot_of(products("AB", "AB"), "RB", "A").outbox)) == {}


def test_proposals_are_added_up_and_of_those_not_above_only_the_best_goes_on() -> None:
    robot = robot_of(products("ABCD", "AC BC AB CD"), "RC", "BA", "D")
    lower = label({"RC": 2, "RB": 1, "RA": 0}, {"RC": (2, 2, 4), "RB": (1, 1, 3), "RA": (0, 1, 3), "RX": (3, 1, 4)})
    assert proposed(told(robot, ("RD", lower))) == {"RB": (1, 2, 3), "RA": (0, 2, 3), "RC": (2, 2, 4)}


def test_the_best_relieves_most_and_is_nearest_to_its_lowest() -> None:
    assert best(candidates({"RA": (0, 2, 5), "RB": (1, 3, 9), "RC": (4, 2, 5)})) == "RB"
    assert best(candidates({"RA": (0, 2, 3), "RB": (1, 2, 3), "RC": (2, 2, 5)})) == "RB"
    assert best(candidates({"RA": (0, 2, 3), "RB": (1, 2, 4)})) == "RB"


def cluster_root() -> RMBDPOP:
    """B below A, and above C, whose separator will be both."""
    return robot_of(products("ABC", "AB BC AC"), "RB", "A", "C")


SEPARATOR = {"RB": 1, "RA": 0}


def test_the_cluster_root_asks_again_until_nobody_proposes_any() -> None:
    robot = cluster_root()
    first = label(SEPARATOR, {"RA": (0, 2, 3), "RB": (1, 1, 2), "RX": (2, 1, 3)})
    assert told(robot, ("RC", first)) == [("RC", Allocation("RA"))]
    assert told(robot, ("RC", SepDegree(candidates({"RX": (2, 1, 3)}), FEW))) == [("RC", Allocation("RX"))]
    assert [name for name, _ in told(robot, ("RC", DONE))] == ["RA"]
    assert told(robot, ("RA", Proceed(["RA"]))) == [("RC", Proceed(["RB", "RA"])), ("RC", Context([0]))]


def test_who_did_not_propose_a_robot_is_not_told_of_it() -> None:
    robot = robot_of(products("ABC", "AB AC BC"), "RB", "A", "CD")
    first = label({"RB": 1, "RA": 0}, {"RB": (1, 1, 2), "RA": (0, 1, 2)})
    replies(robot, ("RC", first), ("RD", first))
    assert told(robot, ("RC", DONE)) == []
    assert [name for name, _ in told(robot, ("RD", SepDegree(candidates({"RA": (0, 1, 2)}), FEW)))] == ["RD"]


# Contexts


def chain() -> RMBDPOP:
    """C between A and D, whose separator is B and C: it is cut, and enumerates itself in each context of A."""
    robot = robot_of(products("ABCD", "AC BC CD"), "RC", "BA", "D")
    replies(robot, ("RD", label({"RC": 2, "RB": 1}, {"RC": (2, 1, 3), "RB": (1, 1, 3)})))
    replies(robot, ("RB", Allocation("RC")), ("RD", DONE))
    replies(robot, ("RB", Allocation("RA")))
    replies(robot, ("RB", Proceed(["RB", "RA"])))
    return robot


def util(*costs: int) -> UTIL:
    return UTIL(1, bytes(costs))


def test_a_cut_robot_enumerates_its_own_values_for_its_own_branch() -> None:
    robot = chain()
    assert told(robot, ("RB", Context([0]))) == [("RD", Context([0]))]
    assert told(robot, ("RD", util(0, 0, 5))) == [("RD", Context([1]))]
    assert told(robot, ("RD", util(9, 0, 0))) == [("RD", Context([2]))]
    (said,) = told(robot, ("RD", util(0, 0, 0)))
    # A is 1, and C's value in row c costs c * (1 + b), with B = b.
    assert said == ("RB", CutUTIL(1, bytes([2, 3, 8]), bytes([0, 0, 1])))


def test_a_child_whose_context_did_not_change_is_not_asked_again() -> None:
    robot = robot_of(products("ABCD", "AC BC CD"), "RC", "BA", "D")
    replies(robot, ("RD", label({"RC": 2, "RB": 1}, {"RC": (2, 1, 3), "RB": (1, 1, 3)})))
    replies(robot, ("RB", Allocation("RB")), ("RD", DONE))
    replies(robot, ("RB", Proceed(["RB", "RA"])))
    assert told(robot, ("RB", Context([0]))) == [("RD", Context([0]))]
    assert len(told(robot, ("RD", util(0, 0, 0)))) == 1


def enumerated() -> RMBDPOP:
    """C, which has tried all its values where A has its first."""
    robot = chain()
    replies(robot, ("RB", Context([0])), *[("RD", util(0, 0, 5)), ("RD", util(9, 0, 0)), ("RD", util(0, 0, 0))])
    return robot


def test_the_best_values_are_sent_down_and_the_cluster_chooses_under_them() -> None:
    robot = enumerated()
    assert told(robot, ("RB", CutValue([0, 1]))) == [("RD", CutValue([1]))]
    assert told(robot, ("RD", util(9, 0, 0))) == [("RB", UTIL(1, bytes([13, 6, 8])))]
    assert told(robot, ("RB", VALUE([2, 0]))) == [("RD", VALUE([1, 2]))]
    assert value(robot) == (2,)


def test_what_is_said_in_words() -> None:
    words = Wording("RA", "RB")
    proposals = candidates({"RA": (0, 2, 4), "RB": (1, 1, 4)})
    assert "unless robots are fixed: RA (for 2 tables) and RB (for 1 table)" in SepDegree(proposals, FEW).in_words(
        words
    )
    assert DONE.in_words(words) == "from me down, all tables are small enough"
    assert label({"RA": 0}).in_words(words) == "my table has 3 cells over RA (3 values), and no cost above 9"
    assert Allocation("RA").in_words(words) == "RA will be fixed; who else may be?"
    assert CutUTIL(1, bytes([2, 3]), bytes([0, 1])).in_words(words) == (
        "a piece of my table: 2 costs, from 2 to 3, with the values that are fixed for them (2 bytes)"
    )
    assert "are by number 1 and 2" in CutValue([0, 1]).in_words(words)


# What is no message of a well-behaved robot


def test_candidates_that_cannot_be_are_refused() -> None:
    """Without need; none where there is need; more than one from below; from a robot that was not asked."""
    for wrong, why in (
        (label({"RA": 0}, {"RA": (0, 1, 1)}), "candidates"),
        (label(SEPARATOR), "candidates"),
        (label(SEPARATOR, {"RX": (2, 1, 3), "RY": (2, 1, 3)}), "cannot be cut"),
        (DONE, "unexpected or invalid SepDegree"),
    ):
        with pytest.raises(ValueError, match=why):
            replies(cluster_root(), ("RC", wrong))


def test_an_allocation_that_was_not_proposed_is_refused() -> None:
    robot = robot_of(products("ABC", "AB BC AC"), "RC", "BA")
    with pytest.raises(ValueError, match="did not propose"):
        replies(robot, ("RB", Allocation("RX")))


@looped("places", [b"", b"\0\0", b"\0\0\0\0", b"\3\0\0"])
def test_values_that_do_not_fit_their_table_are_refused(places: bytes) -> None:
    robot = cluster_root()
    replies(robot, ("RC", label(SEPARATOR, {"RA": (0, 2, 3), "RX": (2, 1, 3)})))
    replies(robot, ("RC", SepDegree(candidates({"RX": (2, 1, 3)}), FEW)), ("RC", DONE), ("RA", Proceed(["RA"])))
    with pytest.raises(ValueError, match=r"cannot contain the values|the index of a value is too large"):
        replies(robot, ("RC", CutUTIL(1, bytes([1, 2, 3]), places)))


def test_a_table_without_its_values_is_refused() -> None:
    robot = cluster_root()
    replies(robot, ("RC", label(SEPARATOR, {"RA": (0, 1, 3), "RX": (2, 2, 3)})))
    replies(robot, ("RC", SepDegree(candidates({"RA": (0, 1, 3)}), FEW)), ("RC", DONE), ("RA", Proceed(["RA"])))
    with pytest.raises(ValueError, match="without the values"):
        replies(robot, ("RC", util(1, 2, 3)))


def test_values_for_a_table_that_needs_none_are_refused() -> None:
    robot = chain()
    replies(robot, ("RB", Context([0])))
    with pytest.raises(ValueError, match="with values without a request"):
        replies(robot, ("RD", CutUTIL(1, bytes([1, 2, 3]), b"\0\0\0")))


@looped("values", [[], [0], [0, 3], [0, 0, 0], [-1, 0]])
def test_best_values_that_are_none_or_come_too_early_are_refused(values: list[int]) -> None:
    robot = enumerated()
    with pytest.raises(ValueError, match="are not values"):
        replies(robot, ("RB", CutValue(values)))
    with pytest.raises(ValueError, match="unexpected values of cut robots"):
        replies(chain(), ("RB", CutValue(values)))
    with pytest.raises(ValueError, match="does not know the best values"):
        replies(enumerated(), ("RB", VALUE([0, 0])))


# Its promises


def test_it_needs_fewer_messages_than_mb_dpop() -> None:
    team = random_csp(12, 3, 0.4, 0, 1, max_cost=20)
    options = Options(protocol="rmb-dpop", runtime=Runtime.SIMULATOR, settings={"k": "2"})
    ours, before = solve(team, options), solve(team, replace(options, protocol="mb-dpop"))
    assert ours.cost == before.cost
    assert sum(ours.metrics.messages.values()) < sum(before.metrics.messages.values())


def test_with_enough_dimensions_it_is_dpop() -> None:
    chance = Random("enough")
    for _ in range(5):
        team = wide_team(chance)
        options = Options(protocol="rmb-dpop", runtime=Runtime.SIMULATOR, settings={"k": "9"})
        ours, before = solve(team, options), solve(team, replace(options, protocol="dpop", settings={}))
        assert ours.cost == before.cost
        assert sum(ours.metrics.messages.values()) == sum(before.metrics.messages.values())
