"""One test per rule of AFC-tree (Wahbi et al., Constraints 18(3), 2013, Section 4), named for it."""

from __future__ import annotations

from functools import partial
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.message import Value
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.satisfaction.afc_ng import AFCng
from robochoc.protocols.satisfaction.afc_ng_messages import CPA, Solved
from robochoc.protocols.satisfaction.afc_tree import AFCTree
from robochoc.protocols.satisfaction.afc_tree_messages import Accept
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from robochoc.verification.checker import violations
from tests.support.agents import replies, robot_of, started, started_robot, value
from tests.support.problems import random_team
from tests.support.small_teams import different


def fork(values: int = 3) -> Team:
    """B and C below A; D and E below C, of which E also knows A."""
    return different("ABCDE", "AB AC CD CE AE", values)


created = partial(robot_of, AFCTree)


agent = partial(started_robot, AFCTree)


def cpa(*assignments: tuple[int, int]) -> CPA:
    """A CPA of robots with one variable each: their values and counters."""
    return CPA(tuple(((value,), counter) for value, counter in assignments))


def test_every_root_begins() -> None:
    team = different("ABCD", "AC BD", 2)
    said = {name: started(created(team, name)) for name in team.order}
    assert said == {"RA": [("RC", cpa((1, 1)))], "RB": [("RD", cpa((1, 1)))], "RC": [], "RD": []}


def test_a_cpa_goes_to_tree_children_and_to_those_below_that_share_a_constraint() -> None:
    assert started(created(fork(), "RA")) == [(name, cpa((1, 1))) for name in ("RB", "RC", "RE")]
    said = started(created(different("ABC", "AC BC", 2), "RA"))
    assert [receiver for receiver, _ in said] == ["RB", "RC"], "B is a child without a constraint"


def test_a_cpa_holds_the_values_of_one_branch_only() -> None:
    afc = agent(fork(), "RD")
    said = replies(afc, ("RC", cpa((1, 1), (2, 1))))
    assert afc.view == {"RA": (1,), "RC": (2,)}
    assert said == [("RC", Accept([1, 1], {"RD": (1,)}))]


def test_only_the_tree_parent_s_cpa_lets_a_robot_assign_and_all_children_assign_at_once() -> None:
    afc = agent(fork(), "RE")
    assert replies(afc, ("RA", cpa((1, 1)))) == []
    assert list(afc.store) == [{"RA": (1,)}]
    replies(afc, ("RC", cpa((1, 1), (2, 1))))
    assert value(afc) == (3,)
    for name in ("RB", "RC"):
        afc = agent(fork(), name)
        assert replies(afc, ("RA", cpa((1, 1))))
        assert value(afc) == (2,)


def test_backtrack_goes_to_the_lowest_ancestor_among_the_causes() -> None:
    afc = agent(fork(2), "RE")
    assert replies(afc, ("RC", cpa((1, 1), (2, 1)))) == [("RC", Nogood({"RA": (1,)}, (2,)))]
    assert afc.view == {"RA": (1,)}


def test_constraints_with_ancestors_that_have_not_moved_are_not_checked_again() -> None:
    afc = agent(fork(), "RE", ("RC", cpa((1, 1), (2, 1))))
    checks = afc.problem.checks
    replies(afc, ("RC", cpa((1, 1), (3, 2))))
    assert afc.problem.checks == checks + 2


def test_a_leaf_accepts_the_cpa_that_it_has_a_value_for_and_others_once_all_their_children_have() -> None:
    assert replies(agent(fork(), "RB"), ("RA", cpa((1, 4)))) == [("RA", Accept([4], {"RB": (2,)}))]
    afc = agent(fork(), "RC", ("RA", cpa((1, 1))))
    assert replies(afc, ("RD", Accept([1, 1], {"RD": (1,)}))) == []
    said = replies(afc, ("RE", Accept([1, 1], {"RE": (3,)})))
    assert said == [("RA", Accept([1], {"RC": (2,), "RD": (1,), "RE": (3,)}))]


def test_an_accept_of_another_cpa_is_ignored() -> None:
    for counters in ([1, 1], [2, 2]):
        afc = agent(fork(), "RC", ("RA", cpa((1, 1))), ("RD", Accept([1, 1], {"RD": (1,)})))
        replies(afc, ("RA", cpa((2, 2))))
        replies(afc, ("RD", Accept([2, 1], {"RD": (2,)})))
        assert replies(afc, ("RE", Accept(counters, {"RE": (3,)}))) == []


def test_a_new_value_needs_new_accepts() -> None:
    afc = agent(fork(), "RC", ("RA", cpa((1, 1))))
    replies(afc, ("RD", Accept([1, 1], {"RD": (1,)})), ("RE", Nogood({"RA": (1,)}, (2,))))
    assert value(afc) == (3,)
    assert replies(afc, ("RE", Accept([1, 2], {"RE": (2,)}))) == []
    assert replies(afc, ("RD", Accept([1, 2], {"RD": (1,)}))) != []


def test_a_root_with_all_accepts_tells_its_part_the_solution_and_who_is_told_it_takes_its_value() -> None:
    afc = agent(fork(), "RA", ("RB", Accept([1], {"RB": (2,)})))
    said = replies(afc, ("RC", Accept([1], {"RC": (2,), "RD": (1,), "RE": (3,)})))
    solution: dict[str, Value] = {"RA": (1,), "RB": (2,), "RC": (2,), "RD": (1,), "RE": (3,)}
    assert said == [(name, Solved(solution)) for name in ("RB", "RC", "RD", "RE")]
    afc = agent(fork(), "RC", ("RA", cpa((1, 1))))
    packet = [("RD", Accept([1, 1], {"RD": (1,)})), ("RE", Accept([1, 1], {"RE": (3,)})), ("RA", cpa((2, 2)))]
    assert replies(afc, ("RA", Solved({**solution, "RC": (3,), "RE": (2,)})), *packet) == [], "it is silent"
    assert value(afc) == (3,)


def test_a_robot_alone_is_a_part_of_its_own_and_solves_it_in_silence() -> None:
    afc = created(different("ABC", "AC", 2), "RB")
    assert (started(afc), afc.assignment, afc.over) == ([], {"B": 1}, True)


def test_a_part_without_solution_ends_the_search_of_all() -> None:
    team = different("ABCDE", "AC BD BE DE", 2)
    assert Simulation(team, AFCTree, Concurrent(0)).run(60).verdict is Verdict.NO_SOLUTION


def test_an_order_without_its_tree_is_refused() -> None:
    team = fork()
    with pytest.raises(ValueError, match="pseudo-tree"):
        AFCTree(LocalProblem(agent_problems(team)["RA"]), PriorityOrder(team.order))


class Undetected(AFCTree):
    """Never says that it accepts."""

    def _detect_solution(self) -> None:
        """The values have to be right without it."""


def test_the_values_form_a_solution_when_nobody_speaks_even_without_accepts() -> None:
    chance = Random("undetected")
    solved = 0
    for seed in range(150):
        team = random_team(chance)
        result = Simulation(team, Undetected, RandomChannels(seed)).run(60)
        if result.verdict is Verdict.SOLUTION:
            solved += 1
            assert not list(violations(team, {n: v for own in result.assignments.values() for n, v in own.items()}))
    assert solved > 50


def test_branches_are_searched_at_the_same_time() -> None:
    """Ten triangles below one robot: AFC-ng checks one after the other, AFC-tree all at once."""
    names = "ABCDEFGHIJKLMNOPQRSTU"
    pairs = [f"A{one} A{two} {one}{two}" for one, two in zip(names[1::2], names[2::2], strict=True)]
    team = different(names, " ".join(pairs), 3)
    tree, chain = (Simulation(team, protocol, Concurrent(0)).run(60).metrics for protocol in (AFCTree, AFCng))
    assert tree.checks == chain.checks
    assert tree.ncccs * 2 < chain.ncccs
