"""Every protocol that minimises, on every runtime, over random problems and schedules, against brute force."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.model.outcome import Outcome, Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.ace import AceProcess
from robochoc.solver.encoding import UnsupportedError
from tests.support.allocation_problems import ALLOCATING, simple_allocation_team
from tests.support.cost_problems import minimum_withdrawal, random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import affordable
from tests.support.limits import HANG_S
from tests.support.loose_problems import any_order, loosened, minimum_cost
from tests.support.problems import ON_ONE_MACHINE, random_team
from tests.support.random_options import MAX_MESSAGES, on_runtime, random_options

pytestmark = pytest.mark.usefixtures("quick_encryption")
MINIMISING = [name for name in protocol_names() if protocol_named(name).traits.costs]
COMPLETE = [name for name in MINIMISING if protocol_named(name).traits.complete]
INCOMPLETE = [name for name in MINIMISING if name not in COMPLETE]
SHORT = {"cycles": "25"}
"""Of protocols that go through cycles."""
PER_BATCH, FIRST_BATCH = 200, 25
BATCHES = [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 11))]


def team_for(protocol: str, chance: Random) -> Team:
    """A random team that the protocol can take; one in five is of complex robots, half have what nobody needs."""
    n_ary = protocol_named(protocol).traits.n_ary
    if protocol in ALLOCATING:
        return loosened(simple_allocation_team(chance), chance)

    def draw() -> Team:
        complicated = n_ary and chance.random() < 0.2
        return random_complex_cost_team(chance) if complicated else random_cost_team(chance, n_ary=n_ary)

    team = affordable(protocol, draw)
    return loosened(team, chance) if chance.random() < 0.5 else team


@pytest.fixture
def warm(warm_ace: None) -> Iterator[AceProcess]:
    """A solver for complex robots that need not be started for each team."""
    del warm_ace
    with AceProcess() as ace:
        yield ace


def agrees(team: Team, options: Options, warm: AceProcess) -> Outcome:
    """Solve `team`; the cost must be brute force's. `solve` itself has the assignment checked."""
    cost = minimum_cost(team)
    outcome = solve(team, options, solver=warm)
    if cost == INFINITE:
        assert outcome.verdict is Verdict.NO_SOLUTION, (team, options)
    else:
        assert outcome.verdict is Verdict.OPTIMAL, (team, options)
        assert outcome.cost == cost, (team, options)
        assert outcome.verified
    return outcome


@pytest.mark.parametrize("protocol", COMPLETE)
@pytest.mark.parametrize("batch", BATCHES)
def test_the_least_cost_is_found_in_the_simulator(protocol: str, batch: int, warm: AceProcess) -> None:
    chance = Random(f"least {protocol} {batch}")
    seen = {Verdict.OPTIMAL: 0, Verdict.NO_SOLUTION: 0}
    problems = PER_BATCH if batch else FIRST_BATCH
    for _ in range(problems):
        team = team_for(protocol, chance)
        seen[agrees(team, random_options(team, protocol, chance), warm).verdict] += 1
    assert seen[Verdict.NO_SOLUTION] > problems // 100
    assert seen[Verdict.OPTIMAL] > problems // 2


@pytest.mark.parametrize("protocol", COMPLETE)
@pytest.mark.parametrize("batch", [0, *(pytest.param(batch, marks=pytest.mark.slow) for batch in range(1, 4))])
def test_the_least_cost_is_found_in_processes(protocol: str, batch: int, warm: AceProcess) -> None:
    chance = Random(f"costs processes {protocol} {batch}")
    for _ in range(16 if batch else 2):
        team = team_for(protocol, chance)
        agrees(team, Options(protocol=protocol, order=any_order(team, chance), timeout=HANG_S), warm)


@pytest.mark.parametrize("protocol", INCOMPLETE)
@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
@pytest.mark.parametrize("batch", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_what_is_not_proven_is_no_better_than_the_least(
    protocol: str, runtime: Runtime, batch: int, warm: AceProcess
) -> None:
    """And is an answer: its cost is that of its assignment, which breaks nothing hard."""
    chance = Random(f"incomplete {protocol} {runtime} {batch}")
    settings = SHORT if hasattr(protocol_named(protocol).settings, "cycles") else {}
    solved = best = 0
    for _ in range((10, 30)[batch] if runtime is Runtime.SIMULATOR else (3, 5)[batch]):
        team = team_for(protocol, chance)
        cheapest = minimum_cost(team)
        schedule = on_runtime(random_options(team, protocol, chance), runtime)
        outcome = solve(team, replace(schedule, messages=MAX_MESSAGES, settings=settings), solver=warm)
        if cheapest == INFINITE:
            assert outcome.verdict in {Verdict.UNKNOWN, Verdict.NO_SOLUTION}
            assert outcome.cost is None
            continue
        assert outcome.verdict in {Verdict.SOLUTION, Verdict.UNKNOWN} or outcome.cost == cheapest
        if outcome.cost is not None:
            solved += 1
            best += outcome.cost == cheapest
            assert outcome.cost >= cheapest
            assert outcome.verified
    assert solved
    assert best > solved // 4 or runtime is Runtime.PROCESSES


@pytest.mark.parametrize("protocol", COMPLETE)
@pytest.mark.parametrize("teams", [20, pytest.param(60, marks=pytest.mark.slow)])
def test_as_few_as_possible_step_aside(protocol: str, teams: int) -> None:
    """By weight. A team that has a solution flies as a whole."""
    chance = Random(f"fewest {protocol}")
    aside = 0
    for _ in range(teams):
        team = affordable(protocol, partial(random_team, chance, n_ary=protocol_named(protocol).traits.n_ary))
        robots = tuple(replace(robot, weight=chance.choice((1, 1, 2, 3))) for robot in team.robots)
        team = replace(team, robots=robots)
        options = replace(random_options(team, protocol, chance), withdraw=Withdrawal.MINIMUM)
        outcome = solve(team, options)
        assert sum(team[name].weight for name in outcome.withdrawn) == minimum_withdrawal(team)
        assert outcome.verdict is (Verdict.OPTIMAL if outcome.withdrawn else Verdict.SOLUTION)
        assert outcome.verified
        aside += bool(outcome.withdrawn)
    assert teams // 4 < aside < teams


def test_costs_that_do_not_fit_into_messages_are_refused() -> None:
    chance = Random("huge")
    team = random_cost_team(chance)
    dear = Relation("Dear", 1, Semantics.SOFT, (), (), 10**18 - 1)
    first, *others = team.robots
    own = Constraint("D", dear, (first.variables[0].name,), (first.variables[0].name,), model=None)
    team = replace(team, robots=(replace(first, private=(*first.private, *[own] * 10)), *others))
    for protocol in MINIMISING:
        with pytest.raises(UnsupportedError, match="scale them down"):
            solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))
