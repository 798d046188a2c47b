"""Searches that begin from an assignment: whatever it is, the answer is the one that brute force finds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from random import Random

import pytest

from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.replay import replay
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.verification.checker import violations
from tests.support.asymmetric_problems import random_asymmetric_team, random_pkc_options
from tests.support.brute_force import priced_solutions, solutions
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import minimum_withdrawal, random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import short_settings
from tests.support.examples import are_the_same, count, drawn
from tests.support.problems import random_team
from tests.support.random_options import random_options, random_schedule
from tests.support.real_costs import best_cost, random_costs_team
from tests.support.replays import identical, recorded

pytestmark = pytest.mark.fresh
Values = Mapping[str, int | None]


def _protocols(*, asymmetric: bool = False) -> list[str]:
    """Return the complete protocols that can use an upper bound."""
    traits = {name: protocol_named(name).traits for name in protocol_names()}
    return [name for name, one in traits.items() if one.upper_bound and one.asymmetric == asymmetric]


def _any_assignment(team: Team, chance: Random) -> dict[str, int | None]:
    return {name: chance.choice([*one.domain]) for name, one in team.variables.items() if one.domain}


def _start(team: Team, found: list[tuple[dict[str, int], float]], chance: Random) -> tuple[str, dict[str, int | None]]:
    """Return a start and its kind: a best or any solution, any assignment, a part of one, or foreign values."""
    kind = chance.choice(("best", "solution", "any", "part", "foreign"))
    if kind == "best" and found:
        return kind, {**min(found, key=lambda one: one[1])[0]}
    if kind == "solution" and found:
        return kind, {**chance.choice(found)[0]}
    values = _any_assignment(team, chance)
    if kind == "part":
        return kind, {name: value for name, value in values.items() if chance.random() < 0.5}
    if kind == "foreign":
        return kind, {name: 99 if chance.random() < 0.2 else value for name, value in values.items()} | {"nobody": 1}
    return "any", values


def _check_minimum(team: Team, options: Options, least: float) -> Outcome:
    outcome = solve(team, options)
    if least == INFINITE:
        assert outcome.verdict is Verdict.NO_SOLUTION, (team, options)
    else:
        assert (outcome.verdict, outcome.cost) == (Verdict.OPTIMAL, least), (team, options, outcome)
        assert outcome.verified
        assert outcome.witness is None
    return outcome


def _settings(protocol: str, chance: Random) -> dict[str, str]:
    if protocol == "sfb" and chance.random() < 0.5:
        return {"batch": chance.choice("128"), "window": chance.choice("12")}
    return {}


@count("teams", 60, 600)
def test_the_minimum_is_found_from_any_start(teams: int) -> None:
    seen = Counter[str]()
    protocols = _protocols()
    assert len(protocols) > 9
    for number in range(teams):
        chance = drawn(f"start {number}")
        team = random_cost_team(chance)
        found = list(priced_solutions(team))
        least = min((cost for _, cost in found), default=INFINITE)
        kind, start = _start(team, found, chance)
        seen[kind] += 1
        for protocol in chance.sample(protocols, 4):
            options = replace(random_options(team, protocol, chance), start=start, settings=_settings(protocol, chance))
            outcome = _check_minimum(team, options, least)
            if kind == "best" and found:
                assert dict(outcome.assignment) == start
    if are_the_same():
        assert min(seen.values()) > 5


@count("teams", 25, 250)
def test_asymmetric_costs_are_minimised_from_any_start(teams: int) -> None:
    protocols = _protocols(asymmetric=True)
    assert len(protocols) == 3
    for number in range(teams):
        chance = drawn(f"asymmetric start {number}")
        team = random_asymmetric_team(chance, simple=True)
        found = list(priced_solutions(team))
        start = _start(team, found, chance)[1]
        for protocol in protocols:
            options = replace(random_pkc_options(team, protocol, chance), start=start)
            _check_minimum(team, options, min((cost for _, cost in found), default=INFINITE))


@count("teams", 40, 400)
def test_the_users_costs_are_optimal_from_any_start(teams: int) -> None:
    """Decimal, negative and maximised costs."""
    protocols = _protocols()
    for number in range(teams):
        chance = drawn(f"start with real costs {number}")
        team = random_costs_team(number)
        best = best_cost(team)
        protocol = chance.choice(protocols)
        start = _start(team, list(priced_solutions(team)) if team.robots[0].costs.places == 0 else [], chance)[1]
        outcome = solve(team, replace(random_schedule(chance), protocol=protocol, start=start))
        cost = None if outcome.cost is None else Fraction(outcome.cost)
        assert (outcome.verdict, cost) == ((Verdict.NO_SOLUTION, None) if best is None else (Verdict.OPTIMAL, best)), (
            number
        )


@count("teams", 30, 300)
def test_as_few_robots_withdraw_from_any_start(teams: int) -> None:
    protocols = _protocols()
    for number in range(teams):
        chance = drawn(f"withdrawal start {number}")
        team = random_team(chance)
        weights = {robot.name: robot.weight for robot in team.robots}
        least = minimum_withdrawal(team)
        start = _any_assignment(team, chance)
        for protocol in chance.sample(protocols, 2):
            for _ in range(2):  # the second time from the answer, with those that withdraw
                options = replace(random_options(team, protocol, chance), start=start, withdraw=Withdrawal.MINIMUM)
                outcome = solve(team, options)
                assert sum(weights[name] for name in outcome.withdrawn) == least, (number, options)
                start = dict.fromkeys(team.variables) | dict(outcome.assignment)


@count("teams", 30, 300)
def test_incomplete_protocols_return_nothing_worse_than_their_start(teams: int) -> None:
    traits = {name: protocol_named(name).traits for name in protocol_names()}
    local = [n for n, one in traits.items() if one.costs and not one.complete and not one.allocates and one.n_ary]
    for number in range(teams):
        chance = drawn(f"local start {number}")
        team = random_cost_team(chance)
        found = list(priced_solutions(team))
        if not found:
            continue
        start, cost = chance.choice(found)
        for protocol in chance.sample(local, 3):
            settings = short_settings(protocol, 5)
            outcome = solve(team, replace(random_schedule(chance), protocol=protocol, start=start, settings=settings))
            assert outcome.cost is not None
            assert outcome.cost <= cost, (number, protocol)


@pytest.mark.parametrize("protocol", ["dsa", "mgm", "mgm2"])
def test_arrays_begin_as_robots_do(protocol: str) -> None:
    for number in range(12):
        chance = drawn(f"arrays from a start {number}")
        team = random_cost_team(chance)
        start = _start(team, list(priced_solutions(team)), chance)[1]
        options = Options(protocol=protocol, start=start, seed=number, settings={"cycles": "6"})
        one, other = (solve(team, replace(options, runtime=one)) for one in (Runtime.SIMULATOR, Runtime.ARRAYS))
        assert (one.assignment, one.cost, one.metrics.messages) == (
            other.assignment,
            other.cost,
            other.metrics.messages,
        ), (number, start)


@count("teams", 60, 600)
def test_problems_without_costs_are_solved_from_any_start(teams: int) -> None:
    traits = {name: protocol_named(name).traits for name in protocol_names()}
    protocols = [
        n for n, one in traits.items() if one.complete and one.n_ary and not one.encrypted_tables and not one.allocates
    ]
    for number in range(teams):
        chance = drawn(f"start without costs {number}")
        team = random_team(chance)
        found = [(one, 0.0) for one in solutions(team)]
        start = _start(team, found, chance)[1]
        for protocol in chance.sample(protocols, 4):
            outcome = solve(team, replace(random_options(team, protocol, chance), start=start))
            assert outcome.verdict is (Verdict.SOLUTION if found else Verdict.NO_SOLUTION), (number, protocol)


def test_robots_of_several_variables_begin_from_a_start() -> None:
    for number in range(15):
        chance = drawn(f"wide start {number}")
        team = random_complex_cost_team(chance)
        found = list(priced_solutions(team))
        start = _start(team, found, chance)[1]
        protocol = chance.choice(_protocols())
        _check_minimum(
            team,
            replace(random_options(team, protocol, chance), start=start),
            min((cost for _, cost in found), default=INFINITE),
        )


def test_journals_contain_the_start() -> None:
    """Replays begin from it too."""
    protocols = [*_protocols(), "dsa", "mgm2", "d-gibbs"]
    for number in range(30):
        chance = drawn(f"replayed start {number}")
        team = random_cost_team(chance)
        start = _start(team, list(priced_solutions(team)), chance)[1]
        protocol = chance.choice(protocols)
        settings = short_settings(protocol, 8)
        options = replace(random_options(team, protocol, chance), start=start, settings=settings)
        assert identical(replay(recorded(team, options))), (number, options)


@pytest.mark.parametrize("runtime", [Runtime.PROCESSES, pytest.param(Runtime.NETWORK, marks=pytest.mark.more)])
def test_robots_in_processes_receive_their_start_values(runtime: Runtime) -> None:
    chance = drawn("start in processes")
    team, found = next(
        (team, found)
        for team in iter(lambda: random_cost_team(chance), None)
        if (found := list(priced_solutions(team)))
    )
    best, cost = min(found, key=lambda one: one[1])
    outcome = solve(team, Options(protocol="mgm", runtime=runtime, start=best, settings={"cycles": "3"}))
    assert dict(outcome.assignment) == best
    proven = solve(team, Options(protocol="syncbb", runtime=runtime, start=best))
    assert (proven.verdict, proven.cost, dict(proven.assignment)) == (Verdict.OPTIMAL, cost, best)


def test_a_solution_is_kept() -> None:
    """ABT's robots try their start values first, so none of them changes a solution."""
    kept = 0
    for number in range(40):
        chance = drawn(f"kept start {number}")
        team = random_complex_team(chance)
        found = list(solutions(team))
        if not found:
            continue
        start = chance.choice(found)
        outcome = solve(team, Options(protocol="abt", runtime=Runtime.SIMULATOR, start=start))
        shown = {name for robot in team.robots for name in robot.interface}
        assert {name: outcome.assignment[name] for name in shown} == {name: start[name] for name in shown}
        assert not list(violations(team, outcome.assignment))
        assert "Nogood" not in outcome.metrics.messages
        kept += 1
    assert kept > 10
