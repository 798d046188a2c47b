"""One test per rule of S-DPOP (Petcu and Faltings, AAAI 2005), named for it; each epoch against brute force."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.generators.scenario import ChangeKind, random_scenario
from robochoc.model.orders import Order
from robochoc.model.outcome import EpochOutcome, Verdict
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Constraint,
    Domain,
    Parent,
    ProblemKind,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
    Variable,
)
from robochoc.protocols.inference.dpop import UTIL, Dimensions, Need
from robochoc.protocols.inference.s_dpop import SDPOP, Check, Reuse
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.registry import protocol_named, protocol_names
from tests.support.agents import replies
from tests.support.cases import looped
from tests.support.changing_costs import agrees_on_costs, changing_cost_team
from tests.support.dpop_robots import PRODUCT, domain, products
from tests.support.encrypted_problems import affordable
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.loose_problems import loosened
from tests.support.problems import ON_ONE_MACHINE
from tests.support.pseudo_trees import placed
from tests.support.random_options import random_schedule

SIMULATED = Options(protocol="s-dpop", runtime=Runtime.SIMULATOR)
MINIMISING = [
    name for name in protocol_names() if protocol_named(name).traits.costs and protocol_named(name).traits.complete
]


def epochs(team: Team, *changes: Change) -> tuple[EpochOutcome, ...]:
    """All epochs of a team to which these changes happen, one after the other; held against brute force."""
    events = tuple(ScenarioEvent((change,)) for change in changes)
    return agrees_on_costs(replace(team, scenario=events), SIMULATED)[1].epochs


def said(epoch: EpochOutcome) -> dict[str, int]:
    return {kind: number for kind, number in epoch.metrics.messages.items() if number}


def product(one: str, other: str, name: str = "C") -> Constraint:
    return Constraint(name, PRODUCT, (one, other), (one, other))


# What stands

PATH = products("ABCDE", "AB BC CD DE")
"""B is the root: it has two neighbours, as C and D, and the highest priority of these."""


def test_an_unchanged_team_says_only_that_it_stands() -> None:
    """The value that B gets is one more, and the first stays the best; so A's table is all that is new."""
    (_, second) = epochs(products("ABC", "AB BC"), AddConstraint("RC", "RB", replace(product("B", "C"), name="More")))
    assert said(second) == {"Check": 2, "Reuse": 1, "Dimensions": 1, "Proceed": 1, "UTIL": 1, "VALUE": 1}


def test_only_robots_between_the_change_and_the_root_compute_anew() -> None:
    (first, second) = epochs(PATH, AddConstraint("RE", "RD", product("D", "E", "More")))
    assert said(first)["UTIL"] == 4
    assert said(second) == {"Check": 4, "Reuse": 1, "Dimensions": 3, "Proceed": 3, "UTIL": 3, "VALUE": 3}


def test_a_table_that_turns_out_to_be_the_same_is_not_sent() -> None:
    """E loses a value that it never takes."""
    (_, second) = epochs(PATH, RemoveValue("E", 3))
    assert said(second) == {"Check": 4, "Reuse": 4, "Dimensions": 3, "Proceed": 3, "VALUE": 3}
    assert second.metrics.ncccs > 0


def test_a_domain_that_changes_is_told_to_robots_below_that_wait_for_it() -> None:
    (_, second) = epochs(PATH, AddValue("B", 4))
    assert said(second)["Domain"] == 2
    assert "Wave" not in said(second)
    assert second.cost == 2  # no pair with that value is listed


def test_a_lost_leaf_needs_no_new_tree() -> None:
    (_, second) = epochs(PATH, RemoveAgent("RE"))
    assert "Wave" not in said(second)
    assert second.cost == 3


def test_a_lost_link_that_is_none_of_the_tree_needs_no_new_tree() -> None:
    team = products("ABC", "AB BC AC")
    (_, second) = epochs(team, RemoveConstraint("RC", "RA", "C"))
    assert "Wave" not in said(second)


def test_a_lost_parent_needs_a_new_tree_for_those_below_alone() -> None:
    (_, second) = epochs(PATH, RemoveAgent("RC"))
    assert said(second)["Wave"] == 3  # of D and E
    assert said(second)["Check"] == 1  # of B, for A


def test_a_new_link_between_branches_needs_a_new_tree() -> None:
    (_, second) = epochs(PATH, AddConstraint("RE", "RA", product("A", "E")))
    assert said(second)["Wave"] > 0
    assert second.cost == 5


def test_tables_are_reused_on_a_new_tree_as_well() -> None:
    team = products("ABCDEFG", "AB BC CD DE BF FG")
    newcomer = Robot(
        "RX",
        (Variable("X", Domain("D", (range(1, 3),))),),
        parents=(Parent("RB", (product("B", "X"),)),),
        kind=ProblemKind.DISWCSP,
    )
    (_, second) = epochs(team, AddAgent(newcomer))
    assert said(second)["Wave"] > 0
    assert said(second)["Reuse"] == 6
    assert said(second)["UTIL"] == 1


def test_a_proof_of_no_solution_stands_while_constraints_come() -> None:
    never = replace(product("A", "B", "Never"), definition=replace(PRODUCT, costs=(float("inf"),) * 9))
    (_, second, third, fourth) = epochs(
        PATH,
        AddConstraint("RB", "RA", never),
        AddConstraint("RC", "RB", product("B", "C", "More")),
        RemoveConstraint("RB", "RA", "Never"),
    )
    assert second.verdict is third.verdict is Verdict.NO_SOLUTION
    assert said(third) == {}
    assert fourth.verdict is Verdict.OPTIMAL
    assert said(fourth)["UTIL"] == 4


# What is no message of a well-behaved robot


def test_reuse_of_a_table_that_is_not_there_is_refused() -> None:
    robot = placed(SDPOP, products("ABC", "AB BC"), "RB", "RA", children=["RC"])
    with pytest.raises(ValueError, match="has no table of it"):
        replies(robot, ("RC", Reuse()))


def test_a_tree_that_does_not_stand_is_not_begun() -> None:
    robot = placed(SDPOP, products("AB", "AB"), "RB", "RA")
    with pytest.raises(ValueError, match="has already started"):
        replies(robot, ("RA", Check([])))


def test_a_table_that_was_not_asked_for_is_refused() -> None:
    robot = placed(SDPOP, products("ABC", "AB BC"), "RB", "RA", children=["RC"])
    with pytest.raises(ValueError, match="without a request"):
        replies(robot, ("RA", domain()), ("RC", UTIL(1, bytes(3))))


def test_who_speaks_twice_is_refused() -> None:
    robot = placed(SDPOP, products("ABCD", "AB BC BD"), "RB", "RA", children=["RC", "RD"])
    once = ("RC", Dimensions({"RB": 3}, 9, 1, Need(1, "RC")))
    with pytest.raises(ValueError, match="unexpected or repeated"):
        replies(robot, ("RA", domain()), once, once)


def test_what_is_said_in_words() -> None:
    words = Wording("RA", "RB")
    assert Check([]).in_words(words) == "our tree stands, and above you no values have changed"
    assert Check(["RC"]).in_words(words) == "our tree stands, and above you the values of RC have changed"
    assert Reuse().in_words(words) == "my table is still the one that you have"


# Against brute force


@count("teams", 6, 240)
def test_each_epoch_has_the_least_cost(teams: int) -> None:
    chance, ended, reused = Random("s-dpop"), 0, 0
    for _ in range(teams):
        team = changing_cost_team(chance, change=lambda team: loosened(team, chance) if chance.random() < 0.3 else team)
        order = chance.choice([None, None, *Order])
        number, outcome = agrees_on_costs(team, replace(random_schedule(chance), protocol="s-dpop", order=order))
        ended += number
        reused += sum(epoch.metrics.messages.get("Reuse", 0) for epoch in outcome.epochs)
    assert ended > 8 * teams
    assert reused > 3 * teams


@looped("runtime", ON_ONE_MACHINE)
@count("teams", 1, 10)
def test_each_epoch_has_the_least_cost_in_every_runtime(runtime: Runtime, teams: int) -> None:
    chance = Random(f"s-dpop {runtime}")
    for _ in range(teams):
        agrees_on_costs(changing_cost_team(chance, 5), Options(protocol="s-dpop", runtime=runtime, timeout=HANG_S))


@pytest.mark.usefixtures("quick_encryption")
@looped("protocol", MINIMISING)
@count("teams", 1, 10)
def test_every_protocol_that_proves_an_optimum_goes_through_costs_that_change(protocol: str, teams: int) -> None:
    chance = Random(f"costs anew {protocol}")
    binary = not protocol_named(protocol).traits.n_ary
    for _ in range(teams):
        team = affordable(protocol, lambda: changing_cost_team(chance, 4, binary=binary))
        agrees_on_costs(team, replace(random_schedule(chance), protocol=protocol))


def larger() -> Iterator[Team]:
    for seed in range(3):
        team = random_csp(20, 3, 0.15, 0, seed, max_cost=9)
        yield random_scenario(
            team, 6, 0.02, seed, kinds=(ChangeKind.REMOVE_VALUE, ChangeKind.ADD_VALUE, ChangeKind.REMOVE_CONSTRAINT)
        )


def test_without_new_links_it_takes_less_than_half_of_what_dpop_takes_anew() -> None:
    for team in larger():
        kept, anew = (
            solve(team, replace(SIMULATED, protocol=protocol, schedule=ScheduleName.RANDOM)).epochs[1:]
            for protocol in ("s-dpop", "dpop")
        )
        assert [epoch.cost for epoch in kept] == [epoch.cost for epoch in anew]
        assert 2 * sum(epoch.metrics.bytes for epoch in kept) < sum(epoch.metrics.bytes for epoch in anew)
        assert 2 * sum(sum(said(epoch).values()) for epoch in kept) < sum(sum(said(epoch).values()) for epoch in anew)
