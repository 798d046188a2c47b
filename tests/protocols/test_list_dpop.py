"""Listing DPOP: one test per rule, named for it, and its optima on random problems against brute force."""

from __future__ import annotations

from dataclasses import replace
from random import Random

import pytest

from robochoc.cli.reports.outcome import outcome_report
from robochoc.communication.network.plausibility import fault_of_findings
from robochoc.communication.search_result import SearchResult
from robochoc.formats.result import read_result, result_json
from robochoc.model.outcome import Metrics, Optima, Verdict
from robochoc.model.problem import Team
from robochoc.protocols.findings import Findings, Listing
from robochoc.protocols.inference.count_dpop import CountDimensions, Counts
from robochoc.protocols.inference.dpop import UTIL, Domain, Proceed
from robochoc.protocols.inference.list_dpop import ListDPOP, ListedValues
from robochoc.protocols.message import Message
from robochoc.protocols.settings import equip
from robochoc.protocols.wording import Wording
from robochoc.run import Options, Runtime, solve
from robochoc.run.listed_optima import combined_optima
from robochoc.run.options import Preprocess, Withdrawal
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.verification.checker import RefutedError
from tests.support.agents import replies, value
from tests.support.brute_force import priced_solutions
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import minimum_withdrawal, random_complex_cost_team, random_cost_team
from tests.support.dpop_robots import FEW, products
from tests.support.examples import count
from tests.support.loose_problems import loosened
from tests.support.problems import random_team, team_of
from tests.support.pseudo_trees import placed
from tests.support.random_options import random_options
from tests.support.small_teams import differ
from tests.support.wide_problems import wide_team

TEAMS = (random_team, random_cost_team, random_complex_team, random_complex_cost_team, wide_team)
IN_SIMULATOR = Options(protocol="list-dpop", runtime=Runtime.SIMULATOR)
Look = tuple[tuple[str, int], ...]


def robot_of(name: str, above: str = "", below: str = "", limit: int = 100) -> ListDPOP:
    """A of the values 1 and 2 above B and C, or one of these; constraints cost the product of the values."""
    over, under = ([f"R{letter}" for letter in letters] for letters in (above, below))
    team = products("ABC", "AB AC", (1, 2))
    robot = placed(ListDPOP, team, name, over[0] if over else None, children=under)
    equip(robot, {"limit": str(limit)})
    for one in over:
        replies(robot, (one, Domain([(1,), (2,)])))
    return robot


def root(limit: int = 100) -> tuple[ListDPOP, list[tuple[str, Message]]]:
    """A when both children have sent their tables: with its first value they have 2 and 3 optima, else one."""
    robot = robot_of("RA", below="BC", limit=limit)
    sizes = CountDimensions({"RA": 2}, 9, 1, FEW, 3)
    replies(robot, ("RB", sizes), ("RC", sizes))
    replies(robot, ("RB", UTIL(1, bytes([4, 4]))), ("RB", Counts(1, bytes([2, 1]))))
    robot.outbox.clear()
    said = replies(robot, ("RC", UTIL(1, bytes([1, 1]))), ("RC", Counts(1, bytes([3, 1]))))
    return robot, said


# The rules


def test_the_root_lists_its_values_and_the_numbers_of_its_childrens_optima() -> None:
    robot, said = root()
    assert robot.listed == [0, 0, 0, 0, 0, 0, 1]
    places = [[0]] * 6 + [[1]]
    assert said == [
        ("RB", ListedValues(places, ["0", "0", "0", "1", "1", "1", "0"])),
        ("RC", ListedValues(places, ["0", "1", "2", "0", "1", "2", "0"])),
    ]


def test_the_first_optimum_is_the_teams() -> None:
    robot, _ = root()
    assert value(robot) == (1,)
    assert robot.findings.count == "7"
    assert robot.findings.listing == Listing([0, 0, 0, 0, 0, 0, 1], 100)


def test_no_more_are_listed_than_wanted() -> None:
    robot, _ = root(limit=4)
    assert robot.listed == [0, 0, 0, 0]
    assert robot.findings.count == "7"


def test_a_robot_takes_the_value_with_the_number_that_it_is_told() -> None:
    robot = robot_of("RB", "A")
    replies(robot, ("RA", Proceed(["RA"])))
    assert replies(robot, ("RA", ListedValues([[0], [1]], ["0", "0"]))) == []
    assert robot.listed == [0, 0]


def test_what_is_said_of_optima_in_words() -> None:
    words = Wording("RA", "RB")
    assert ListedValues([[0], [0], [1]], ["0", "1", "0"]).in_words(words) == (
        "3 optima, with 2 combinations of values of the robots in your separator"
    )


@looped(("message", "why"), [
    (ListedValues([], []), "0 combinations"),
    (ListedValues([[0]], ["0", "0"]), "1 combinations of values, 2 numbers"),
    (ListedValues([[0]] * 101, ["0"] * 101), "101 combinations"),
    (ListedValues([[2]], ["0"]), "are not values"), (ListedValues([[-1]], ["0"]), "are not values"),
    (ListedValues([[0, 0]], ["0"]), "are not values"), (ListedValues([[0]], ["1"]), "has no optimum 1"),
])  # fmt: skip
def test_optima_that_cannot_be_are_refused(message: Message, why: str) -> None:
    robot = robot_of("RB", "A")
    replies(robot, ("RA", Proceed(["RA"])))
    with pytest.raises(ValueError, match=why):
        replies(robot, ("RA", message))


def test_optima_that_come_twice_or_too_early_are_refused() -> None:
    robot = robot_of("RB", "A")
    with pytest.raises(ValueError, match="no table yet"):
        replies(robot, ("RA", ListedValues([[]], ["0"])))
    replies(robot, ("RA", Proceed(["RA"])), ("RA", ListedValues([[0]], ["0"])))
    with pytest.raises(ValueError, match="already has values"):
        replies(robot, ("RA", ListedValues([[0]], ["0"])))


# The run


def look(team: Team, assignment: dict[str, int]) -> Look:
    """What robots see of each other in an assignment."""
    names = sorted(name for robot in team.robots for name in robot.interface)
    return tuple((name, assignment[name]) for name in names)


def different_optima(team: Team) -> set[Look]:
    """The assignments of least cost, as robots see each other, by trying all."""
    found = [*priced_solutions(team)]
    least = min((cost for _, cost in found), default=0)
    return {look(team, assignment) for assignment, cost in found if cost == least}


@count("problems", 15, 2000)
def test_the_optima_are_all_assignments_of_least_cost(problems: int) -> None:
    chance, several, more = Random("list"), 0, 0
    for number in range(problems):
        team = TEAMS[number % len(TEAMS)](chance)
        limit = chance.choice((1, 3, 100, 10_000))
        options = replace(random_options(team, "list-dpop", chance), settings={"limit": str(limit)})
        if chance.random() < 0.3:
            # Another order may take a variable that no constraint needs out of sight.
            team, options = loosened(team, chance), replace(options, order=None)
        outcome, truth = solve(team, options), different_optima(team)
        assert (outcome.verdict is Verdict.NO_SOLUTION) == (not truth)
        if not truth:
            assert outcome.optima is None
            continue
        assert outcome.optima is not None
        listed = [look(team, one) for one in outcome.optima.assignments]
        assert outcome.optima.number == len(truth), (number, team, options)
        assert outcome.optima.assignments[0] == outcome.assignment
        assert len({*listed}) == len(listed) == min(len(truth), limit)
        assert truth.issuperset(listed)
        several += len(truth) > 1
        more += len(truth) > limit
    assert several > problems // 4
    assert more > problems // 20


@count("problems", 3, 100)
def test_the_ways_in_which_as_few_as_possible_withdraw_are_different(problems: int) -> None:
    chance = Random("withdrawal")
    for _ in range(problems):
        team = random_team(chance)
        outcome = solve(team, replace(random_options(team, "list-dpop", chance), withdraw=Withdrawal.MINIMUM))
        assert outcome.optima is not None
        for one in outcome.optima.assignments:
            aside = [robot for robot in team.robots if robot.variables[0].name not in one]
            assert sum(robot.weight for robot in aside) == minimum_withdrawal(team)


def pairs(number: int) -> Team:
    """Pairs of robots that take different ones of two values: two solutions each."""
    names = [f"{letter}{place:02}" for place in range(number) for letter in "AB"]
    return team_of(dict.fromkeys(names, (1, 2)), [differ(f"A{n:02}", f"B{n:02}") for n in range(number)])


def test_optima_of_unconnected_parts_are_combined() -> None:
    outcome = solve(pairs(70), IN_SIMULATOR)
    assert outcome.optima is not None
    assert outcome.optima.number == 2**70
    assert len(outcome.optima.assignments) == 100
    assert f'"number":{2**70}'.encode() in result_json(outcome)
    assert read_result(result_json(outcome)).optima == outcome.optima
    assert f"one of {2**70:,} solutions; the first 100 are listed, the others are:" in outcome_report(
        pairs(70), outcome
    )


def test_all_are_shown_and_a_single_one_is_called_so() -> None:
    pair = team_of({"A": [1, 2], "B": [1, 2]}, [differ("A", "B")])
    assert "one of 2 solutions; all are listed, the others are:\n  2." in outcome_report(
        pair, solve(pair, IN_SIMULATOR)
    )
    lone = team_of({"A": [1]}, [])
    assert "there is no other solution" in outcome_report(lone, solve(lone, IN_SIMULATOR))


def test_processes_and_consistent_domains_list_the_same() -> None:
    team = team_of({"A": [1, 2, 3], "B": [1], "C": [1, 2, 3]}, [differ("A", "B"), differ("A", "C")])
    expected = solve(team, IN_SIMULATOR).optima
    assert expected is not None
    assert expected.number == 4
    after = solve(team, replace(IN_SIMULATOR, preprocess=Preprocess.AC)).optima
    assert after is not None
    assert {*map(str, after.assignments)} == {*map(str, expected.assignments)}
    assert solve(team, Options(protocol="list-dpop")).optima == expected


def test_of_a_robot_that_nobody_sees_one_value_is_listed() -> None:
    optima = solve(team_of({"A": [1, 2, 3]}, []), IN_SIMULATOR).optima
    assert optima == Optima(1, ({"A": 1},))


@looped(
    ("places", "why"),
    [
        ({"RA": [0], "RB": [0, 1]}, "different numbers of assignments, from 1 to 2"),
        ({"RA": [0, 0], "RB": [1, 1]}, "are equal"),
    ],
)
def test_lists_that_do_not_go_together_are_refuted(places: dict[str, list[int]], why: str) -> None:
    pair = team_of({"A": [1, 2], "B": [1, 2]}, [differ("A", "B")])
    told = solve(pair, IN_SIMULATOR)
    findings = {
        name: Findings(place=told.tree[name], listing=Listing(own, 100), count="2" if name == "RA" else None)
        for name, own in places.items()
    }
    result = SearchResult(Verdict.SOLUTION, None, {}, Metrics(), findings=findings)
    with pytest.raises(RefutedError, match=why):
        combined_optima(CompiledTeam(pair), result)


def test_each_listed_optimum_is_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    pair = team_of({"A": [1, 2], "B": [1, 2]}, [differ("A", "B")])
    for wrong, why in (({"A": 1, "B": 1}, "broken by"), ({"A": 1}, "B has no value")):
        listed = [{"A": 1, "B": 2}, wrong]
        monkeypatch.setattr("robochoc.run.evaluation.combined_optima", lambda *_, listed=listed: (2, listed))
        with pytest.raises(RefutedError, match=why):
            solve(pair, IN_SIMULATOR)


def test_a_place_that_is_none_is_a_lie() -> None:
    assert fault_of_findings(Findings(listing=Listing([-1], 1)), ()) == "it has reported impossible optima"
    assert not fault_of_findings(Findings(listing=Listing([0], 1)), ())


def test_the_answer_is_the_first_of_the_list_also_with_a_start() -> None:
    """Otherwise the report would omit the first optimum, and show the start twice."""
    chosen = 0
    for number in range(12):
        team = random_cost_team(Random(number))
        first = solve(team, IN_SIMULATOR)
        if first.optima is None or not first.optima.assignments:
            continue
        optima = first.optima.assignments
        outcome = solve(team, replace(IN_SIMULATOR, start={**optima[-1]}, settings={"limit": "1"}))
        assert outcome.optima is not None
        assert dict(outcome.assignment) == outcome.optima.assignments[0] == optima[0]
        chosen += len(optima) > 1
    assert chosen
