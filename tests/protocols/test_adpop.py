"""One test per rule of ADPOP, named for it; the principle is that of Petcu and Faltings, CP 2005."""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from typing import NamedTuple

import pytest

from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.orders import with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.protocols.inference import adpop
from robochoc.protocols.inference.adpop import ADPOP, ADPOPSettings, Bounds, Places
from robochoc.protocols.inference.dpop import Domain
from robochoc.protocols.order import PriorityOrder
from robochoc.protocols.settings import equip
from robochoc.run import Options, Runtime, solve
from robochoc.solver import exact_costs
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.errors import TooLargeError
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import assert_refused, replies, sent
from tests.support.brute_force import least_cost
from tests.support.cost_problems import random_cost_team, random_tree
from tests.support.dpop_robots import products
from tests.support.examples import are_the_same, count, drawn
from tests.support.local_search_runs import any_schedule, cost_of_assignment
from tests.support.problems import shuffled
from tests.support.pseudo_trees import placed
from tests.support.wide_problems import wide_team

THREE = Domain([(1,), (2,), (3,)])
TRIANGLE = products("ABC", "AB BC AC")


def robot_of(name: str, above: str = "", below: str = "", **settings: str) -> ADPOP:
    """A robot of `TRIANGLE` in its tree, which knows the domains above; it has nothing left to send."""
    over, under = ([f"R{letter}" for letter in letters] for letters in (above, below))
    robot = placed(ADPOP, TRIANGLE, name, over[0] if over else None, pseudo_parents=over[1:], children=under)
    equip(robot, settings)
    robot.outbox.clear()
    return robot


def answer(robot: ADPOP) -> Bounds:
    """The table that a robot sends once it knows the domains above."""
    ((_, message),) = replies(robot, *[(name, THREE) for name in robot.ancestors])
    assert isinstance(message, Bounds)
    return message


class Run(NamedTuple):
    verdict: Verdict
    values: dict[str, int]
    messages: Mapping[str, int]
    least: float
    most: float
    axes: int


def run(team: Team, chance: Random, **settings: object) -> Run:
    robots: dict[str, ADPOP] = {}

    class Watched(ADPOP):
        def __init__(self, problem: LocalProblem, order: PriorityOrder) -> None:
            super().__init__(problem, order)
            robots[problem.agent] = self

    parameters = RunParameters(chance.getrandbits(32), {name: str(value) for name, value in settings.items()})
    result = Simulation(team, Watched, any_schedule(chance), parameters=parameters).search()
    values = {name: one for given in result.assignments.values() for name, one in given.items()}
    roots = [robot for robot in robots.values() if robot.least is not None]
    axes = max((len(table.axes) for robot in robots.values() for table in robot.tables.values()), default=0)
    bounds = sum(root.least or 0 for root in roots), sum(root.most for root in roots)
    return Run(result.verdict, values, result.metrics.messages, *bounds, axes)


def any_team(chance: Random) -> Team:
    """Any random team with costs, with any order of its robots."""
    team = chance.choice((random_cost_team, wide_team))(chance)
    return with_order(team, shuffled(chance, team))


# Rules


def test_a_table_within_the_limit_is_exact() -> None:
    """C chooses 1, so that it costs the sum of A and B."""
    bounds = answer(robot_of("RC", "BA"))
    assert bounds == Bounds(["RA", "RB"], {"RA": 3, "RB": 3}, 1, bytes([2, 3, 4, 3, 4, 5, 4, 5, 6]), b"", 18)


def test_a_table_without_an_axis_has_the_least_and_the_largest_cost_over_its_values() -> None:
    """Both axes make the same difference; B has the lower priority, so its axis is removed."""
    bounds = answer(robot_of("RC", "BA", axes="1"))
    assert bounds == Bounds(["RA", "RB"], {"RA": 3}, 1, bytes([2, 3, 4]), bytes([4, 5, 6]), 18)
    none = answer(robot_of("RC", "BA", axes="0"))
    assert (none.axes, none.lower, none.upper) == ({}, bytes([2]), bytes([6]))


def test_large_domains_remove_further_axes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adpop, "MOST_CELLS", 9)
    assert answer(robot_of("RC", "BA")).axes == {"RA": 3}


def test_with_a_ratio_axes_are_removed_as_long_as_the_bounds_are_within_it() -> None:
    """Without B's axis, the largest quotient is that of 4 and 2; without both axes, that of 6 and 2."""
    for ratio, axes in (("1", {"RA": 3, "RB": 3}), ("1.9", {"RA": 3, "RB": 3}), ("2", {"RA": 3}), ("3", {})):
        assert answer(robot_of("RC", "BA", ratio=ratio)).axes == axes


def test_with_a_ratio_a_join_that_is_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adpop, "MOST_CELLS", 26)
    with pytest.raises(TooLargeError, match="RC would need a table of 27 cells, more than 26: use a larger ratio"):
        answer(robot_of("RC", "BA", ratio="2"))


def test_values_go_down_also_for_axes_that_were_removed() -> None:
    """B's child C has no axis of A, and receives the value of A all the same."""
    middle = robot_of("RB", "A", "C")
    assert not replies(middle, ("RA", THREE))
    ((_, said),) = replies(middle, ("RC", Bounds(["RA", "RB"], {"RB": 3}, 1, bytes([2, 3, 4]), bytes([4, 5, 6]), 18)))
    assert said == Bounds(["RA"], {"RA": 3}, 1, bytes([3, 4, 5]), bytes([5, 6, 7]), 27)
    assert replies(middle, ("RA", Places([2]))) == [("RC", Places([2, 0]))]
    assert middle.value == 0


def test_a_robot_chooses_the_value_with_the_lowest_upper_bound() -> None:
    """Among equal upper bounds, the lower bound decides, and then the order of the values."""
    for lower, upper, chosen in (("012", "953", 2), ("210", "444", 2), ("000", "444", 0)):
        table = Bounds(["RA"], {"RA": 3}, 1, bytes(map(int, lower)), bytes(map(int, upper)), 9)
        root = robot_of("RA", "", "B")
        assert replies(root, ("RB", table)) == [("RB", Places([chosen]))]
        assert root.value == chosen


@count("teams", 10, 100)
def test_the_number_of_messages_is_linear(teams: int) -> None:
    """One table up and one message with values down for each robot except the roots, whatever the limits are."""
    chance = drawn("linear")
    for _ in range(teams):
        team = wide_team(chance)
        found = run(team, chance, axes=chance.randint(0, 2))
        if found.verdict is Verdict.SOLUTION:
            assert found.messages.get("Bounds", 0) == found.messages.get("Places", 0) < len(team.order)
            assert found.axes <= 2


# Promises


@pytest.mark.fresh
@count("teams", 60, 3000)
def test_the_optimum_and_the_result_are_within_the_bounds(teams: int) -> None:
    chance = drawn("bounds")
    inexact = proofs = 0
    for _ in range(teams):
        team = any_team(chance)
        least = least_cost(team)
        found = run(team, chance, axes=chance.randint(0, 4))
        if found.verdict is Verdict.NO_SOLUTION:
            proofs += 1
            assert least == INFINITE
            continue
        broken, cost = cost_of_assignment(team, found.values)
        assert found.least <= least
        assert found.most == INFINITE or (not broken and least <= cost <= found.most)
        inexact += found.least < least < INFINITE
    assert not are_the_same() or (inexact and proofs)


@pytest.mark.fresh
@count("teams", 60, 3000)
def test_with_a_ratio_the_result_is_within_it(teams: int) -> None:
    """A ratio of 1 gives the optimum; with any ratio, all proofs of unsatisfiability are found."""
    chance = drawn("ratio")
    inexact = 0
    for _ in range(teams):
        team = any_team(chance)
        least = least_cost(team)
        ratio = chance.choice((1, 1.1, 1.5, 2, 4))
        found = run(team, chance, ratio=ratio)
        assert (found.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            broken, cost = cost_of_assignment(team, found.values)
            assert not broken
            assert found.least <= least <= cost <= found.most <= ratio * found.least
            inexact += cost > least
    assert not are_the_same() or inexact


@count("trees", 20, 300)
def test_on_a_tree_one_axis_gives_the_optimum(trees: int) -> None:
    chance = drawn("trees")
    for _ in range(trees):
        team = random_tree(chance)
        least = least_cost(team)
        found = run(team, chance, axes=1)
        assert (found.verdict is Verdict.NO_SOLUTION) is (least == INFINITE)
        if least < INFINITE:
            assert found.least == found.most == least
            assert cost_of_assignment(team, found.values) == (0, least)


@count("teams", 10, 200)
def test_a_run_reports_an_optimum_that_meets_the_bound(teams: int) -> None:
    chance = drawn("reports")
    for _ in range(teams):
        team = random_cost_team(chance)
        least = least_cost(team)
        options = Options(protocol="adpop", runtime=Runtime.SIMULATOR, cache=False, settings={"ratio": "1"})
        outcome = solve(team, options)
        assert (outcome.verdict is Verdict.OPTIMAL) is (least < INFINITE)
        assert outcome.cost == (None if least == INFINITE else least)


# Invalid input


def test_invalid_settings_are_refused() -> None:
    for wrong, message in (({"axes": -1}, "axes is -1"), ({"ratio": 0.5}, "1 or more"), ({"ratio": INFINITE}, "inf")):
        with pytest.raises(ValueError, match=message):
            ADPOPSettings(**wrong)


def test_invalid_messages_are_refused() -> None:
    def root() -> ADPOP:
        return robot_of("RA", "", "B")

    def bounds(axes: dict[str, int], lower: bytes, upper: bytes = b"", most: float = 9) -> tuple[str, Bounds]:
        return "RB", Bounds(["RA"], axes, 1, lower, upper, most)

    assert_refused(root, [bounds({"RA": 4}, bytes(4)), bounds({"RX": 2}, bytes(2))], "invalid axis")
    assert_refused(root, [bounds({"RA": 3}, bytes(3), most=float("nan")), bounds({}, b"", most=-1)], "invalid table")
    assert_refused(root, [bounds({"RA": 3}, bytes(2)), bounds({"RA": 3}, bytes(3), bytes(2))], "bytes of costs")
    assert_refused(root, [bounds({"RA": 3}, bytes([1, 1, 1]), bytes(3))], "above its upper bound")
    assert_refused(root, [("RC", bounds({}, b"\0")[1])], "unexpected or repeated")
    low = robot_of("RC", "BA")
    answer(low)
    for sender, places in (("RB", [1]), ("RB", [0, 3]), ("RB", [0, -1]), ("RA", [0, 0])):
        with pytest.raises(ValueError, match="unexpected values"):
            low.receive(sender, Places(places))
    assert not sent(low)


def test_costs_that_floats_do_not_hold_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exact_costs, "EXACT", 5)
    with pytest.raises(TooLargeError, match="2\\^53"):
        run(TRIANGLE, Random(0))
