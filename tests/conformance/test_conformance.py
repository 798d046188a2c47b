"""Every registered protocol, on every runtime, over random problems and schedules, against brute force."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.run_result import RunResult
from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.model.team_edits import constraints_in_force
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.registry import protocol_named
from robochoc.verification.checker import violations
from tests.support.allocation_problems import ANY_TEAM
from tests.support.brute_force import solutions
from tests.support.encrypted_problems import affordable
from tests.support.examples import examples
from tests.support.limits import HANG_S
from tests.support.loose_problems import any_order, loosened, minimum_cost
from tests.support.problems import ON_ONE_MACHINE, random_team
from tests.support.random_options import MAX_MESSAGES, random_options

pytestmark = pytest.mark.usefixtures("quick_encryption")
PER_BATCH, FIRST_BATCH = 300, 90
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 10))]
EVERY_PROTOCOL = pytest.mark.parametrize("protocol", ANY_TEAM)


def part_of(count: int, protocol: str, batch: int) -> int:
    """How many of `count` problems a protocol gets: those that minimise have a suite of their own, and get fewer.

    The fewest in the first batch, which is part of `make test`; incomplete ones always, as their runs are long.
    """
    traits = protocol_named(protocol).traits
    if not traits.costs:
        return count
    return count // (5 if batch == 0 or not traits.complete else 1)


def agrees(team: Team, options: Options) -> Verdict:
    """Solve `team`; the verdict must be brute force's. `solve` itself has the solution checked.

    An incomplete protocol need not come to a verdict; one that it comes to must be right.
    """
    protocol = protocol_named(options.protocol)
    complete = protocol.traits.complete
    if hasattr(protocol.settings, "cycles"):
        options = replace(options, settings={"cycles": "20"})
    outcome = solve(team, options if complete else replace(options, messages=MAX_MESSAGES))
    solvable = minimum_cost(team) < INFINITE
    expected = Verdict.SOLUTION if solvable else Verdict.NO_SOLUTION
    if not complete and outcome.verdict is Verdict.UNKNOWN:
        return expected
    assert outcome.verdict is expected, (team, options)
    assert outcome.verified is solvable
    return outcome.verdict


def team_for(protocol: str, chance: Random) -> Team:
    """A random team that the protocol can take, half of them with links and variables that nobody needs."""
    team = affordable(protocol, partial(random_team, chance, n_ary=protocol_named(protocol).traits.n_ary))
    return loosened(team, chance) if chance.random() < 0.5 else team


@EVERY_PROTOCOL
@pytest.mark.parametrize("batch", BATCHES)
def test_simulator_agrees_with_brute_force(protocol: str, batch: int) -> None:
    chance = Random(f"{protocol} {batch}")
    seen = {Verdict.SOLUTION: 0, Verdict.NO_SOLUTION: 0}
    problems = part_of(PER_BATCH if batch else FIRST_BATCH, protocol, batch)
    for _ in range(problems):
        team = team_for(protocol, chance)
        seen[agrees(team, random_options(team, protocol, chance))] += 1
    assert min(seen.values()) > problems // 4, f"the problems are one-sided: {seen}"


@pytest.mark.slow
@EVERY_PROTOCOL
@given(seed=st.integers(0, 2**32), chance=st.randoms(use_true_random=False))
@examples(30)
def test_simulator_agrees_with_brute_force_and_shrinks(protocol: str, seed: int, chance: Random) -> None:
    """The same as above on new draws each time; what fails is made small."""
    team = team_for(protocol, Random(seed))
    agrees(team, random_options(team, protocol, chance))


@EVERY_PROTOCOL
@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 4))])
def test_processes_agree_with_brute_force(protocol: str, batch: int) -> None:
    chance = Random(f"processes {protocol} {batch}")
    for _ in range(part_of(25 if batch else 3, protocol, batch)):
        team = team_for(protocol, chance)
        agrees(team, Options(protocol=protocol, order=any_order(team, chance), timeout=HANG_S))


@pytest.mark.parametrize("batch", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
def test_withdrawing_leaves_a_placement_that_nobody_could_join(runtime: Runtime, batch: int) -> None:
    chance = Random(f"withdraw {runtime} {batch}")
    wanted = (400 if batch else 60) if runtime is Runtime.SIMULATOR else (25 if batch else 3)
    while wanted:
        team = random_team(chance)
        if next(solutions(team), None):
            continue
        wanted -= 1
        outcome = solve(team, Options(runtime=runtime, withdraw=Withdrawal.MAXIMAL, timeout=HANG_S))
        assert outcome.verdict is Verdict.SOLUTION
        assert outcome.withdrawn
        assert not joinable(team, outcome)


def joinable(team: Team, outcome: Outcome) -> list[str]:
    """By brute force: robots that withdrew although one of their values fits those that fly."""
    fitting = []
    for name in outcome.withdrawn:
        (variable,) = team[name].variables
        for value in variable.domain:
            larger = {**outcome.assignment, variable.name: value}
            in_force = constraints_in_force(team, [other for other in outcome.withdrawn if other != name])
            if all(constraint.allows(larger) for constraint in in_force):
                fitting.append(name)
    return fitting


def test_withdrawing_is_not_asked_of_a_team_that_has_a_solution() -> None:
    chance = Random(0)
    while not next(solutions(team := random_team(chance)), None):
        pass
    outcome = solve(team, Options(runtime=Runtime.SIMULATOR, withdraw=Withdrawal.MAXIMAL))
    assert outcome.withdrawn == ()
    assert not list(violations(team, outcome.assignment))


def test_a_result_joins_clocks_by_the_largest() -> None:
    from robochoc.model.outcome import Metrics  # noqa: PLC0415

    parts = [Metrics({"Ok": 2}, 10, 5, 7), Metrics({"Ok": 1, "Nogood": 1}, 20, 3, 4)]
    joined = RunResult.of(Verdict.SOLUTION, None, {}, parts, 1.5).metrics
    assert joined == Metrics({"Nogood": 1, "Ok": 3}, 30, 5, 11, 1.5)
