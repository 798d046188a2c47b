"""Counting DPOP: one test per rule, named for it, and its numbers on random problems against brute force."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from random import Random

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.network.plausibility import fault_of_findings
from robochoc.formats.result import result_json
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.findings import Findings
from robochoc.protocols.inference.count_dpop import MOST_BITS, CountDimensions, CountDPOP, Counts
from robochoc.protocols.inference.dpop import UTIL, VALUE, Domain, Need, Proceed
from robochoc.protocols.settings import equip
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, solve
from robochoc.run.options import Withdrawal
from robochoc.solver.errors import TooLargeError, UnsupportedError
from tests.support.agents import after, assert_refused, replies
from tests.support.brute_force import priced_solutions
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.dpop_robots import FEW, products
from tests.support.examples import count
from tests.support.loose_problems import loosened
from tests.support.problems import random_team, team_of
from tests.support.pseudo_trees import placed
from tests.support.random_options import random_options

TEAMS = (random_team, random_cost_team, random_complex_team, random_complex_cost_team)
IN_SIMULATOR = Options(protocol="count-dpop", runtime=Runtime.SIMULATOR, count=True)


def optima(team: Team) -> int:
    """The number of assignments of least cost, by trying all."""
    costs = Counter(cost for _, cost in priced_solutions(team))
    return costs[min(costs)] if costs else 0


def robot_of(team: Team, name: str, above: str = "", below: str = "", values: int = 3) -> CountDPOP:
    over, under = ([f"R{letter}" for letter in letters] for letters in (above, below))
    robot = placed(CountDPOP, team, name, over[0] if over else None, pseudo_parents=over[1:], children=under)
    for one in over:
        replies(robot, (one, Domain([(value,) for value in range(1, values + 1)])))
    return robot


def root(bits: int = 2) -> CountDPOP:
    """A root of two values whose child has told its sizes."""
    robot = robot_of(products("AB", "AB", (1, 2)), "RA", below="B")
    robot.outbox.clear()
    replies(robot, ("RB", CountDimensions({"RA": 2}, 9, 1, FEW, bits)))
    return robot


# The rules


def test_a_leaf_tells_the_bits_of_its_numbers_with_its_sizes() -> None:
    robot = placed(CountDPOP, products("AB", "AB"), "RB", "RA")
    ((_, said),) = replies(robot, ("RA", Domain([(1,), (2,), (3,)])))
    assert isinstance(said, CountDimensions)
    assert said.bits == 2
    assert said.in_words(Wording("RA", "RB")).endswith("2 bits are enough for my numbers")


def test_costs_are_followed_by_numbers() -> None:
    robot = robot_of(products("AB", "AB"), "RB", "A")
    robot.outbox.clear()
    counts = Counts(1, bytes([1, 1, 1]))
    assert replies(robot, ("RA", Proceed(["RA"]))) == [("RA", UTIL(1, bytes([1, 2, 3]))), ("RA", counts)]
    said = Counts(2, bytes(4)).in_words(Wording("RA", "RB"))
    assert said == "in how many ways my subtree attains the costs of my table: 2 cells, of 2 bytes"


def test_numbers_of_equal_least_cost_are_added_and_those_of_dearer_values_are_not() -> None:
    for costs, place, number in (([4, 4], 0, 5), ([5, 4], 1, 3)):
        robot = after(root(), ("RB", UTIL(1, bytes(costs))))
        assert replies(robot, ("RB", Counts(1, bytes([2, 3])))) == [("RB", VALUE([place]))]
        assert (robot.count, robot.findings.count, robot.findings.bound) == (number, str(number), 4)


def test_numbers_of_children_are_multiplied() -> None:
    robot = robot_of(products("ABC", "AB AC", (1, 2)), "RA", below="BC")
    sizes = CountDimensions({"RA": 2}, 9, 1, FEW, 70)
    replies(robot, ("RB", sizes), ("RC", sizes))
    for child, number in (("RB", 2**69), ("RC", 3)):
        numbers = number.to_bytes(9, "little") + (1).to_bytes(9, "little")
        replies(robot, (child, UTIL(1, bytes([4, 5]))), (child, Counts(9, numbers)))
    assert robot.count == 3 * 2**69


def test_without_any_solution_there_are_none() -> None:
    robot = after(root(), ("RB", UTIL(1, bytes([255, 255]))), ("RB", Counts(1, bytes(2))))
    assert robot.verdict is Verdict.NO_SOLUTION
    assert robot.count == 0


def test_numbers_that_cannot_be_are_refused() -> None:
    def with_costs() -> CountDPOP:
        return after(root(), ("RB", UTIL(1, bytes([4, 5]))))

    assert replies(with_costs(), ("RB", Counts(1, bytes([1])))) == []
    for wrong, why in (
        (Counts(1, bytes([1, 0])), "a number does not match its cost"),
        (Counts(1, bytes([4, 1])), "larger than 2\\^2"),
        (Counts(2, bytes([1, 0, 1, 0])), "the table lacks"),
        (Counts(1, bytes([1, 1, 1])), "the table lacks"),
        (Counts(1, b""), "the table lacks"),
    ):
        assert_refused(with_costs, [("RB", wrong)], why)
    assert_refused(root, [("RB", Counts(1, bytes([1, 1])))], "before its costs")


def test_numbers_that_could_be_too_long_end_the_run_and_they_are_part_of_the_memory_need() -> None:
    with pytest.raises(TooLargeError, match="1,048,576 bits"):
        root(MOST_BITS)
    robot = robot_of(products("AB", "AB", (1, 2)), "RA", below="B")
    equip(robot, {"memory": "100000"})
    with pytest.raises(TooLargeError, match="needs"):
        replies(robot, ("RB", CountDimensions({"RA": 2}, 9, 1, Need(1, "RB"), MOST_BITS - 9)))


# The run


@count("problems", 15, 2000)
def test_the_number_is_that_of_all_assignments_of_least_cost(problems: int) -> None:
    chance, several = Random("count"), 0
    for number in range(problems):
        team = TEAMS[number % len(TEAMS)](chance)
        team = loosened(team, chance) if chance.random() < 0.3 else team
        options = replace(random_options(team, "count-dpop", chance), count=True)
        outcome = solve(team, options)
        assert outcome.count == optima(team), (number, team, options)
        several += (outcome.count or 0) > 1
    assert several > problems // 4


def free_team(robots: int) -> Team:
    return team_of({f"X{number:03}": (1, 2, 3) for number in range(robots)}, [])


def test_unconnected_parts_are_multiplied_and_the_number_is_written_whatever_its_length() -> None:
    outcome = solve(free_team(50), IN_SIMULATOR)
    assert outcome.count == 3**50
    assert f'"count":{3**50}'.encode() in result_json(outcome)
    assert f"{3**50:,} solutions" in outcome_report(free_team(50), outcome)
    outcome = Outcome(
        Verdict.OPTIMAL, team="t", protocol="count-dpop", runtime="simulator", seed=0, count=10**5000, cost=7
    )
    assert b"1" + b"0" * 5000 in result_json(outcome)
    assert "0,000 optima of cost 7" in outcome_report(free_team(1), outcome)


def test_processes_report_it_too_and_nobody_is_told_without_asking() -> None:
    assert solve(free_team(2), Options(protocol="count-dpop", count=True)).count == 9
    assert solve(free_team(2), replace(IN_SIMULATOR, count=False)).count is None


@looped(
    ("options", "why"),
    [
        (Options(protocol="dpop", count=True), "--count is for --protocol central, or count-dpop"),
        (Options(protocol="count-dpop", count=True, withdraw=Withdrawal.MINIMUM), "counts solutions for all robots"),
        (Options(protocol="count-dpop", count=True, runtime=Runtime.NETWORK), "the number cannot be checked"),
    ],
)
def test_counting_is_refused_where_nobody_counts(options: Options, why: str) -> None:
    with pytest.raises(UnsupportedError, match=why):
        solve(free_team(2), options)


def test_a_number_that_is_none_is_a_lie() -> None:
    for told in ("", "-1", "x", "1 "):
        assert fault_of_findings(Findings(count=told), ()) == "it has reported an invalid number"
    assert not fault_of_findings(Findings(count="1f"), ())
