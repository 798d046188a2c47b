"""Partially known constraints: ABT in a single phase (Brito et al., Constraints 14, 2009), and what it lets be seen."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random

import pytest

from robochoc.communication.processes.processes import ProcessesRun
from robochoc.formats.team_reader import read_team
from robochoc.formats.team_writer import write_team
from robochoc.generators.queens3d import queens3d
from robochoc.model.outcome import Verdict
from robochoc.model.problem import ConstraintModel, Team
from robochoc.protocols.protocol import Protocol
from robochoc.protocols.satisfaction.abt import ABT
from robochoc.protocols.satisfaction.abt_messages import Ok
from robochoc.protocols.satisfaction.disfc import DisFC
from robochoc.protocols.satisfaction.nogood_messages import Nogood
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.solver.agent_problem import agent_problems
from robochoc.solver.errors import UnsupportedError
from robochoc.solver.local_problem import LocalProblem
from tests.support.agents import replies, robot_of, started, started_robot
from tests.support.brute_force import solutions
from tests.support.cases import looped
from tests.support.compiled import plain_python_only
from tests.support.complex_problems import complex_team, random_complex_team
from tests.support.examples import count
from tests.support.limits import HANG_S
from tests.support.pkc_bytes import changed_elsewhere, nothing_hidden, restated, run, watched
from tests.support.pkc_problems import (
    SECRETS,
    check_against_brute_force,
    pkc_pair,
    pkc_part,
    pkc_parts,
    random_pkc_team,
    with_part,
    with_private_parts,
)
from tests.support.problems import ON_ONE_MACHINE, random_team, team_of

agent = partial(started_robot, ABT)

# The rules


def test_the_value_goes_up_too_where_a_pkc_is_shared_and_only_there() -> None:
    constraints = [pkc_part("AC"), replace(pkc_part("BC", name="T"), model=ConstraintModel.TKC)]
    team = team_of(dict.fromkeys("ABC", (1, 2)), constraints)
    assert started(robot_of(ABT, team, "RC")) == [("RA", Ok((1,)))]


def test_the_value_goes_up_where_only_the_parent_holds_a_part() -> None:
    shown = replace(pkc_part("AB", name="T"), model=ConstraintModel.TKC)
    team = with_part(team_of(dict.fromkeys("AB", (1, 2)), [shown]), "RA", "RB", pkc_part("AB", (1, 1)))
    assert LocalProblem(agent_problems(team)["RB"]).pkc_parents == ("RA",)


def test_a_lower_robot_checks_its_own_part() -> None:
    abt = agent(pkc_pair(pkc_part("AB", (1, 1)), pkc_part("AB")), "RB")
    assert replies(abt, ("RA", Ok((1,)))) == [("RA", Ok((2,)))]


def test_a_higher_robot_refuses_a_pair_that_its_part_forbids() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB", (1, 2))), "RA")
    assert replies(abt, ("RB", Ok((1,)))) == []
    assert replies(abt, ("RB", Ok((2,)))) == [("RB", Nogood({"RA": (1,)}, (2,)))]


def test_a_lower_value_is_no_part_of_the_view() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RA")
    replies(abt, ("RB", Ok((1,))))
    assert abt.view == {}


def test_a_new_own_value_is_held_against_what_lower_robots_told() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB", (2, 1))), "RA")
    assert replies(abt, ("RB", Ok((1,)))) == []
    said = replies(abt, ("RB", Nogood({}, (1,))))
    assert said == [("RB", Ok((2,))), ("RB", Nogood({"RA": (2,)}, (1,)))]


def test_each_pair_is_checked_once() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RA")
    replies(abt, ("RB", Ok((1,))))
    assert abt.problem.checks == 1
    replies(abt)
    assert abt.problem.checks == 1


def test_a_refused_value_is_forgotten_until_it_is_told_again() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB", (1, 2))), "RA")
    replies(abt, ("RB", Ok((2,))))
    assert replies(abt) == []
    assert replies(abt, ("RB", Ok((2,)))) == [("RB", Nogood({"RA": (1,)}, (2,)))]


def test_the_refused_robot_accepts_as_in_abt() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RB")
    replies(abt, ("RA", Ok((1,))))
    assert replies(abt, ("RA", Nogood({"RA": (1,)}, (1,)))) == [("RA", Ok((2,)))]


def test_the_refused_robot_answers_a_nogood_that_rests_on_an_old_value() -> None:
    abt = agent(pkc_pair(pkc_part("AB"), pkc_part("AB")), "RB")
    replies(abt, ("RA", Ok((2,))))
    assert replies(abt, ("RA", Nogood({"RA": (1,)}, (1,)))) == [("RA", Ok((1,)))]


def test_a_refusal_names_only_the_variables_that_the_part_looks_at() -> None:
    domains = dict.fromkeys(("a", "A", "b", "B"), (1, 2))
    shown = [replace(pkc_part(pair, name="T"), model=ConstraintModel.TKC) for pair in ("ab", "AB")]
    team = complex_team({"RA": ["a", "A"], "RB": ["b", "B"]}, domains, shown)
    problem = LocalProblem(agent_problems(with_part(team, "RA", "RB", pkc_part("AB", (1, 2))))["RA"])
    assert problem.part_conflict(0, "RB", (1, 2)) == {"RA": (None, 1), "RB": (None, 2)}
    assert problem.part_conflict(0, "RB", (2, 1)) is None


def test_two_parts_that_leave_nothing_together_have_no_solution() -> None:
    team = pkc_pair(pkc_part("AB", (1, 1), (2, 2)), pkc_part("AB", (1, 2), (2, 1)))
    outcome = solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR))
    assert outcome.verdict is Verdict.NO_SOLUTION


def test_who_steps_aside_cannot_be_found_with_pkc() -> None:
    team = pkc_pair(pkc_part("AB", (1, 1)), pkc_part("AB"))
    with pytest.raises(UnsupportedError, match="PKC"):
        solve(team, Options(runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MAXIMAL))


# The truth


@count("teams", 60, 500)
def test_abt_agrees_with_brute_force(teams: int) -> None:
    chance = Random("pkc abt")
    seen = Counter(check_against_brute_force(random_pkc_team(chance), ABT, chance) for _ in range(teams))
    assert min(seen.values()) > teams // 4, seen


@count("teams", 25, 100)
def test_abt_agrees_where_all_is_split_and_n_ary_constraints_stay(teams: int) -> None:
    chance = Random("pkc split")
    for _ in range(teams):
        check_against_brute_force(with_private_parts(random_team(chance), chance), ABT, chance)


@count("teams", 16, 60)
def test_abt_agrees_on_complex_robots(teams: int) -> None:
    chance = Random("pkc complex")
    for _ in range(teams):
        team = with_private_parts(random_complex_team(chance), chance)
        check_against_brute_force(team, ABT, chance)


@count("teams", 20, 80)
def test_splitting_keeps_the_solutions(teams: int) -> None:
    chance = Random("split")
    for _ in range(teams):
        team = random_team(chance)
        assert list(solutions(team)) == list(solutions(with_private_parts(team, chance)))


@count("teams", 12, 50)
def test_teams_with_parts_are_written_and_read_back(tmp_path: Path, teams: int) -> None:
    chance = Random("files")
    for number in range(teams):
        team = random_pkc_team(chance)
        write_team(team, tmp_path / f"{number}")
        again = read_team(tmp_path / f"{number}")
        assert pkc_parts(again) == pkc_parts(team)
        for robot in team.robots:  # domains come back as the longest ranges
            assert replace(again[robot.name], variables=()) == replace(robot, variables=())
            assert [sorted(one.domain) for one in again[robot.name].variables] == [
                sorted(one.domain) for one in robot.variables
            ]


# What is said


@pytest.fixture(scope="module")
def private_queens() -> Team:
    """16 robots, no two of which know of each other why they may not attack."""
    return with_private_parts(queens3d(4), Random("queens"))


def asked_only(team: Team, seed: int, chance: Random) -> tuple[bool, bool]:
    """Change what was not asked: no byte changes. Returns whether there was any, and whether what was asked matters."""
    with pytest.MonkeyPatch.context() as patch:
        asked = watched(team, patch)
        before = run(team, ABT, seed)
    nothing_hidden(ABT, before.envelopes)
    elsewhere = changed_elsewhere(team, asked, chance)
    assert run(elsewhere, ABT, seed).envelopes == before.envelopes
    there = changed_elsewhere(team, asked, chance, there=True)
    return elsewhere != team, run(there, ABT, seed).envelopes != before.envelopes


@plain_python_only
@count("teams", 25, 100)
def test_what_abt_says_depends_on_the_pairs_asked_about_and_on_nothing_else_of_a_part(teams: int) -> None:
    chance = Random("asked")
    seen = Counter(asked_only(random_pkc_team(chance), chance.getrandbits(32), chance) for _ in range(teams))
    assert seen[True, True] > teams // 2, seen


@plain_python_only
def test_what_abt_says_of_queens_depends_on_the_pairs_asked_about(private_queens: Team) -> None:
    assert asked_only(private_queens, 1, Random(1)) == (True, True)


@count("teams", 20, 80)
def test_how_a_part_is_stated_changes_no_byte(teams: int) -> None:
    chance = Random("stated")
    for _ in range(teams):
        team, seed = random_pkc_team(chance), chance.getrandbits(32)
        assert run(restated(team, chance), ABT, seed).envelopes == run(team, ABT, seed).envelopes


def test_how_the_queens_parts_are_stated_changes_no_byte(private_queens: Team) -> None:
    other = restated(private_queens, Random(2))
    assert other != private_queens
    assert run(other, ABT, 2).envelopes == run(private_queens, ABT, 2).envelopes


def test_private_queens_have_no_solution(private_queens: Team) -> None:
    shared = [constraint for robot in private_queens.robots for constraint in robot.shared]
    assert {constraint.model for constraint in shared} == {ConstraintModel.PKC}
    assert len(pkc_parts(private_queens)) == 2 * len(shared)
    assert run(private_queens, ABT, 0).result.verdict is Verdict.NO_SOLUTION


@pytest.mark.more
@looped("protocol", [ABT, DisFC])
def test_private_queens_have_no_solution_in_processes_either(private_queens: Team, protocol: type[Protocol]) -> None:
    assert ProcessesRun(private_queens, protocol).run(HANG_S).verdict is Verdict.NO_SOLUTION


# The example


def test_the_example_is_solved() -> None:
    team = read_team(SECRETS)
    assert {model.model for model in pkc_parts(team).values()} == {ConstraintModel.PKC}
    for runtime in ON_ONE_MACHINE:
        outcome = solve(team, Options(protocol="abt", runtime=runtime, timeout=HANG_S))
        assert (outcome.verdict, outcome.verified) == (Verdict.SOLUTION, True)
