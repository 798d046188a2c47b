"""One test per rule of NCBB (Chechetka, Sycara, AAMAS 2006); its search and bounds are in `test_branching`."""

from __future__ import annotations

from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.generators.random_csp import random_csp
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE
from robochoc.protocols.findings import Incumbent
from robochoc.protocols.optimization.branching import Members, Request, Result, Terminate
from robochoc.protocols.optimization.ncbb import NCBB, Greedy, Search
from robochoc.run import Options, Runtime, solve
from tests.support.agents import replies, value
from tests.support.brute_force import least_cost
from tests.support.pseudo_trees import placed, priced

TEAM = priced(
    "ZABC", {"B": [0, 1], "ZA": [0] * 4, "ZB": [0, 5, 5, 0], "AB": [0, 3, 1, 0], "BC": [0, 9, 9, 0], "ZC": [0] * 4}
)
"""B stands below A and, further up, Z; C is its child, and a pseudo-child of Z."""


def middle() -> NCBB:
    """B, when it knows whom to ask."""
    robot = placed(NCBB, TEAM, "RB", "RA", pseudo_parents=["RZ"], children=["RC"])
    assert replies(robot, ("RC", Members({"RB": ["RC"], "RZ": ["RC"]}))) == [
        ("RA", Members({"RA": ["RB"], "RZ": ["RB", "RC"]}))
    ]
    return robot


def searching(bound: float = INFINITE) -> NCBB:
    """B, when it searches with both values above 1: it costs 0 or 9 itself."""
    robot = middle()
    replies(robot, ("RZ", Greedy((1,))), ("RA", Greedy((1,))), ("RC", Result(4, {"RC": (1,)})))
    replies(robot, ("RZ", Request((1,))), ("RA", Request((1,))))
    replies(robot, ("RA", Search(bound)))
    return robot


def test_the_first_value_is_the_cheapest_with_all_values_above() -> None:
    robot = middle()
    assert replies(robot, ("RZ", Greedy((2,)))) == []
    assert value(robot) is None
    assert replies(robot, ("RA", Greedy((1,)))) == [("RC", Greedy((2,)))]
    assert value(robot) == (2,)


def test_the_root_tells_its_first_value_to_all_below_at_once() -> None:
    root = placed(NCBB, TEAM, "RZ", children=["RA"], pseudo_children=["RB", "RC"])
    assert [(name, Greedy((1,))) for name in ("RA", "RB", "RC")] == root.outbox


def test_the_costs_of_the_first_values_add_up_unless_they_are_not_allowed() -> None:
    for below, told in (
        (Result(4, {"RC": (1,)}), Result(1 + 3 + 4, {"RB": (2,), "RC": (1,)})),
        (Result(INFINITE, {}), Result(INFINITE, {})),
    ):
        robot = middle()
        replies(robot, ("RZ", Greedy((2,))), ("RA", Greedy((1,))))
        assert replies(robot, ("RC", below)) == [("RA", told)]


def test_the_root_searches_below_the_first_cost_and_keeps_that_assignment_if_nothing_is_cheaper() -> None:
    team = priced("ZA", {"Z": [3, 0], "ZA": [1, 2, 2, 5]})
    root = placed(NCBB, team, "RZ", children=["RA"])
    said = replies(root, ("RA", Members({"RZ": ["RA"]})), ("RA", Result(2, {"RA": (1,)})))
    assert root.limit == 2
    assert root.incumbent == Incumbent(2, {"RZ": (2,), "RA": (1,)})
    assert said[-1] == ("RA", Request((2,)))
    assert replies(root, ("RA", Result(2, {"RA": (1,)}))) == [("RA", Terminate({"RA": (1,)}))]
    assert (value(root), root.findings.bound, root.over) == ((2,), 2, True)


def test_a_search_with_the_bound_begins_by_asking_for_the_cheapest_value() -> None:
    robot = middle()
    replies(robot, ("RZ", Greedy((2,))), ("RA", Greedy((1,))), ("RC", Result(4, {"RC": (1,)})))
    replies(robot, ("RZ", Request((2,))), ("RA", Request((2,))))
    assert replies(robot, ("RA", Search(20))) == [("RC", Request((2,)))]
    assert robot.local == [5 + 1, 1]


def test_values_that_cost_the_bound_are_not_asked_for() -> None:
    robot = searching(bound=9)
    assert replies(robot, ("RC", Result(9, {"RC": (1,)}))) == [("RA", Result(INFINITE, {}))]


def test_a_search_that_finds_nothing_at_all_is_no_solution() -> None:
    team = priced("ZA", {"Z": [0, INFINITE], "ZA": [INFINITE, INFINITE, 0, 0]})
    root = placed(NCBB, team, "RZ", children=["RA"])
    replies(root, ("RA", Members({"RZ": ["RA"]})), ("RA", Result(INFINITE, {})), ("RA", Result(INFINITE, {})))
    assert root.verdict is Verdict.NO_SOLUTION


def test_who_is_not_asked_does_not_search() -> None:
    with pytest.raises(ValueError, match="does not know the value of its parent"):
        replies(middle(), ("RA", Search(3)))
    with pytest.raises(ValueError, match="is already searching"):
        replies(searching(), ("RA", Search(3)))
    robot = middle()
    with pytest.raises(ValueError, match="repeated cost from"):
        replies(robot, ("RA", Result(3, {})))


def test_a_limit_returns_an_assignment_early() -> None:
    chance = Random(7)
    for seed in range(10):
        team = random_csp(7, 4, 0.7, 0, seed, connected=True, max_cost=chance.randint(5, 50))
        options = Options(protocol="ncbb", runtime=Runtime.SIMULATOR, messages=150, cache=False)
        outcome = solve(team, options)
        assert outcome.verdict is Verdict.UNKNOWN
        assert outcome.cost is not None
        assert (outcome.bound or 0) <= least_cost(team) <= outcome.cost


def test_messages_between_two_robots() -> None:
    """The election and the token; members; a value down and its cost up; two requests and answers; the end."""
    team = priced("ZA", {"Z": [0, 0], "ZA": [1, 2, 3, 0]})
    outcome = Simulation(team, NCBB, Concurrent(seed=0)).run()
    tree = {"Wave", "Token", "Back"}
    assert {kind: count for kind, count in outcome.metrics.messages.items() if kind not in tree} == {
        "Members": 1,
        "Greedy": 1,
        "Request": 2,
        "Result": 3,
        "Terminate": 1,
    }
