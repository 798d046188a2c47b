"""One test per rule of the search that NCBB, PT-FB and HS-CAI share, and of bounds that robots below are asked for."""

from __future__ import annotations

from random import Random

from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.optimization.branching import Members, Report, Request, Result, Terminate
from robochoc.protocols.optimization.forward_bounding import CostsAbove
from robochoc.protocols.optimization.ncbb import NCBB, Greedy, Search
from robochoc.run import Options, Runtime, solve
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import after, assert_refused, replies
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team
from tests.support.pseudo_trees import placed, priced, to

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


def placed_fork() -> NCBB:
    """B, with its place in the tree."""
    return placed(NCBB, TEAM, "RB", "RA", children=["RC", "RD"], pseudo_children=["RE"])


def fork() -> NCBB:
    """B, which searches with A = 1 and no bound: its values cost 0 and 6 themselves."""
    robot = after(placed_fork(), ("RC", Members({"RB": ["RC", "RE"]})), ("RD", Members({"RB": ["RD"], "RA": ["RF"]})))
    replies(robot, ("RA", Greedy((1,))), ("RC", Result(9, {"RC": (1,), "RE": (1,)})))
    replies(robot, ("RD", Result(9, {"RD": (1,), "RF": (1,)})), ("RA", Request((1,))))
    return robot


def searching(bound: float = INFINITE) -> NCBB:
    return after(fork(), ("RA", Search(bound)))


def test_a_robot_tells_its_parent_who_of_its_subtree_is_linked_with_whom_above() -> None:
    robot = placed_fork()
    assert replies(robot, ("RC", Members({"RB": ["RC", "RE"]}))) == []
    said = replies(robot, ("RD", Members({"RB": ["RD"], "RA": ["RF"]})))
    assert said == [("RA", Members({"RA": ["RB", "RF"]}))]


def test_all_linked_robots_of_a_subtree_are_asked_and_no_others() -> None:
    said = replies(fork(), ("RA", Search(INFINITE)))
    assert said == [("RC", Request((1,))), ("RE", Request((1,))), ("RD", Request((1,)))]


def test_a_child_searches_when_all_answers_are_there_for_what_they_leave_of_the_bound() -> None:
    """A value is out when the answers reach the bound."""
    robot = searching(bound=20)
    assert replies(robot, ("RC", Report(2))) == []
    assert replies(robot, ("RE", Report(3))) == [("RC", Search(20))]
    assert robot.branches["RC"].lower == [5, 0]
    assert replies(robot, ("RD", Report(4))) == [("RD", Search(15))]
    robot = searching(bound=8)
    said = replies(robot, ("RC", Report(2)), ("RE", Report(6)))
    assert said == [("RC", Request((2,))), ("RE", Request((2,)))]
    assert robot.branches["RC"].lower == [INFINITE, 0]


def test_subtrees_are_at_different_values_at_the_same_time() -> None:
    robot = after(searching(), ("RC", Report(0)), ("RE", Report(0)), ("RD", Report(0)))
    said = replies(robot, ("RC", Result(1, {"RC": (1,), "RE": (2,)})))
    assert said == [("RC", Request((2,))), ("RE", Request((2,)))]
    assert (robot.branches["RC"].index, robot.branches["RD"].index) == (1, 0)


def test_what_a_subtree_costs_lowers_the_bounds_of_the_others_and_may_rule_a_value_out_in_all() -> None:
    for result, said in (
        (Result(11, {"RC": (1,), "RE": (2,)}), [("RD", Search(9))]),
        (Result(INFINITE, {}), [("RD", Request((2,)))]),
    ):
        robot = after(searching(bound=20), ("RC", Report(2)), ("RE", Report(3)), ("RC", result))
        assert replies(robot, ("RD", Report(4))) == said


def test_the_cheapest_value_with_its_assignment_is_returned_when_all_subtrees_are_done() -> None:
    robot = after(searching(bound=20), ("RC", Report(2)), ("RE", Report(3)), ("RD", Report(0)))
    replies(robot, ("RC", Result(5, {"RC": (1,), "RE": (2,)})))
    assert replies(robot, ("RD", Result(1, {"RD": (2,), "RF": (2,)}))) == []
    assert robot.best == 6
    said = replies(robot, ("RC", Report(0)), ("RE", Report(0)))  # the second value costs 6 itself
    assert said == [("RA", Result(6, {"RB": (1,), "RC": (1,), "RE": (2,), "RD": (2,), "RF": (2,)}))]


def test_what_cannot_be_or_nobody_asked_for_is_refused() -> None:
    links: list[dict[str, list[str]]] = [{}, {"RB": ["RE"]}, {"RB": ["RC", "RF"]}]
    assert_refused(placed_fork, [("RC", Members(one)) for one in links], "impossible links")
    assert_refused(fork, [("RC", Result(3, {"RC": (1,), "RE": (1,)}))], "which has no open request")
    assert_refused(searching, [("RA", Result(3, {}))], "which has no open request")
    assert_refused(searching, [("RF", Report(3))], "unexpected bound from")
    assert_refused(searching, [("RC", Result(3, {"RD": (1,)}))], "an assignment without its own value")
    final = [("RA", Terminate({f"R{name}": (2,) for name in names})) for names in ("CDEF", "BCDE")]
    assert_refused(fork, final, "below it are incomplete")
    assert_refused(leaf, [("RZ", Request((1,)))], "is not above")


def test_final_values_go_down_each_subtree() -> None:
    said = replies(fork(), ("RA", Terminate({f"R{name}": (2,) for name in "BCDEF"})))
    assert said == [("RC", Terminate({"RC": (2,), "RE": (2,)})), ("RD", Terminate({"RD": (2,), "RF": (2,)}))]


def test_a_robot_alone_is_done_at_once() -> None:
    robot = placed(NCBB, priced("A", {"A": [2, 1]}), "RA")
    assert (robot.assignment, robot.optimum, robot.verdict) == ({"A": 2}, 1, None)


# Bounds

CHAIN = priced("XYZ", {"Z": [0, 1], "XZ": [0, 4, 3, 0], "YZ": [2, 0, 0, 6]})


def leaf() -> NCBB:
    """Z, a leaf below Y, which is below X."""
    robot = placed(NCBB, CHAIN, "RZ", "RY", pseudo_parents=["RX"])
    robot.outbox.clear()
    return robot


def test_a_bound_is_the_cost_with_robots_from_the_asker_up() -> None:
    """Robots below the asker are left out, as their values are old."""
    robot = after(leaf(), ("RX", Request((1,))), ("RY", Request((1,))))
    for asked in (leaf(), robot):
        assert replies(asked, ("RX", Request((2,)))) == [("RX", Report(1))]


def test_a_leaf_answers_its_parent_with_the_cost_and_its_value() -> None:
    robot = leaf()
    assert to("RY", replies(robot, ("RX", Request((2,))), ("RY", Request((1,))))) == [Result(1, {"RZ": (2,)})]
    assert to("RY", replies(robot, ("RY", Request((2,))))) == [Result(3, {"RZ": (1,)})]


def test_a_constraint_is_checked_when_the_last_of_the_others_asks() -> None:
    team = priced("XYZ", {"XYZ": [0, 1, 2, 3, 4, 5, 6, 7], "XZ": [0, 1, 0, 1]})
    problem = LocalProblem(agent_problems(team, shared_scopes=True)["RZ"])
    above = CostsAbove(problem)
    assert above.ask("RX", (1,)) == [0, 1]
    assert problem.checks == 2
    assert above.ask("RY", (2,)) == [2, 1 + 3]
    assert problem.checks == 4
    assert above.ask("RY", (1,)) == [0, 1 + 1]
    assert above.ask("RX", (2,)) == [0, 1]
    assert problem.checks == 8
    assert above.ask("RY", (1,)) == [4, 1 + 5]


def test_the_best_assignment_so_far_is_known_at_the_root_and_true() -> None:
    """Whenever a limit ends the search, the answer is an assignment that costs what is said."""
    chance, early = Random(3), 0
    for _ in range(30):
        team = random_cost_team(chance)
        for messages in (60, 100, 140):
            options = Options(protocol="ncbb", runtime=Runtime.SIMULATOR, messages=messages, cache=False)
            outcome = solve(team, options)
            if outcome.verdict is Verdict.UNKNOWN and outcome.cost is not None:
                early += 1
                assert outcome.cost >= least_cost(team)
                assert (outcome.bound or 0) <= least_cost(team)
    assert early > 10
