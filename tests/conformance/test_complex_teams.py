"""Complex robots: compiled domains, ABT and the central solver against brute force."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from random import Random

import pytest

from robochoc.communication.simulator.schedule import Concurrent, RandomChannels
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.absence import may_count_when_absent
from robochoc.model.orders import with_order
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Robot, Team
from robochoc.model.team_edits import constraints_in_force
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.registry import protocol_named
from robochoc.solver import local_problem
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import CentralSolver
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_domain import CompiledDomain, compile_domain
from robochoc.verification.checker import robots_without_values, violations
from tests.support.brute_force import solutions
from tests.support.complex_problems import random_complex_team
from tests.support.examples import are_the_same, count, drawn
from tests.support.limits import HANG_S
from tests.support.loose_problems import any_order, loosened
from tests.support.random_options import random_schedule
from tests.support.solver_networks import brute_force, compiled_by_brute_force

pytestmark = pytest.mark.fresh


def local_solutions(robot: Robot) -> Iterator[dict[str, int]]:
    """All local solutions of a robot, as its file states them."""
    names = [variable.name for variable in robot.variables]
    for values in itertools.product(*(variable.domain for variable in robot.variables)):
        local = dict(zip(names, values, strict=True))
        if all(constraint.allows(local) for constraint in robot.private):
            yield local


def check_domain(robot: Robot, domain: CompiledDomain) -> None:
    """`domain` has a group for each way that local solutions look from outside, and counts them right."""
    every = list(local_solutions(robot))
    groups = Counter(tuple(local[name] for name in robot.interface) for local in every)
    assert dict(zip(domain.values, domain.counts, strict=True)) == groups
    assert domain.total == len(every)
    assert list(domain.solutions) == sorted(domain.solutions)
    for value, solution in zip(domain.values, domain.solutions, strict=True):
        local = dict(zip(domain.variables, solution, strict=True))
        assert local in every
        assert tuple(local[name] for name in robot.interface) == value


def solved_by_brute_force(team: Team, chance: Random) -> Verdict:
    """ABT's verdict on any schedule, its local problems solved by hand; a solution is held against the files."""
    schedule = RandomChannels(chance.getrandbits(32))
    result = Simulation(compiled_by_brute_force(team), protocol_named("abt"), schedule).run(60)
    if result.verdict is Verdict.SOLUTION:
        assignment = {name: value for own in result.assignments.values() for name, value in own.items()}
        assert not list(violations(team, assignment))
    return result.verdict


@count("teams", 60, 1000)
def test_domains_and_abt_agree_with_brute_force(teams: int) -> None:
    """Without Java: local problems are solved by hand."""
    seen = Counter[Verdict]()
    for number in range(teams):
        chance = drawn(f"complex {number}")
        team = random_complex_team(chance)
        for robot in team.robots:
            check_domain(robot, compile_domain(robot, brute_force))
        team = loosened(team, chance)
        verdict = solved_by_brute_force(with_order(team, any_order(team, chance)), chance)
        assert verdict is (Verdict.SOLUTION if any(solutions(team)) else Verdict.NO_SOLUTION), number
        seen[verdict] += 1
    assert min(seen[Verdict.SOLUTION], seen[Verdict.NO_SOLUTION]) > teams // 8 or not are_the_same(), seen


@pytest.mark.usefixtures("warm_ace")
@count("teams", 25, 1900)
def test_ace_abt_the_judge_and_brute_force_agree(teams: int) -> None:
    seen = Counter[Verdict]()
    with AceProcess(always=True) as solver, Compiler(solver=solver) as compiler:
        for number in range(teams):
            chance = drawn(f"judged {number}")
            team = loosened(random_complex_team(chance), chance)
            for robot in team.robots:
                check_domain(robot, compiler.compile(robot).domain)
            count = sum(1 for _ in solutions(team))
            expected = Verdict.SOLUTION if count else Verdict.NO_SOLUTION
            assert CentralSolver(solver=solver).solve(team, count=True).count == count, number
            assert solve(team, Options(protocol="central", cache=False), solver=solver).verdict is expected, number
            options = replace(random_schedule(chance), cache=False, order=any_order(team, chance))
            assert solve(team, options, solver=solver).verdict is expected, number
            seen[expected] += 1
    assert min(seen.values()) > teams // 8 or not are_the_same(), seen


@pytest.mark.usefixtures("warm_ace")
@pytest.mark.more
@count("teams", 10, 25)
def test_processes_agree_with_brute_force(teams: int) -> None:
    with AceProcess() as solver:
        for number in range(teams):
            chance = drawn(f"complex processes {number}")
            team = loosened(random_complex_team(chance), chance)
            outcome = solve(team, Options(timeout=HANG_S, cache=False, order=any_order(team, chance)), solver=solver)
            assert outcome.verdict is (Verdict.SOLUTION if any(solutions(team)) else Verdict.NO_SOLUTION), number


@pytest.mark.usefixtures("warm_ace")
def test_withdrawing_leaves_a_placement_that_no_robot_could_join() -> None:
    number, wanted = 0, 15
    with AceProcess() as solver:
        while wanted:
            number += 1
            team = random_complex_team(drawn(f"complex withdraw {number}"))
            if any(solutions(team)) or is_restated(team):
                continue
            wanted -= 1
            options = Options(runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MAXIMAL, cache=False)
            outcome = solve(team, options, solver=solver)  # its checker tries to let others join
            assert outcome.withdrawn, number
            for name in outcome.withdrawn:
                assert not any(fits(team, {**outcome.assignment, **own}) for own in local_solutions(team[name])), number


def fits(team: Team, assignment: dict[str, int]) -> bool:
    absent = robots_without_values(team, assignment)
    return all(constraint.allows(assignment) for constraint in constraints_in_force(team, absent))


def is_restated(team: Team) -> bool:
    return any(may_count_when_absent(constraint) for constraint in team.constraints())


@count("teams", 60, 300)
def test_many_values_are_looked_up_as_few_are(teams: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Conflicts of large domains come from numpy tables; the walk over constraints finds and counts the same."""
    for number in range(teams):
        chance = drawn(f"tables {number}")
        team = random_complex_team(chance)
        by_itself = compiled_by_brute_force(team)
        seed = chance.getrandbits(32)
        results = []
        for large in (1, 10**9):
            monkeypatch.setattr(local_problem, "MIN_TABLE_VALUES", large)
            results.append(Simulation(by_itself, protocol_named("abt"), Concurrent(seed, 20)).run(60))
        walked, tables = (replace(result, metrics=replace(result.metrics, wall_s=0)) for result in results)
        assert walked == tables, number
