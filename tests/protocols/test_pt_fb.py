"""One test per rule of PT-FB (Litov, Meisels, AIJ 252, 2017); its search and bounds are in `test_branching`."""

from __future__ import annotations

import pytest

from robochoc.generators.random_csp import random_csp
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.branching import Members, Report, Request, Result
from robochoc.protocols.optimization.pt_fb import CPA, PTFB, Reduce
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies
from tests.support.pseudo_trees import placed, priced

TEAM = priced(
    "ABCDEF",
    {
        "AB": [0, 2, 3, 1],
        "B": [0, 4],
        "BC": [0] * 4,
        "BD": [0] * 4,
        "BE": [0] * 4,
        "CE": [0] * 4,
        "DF": [0] * 4,
        "AF": [0] * 4,
    },
)
"""B below A has the children C and D; E is below C and linked with B; F is below D and linked with A, not with B."""


def fork() -> PTFB:
    """B, which knows that A = 1: its values cost 0 and 6 themselves."""
    robot = placed(PTFB, TEAM, "RB", "RA", children=["RC", "RD"], pseudo_children=["RE"])
    replies(robot, ("RC", Members({"RB": ["RC", "RE"]})), ("RD", Members({"RB": ["RD"], "RA": ["RF"]})))
    replies(robot, ("RA", Request((1,))))
    return robot


def exploring() -> PTFB:
    """B, which has its value 1 searched below C for less than 13, and below D for less than 10.

    Its CPAs have the bounds of the child's subtree, old and new.
    """
    robot = fork()
    replies(robot, ("RA", CPA(20, {"RF": 7})))
    said = replies(robot, ("RC", Report(2)), ("RE", Report(3)), ("RD", Report(1)))
    assert said == [("RC", CPA(13, {"RE": 3})), ("RD", CPA(15, {"RF": 7}))]
    return robot


def test_the_root_searches_without_a_bound_when_all_are_known() -> None:
    root = placed(PTFB, TEAM, "RA", children=["RB"], pseudo_children=["RF"])
    said = replies(root, ("RB", Members({"RA": ["RB", "RF"]})))
    assert said == [("RB", Request((1,))), ("RF", Request((1,)))]
    assert root.limit == INFINITE


def test_bounds_that_are_handed_down_count_for_their_subtree() -> None:
    robot = fork()
    replies(robot, ("RA", CPA(20, {"RF": 7})))
    assert robot.branches["RC"].lower == [0, 0]
    assert robot.branches["RD"].lower == [7, 7]


def test_they_may_rule_values_out_before_anyone_is_asked() -> None:
    assert replies(fork(), ("RA", CPA(7, {"RF": 7}))) == [("RA", Result(INFINITE, {}))]


def test_the_bounds_of_an_earlier_search_are_forgotten() -> None:
    robot = exploring()
    replies(robot, ("RC", Result(INFINITE, {})), ("RD", Result(INFINITE, {})))
    replies(robot, ("RC", Report(2)), ("RE", Report(3)), ("RC", Result(INFINITE, {})))
    assert replies(robot, ("RD", Report(1))) == [("RA", Result(INFINITE, {}))]
    replies(robot, ("RA", Request((2,))), ("RA", CPA(50, {})))
    said = replies(robot, ("RC", Report(0)), ("RE", Report(0)), ("RD", Report(0)))
    assert said == [("RC", CPA(47, {})), ("RD", CPA(47, {}))]


def test_the_bound_of_a_subtree_falls_when_the_cost_of_another_is_known() -> None:
    """It searches no further when its value is out."""
    for result, bound in ((Result(9, {"RC": (1,), "RE": (1,)}), 11), (Result(INFINITE, {}), 0)):
        assert replies(exploring(), ("RC", result))[-1] == ("RD", Reduce(bound))


def test_a_bound_that_falls_is_passed_on() -> None:
    robot = exploring()
    assert replies(robot, ("RA", Reduce(18))) == [("RC", Reduce(10)), ("RD", Reduce(13))]
    assert replies(robot, ("RA", Reduce(19))) == []


def test_a_bound_for_a_search_that_has_ended_is_ignored() -> None:
    robot = exploring()
    replies(robot, ("RA", Reduce(0)), ("RC", Result(INFINITE, {})))
    assert replies(robot, ("RD", Result(INFINITE, {}))) == [("RA", Result(INFINITE, {}))]
    assert replies(robot, ("RA", Reduce(0))) == []
    replies(robot, ("RA", Request((1,))), ("RA", CPA(20, {})))
    assert robot.limit == 20


def test_who_is_searching_or_was_not_asked_does_not_begin() -> None:
    new = placed(PTFB, TEAM, "RB", "RA", children=["RC", "RD"], pseudo_children=["RE"])
    for robot in (exploring(), new):
        with pytest.raises(ValueError, match="or is already searching"):
            replies(robot, ("RA", CPA(3, {})))


def test_reports_that_are_handed_down_save_messages_against_ncbb() -> None:
    """The paper's point, on dense problems."""
    sent = {"ncbb": 0, "pt-fb": 0}
    for seed in range(4):
        team = random_csp(7, 4, 0.7, 0, seed, connected=True, max_cost=100)
        for protocol in sent:
            outcome = solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR, cache=False))
            sent[protocol] += sum(outcome.metrics.messages.values())
    assert sent["pt-fb"] < 0.8 * sent["ncbb"]
