"""Every registered protocol on random problems, in all runtimes, against brute force."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.search_result import SearchResult
from robochoc.model.orders import Order
from robochoc.model.outcome import Metrics, Outcome, Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.model.team_edits import constraints_in_force
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.ace import AceProcess
from robochoc.solver.errors import UnsupportedError
from robochoc.verification.checker import violations
from tests.support.allocation_problems import ANY_TEAM, simple_allocation_team
from tests.support.brute_force import solutions
from tests.support.cases import cases, looped
from tests.support.cost_problems import minimum_withdrawal, random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import affordable
from tests.support.examples import are_the_same, count, drawn, examples
from tests.support.limits import HANG_S
from tests.support.loose_problems import (
    any_order,
    check_against_brute_force,
    loose_team,
    loosened,
    minimum_cost,
    turned_interface,
)
from tests.support.problems import ON_ONE_MACHINE, random_team
from tests.support.random_options import random_options

pytestmark = [pytest.mark.fresh, pytest.mark.usefixtures("quick_encryption")]
FAMILIES = ("abt", "afc-ng", "sfb", "dpop", "p2-dpop", "mgm2", "acls", "cbba")
"""Protocols whose runs in processes belong to `make test`."""
MINIMISING = [name for name in protocol_names() if protocol_named(name).traits.costs]
COMPLETE = [name for name in MINIMISING if protocol_named(name).traits.complete]


def hard_team(protocol: str, chance: Random) -> Team:
    """Return a random team that the protocol accepts; half have links and variables that no constraint needs."""
    team = affordable(protocol, partial(random_team, chance, n_ary=protocol_named(protocol).traits.n_ary))
    return loosened(team, chance) if chance.random() < 0.5 else team


def cost_team(protocol: str, chance: Random) -> Team:
    """Return a random team with costs; one in five is of complex robots, half are loosened as well."""
    traits = protocol_named(protocol).traits
    if traits.allocates:
        return loosened(simple_allocation_team(chance), chance)

    def draw() -> Team:
        complicated = traits.n_ary and chance.random() < 0.2
        return random_complex_cost_team(chance) if complicated else random_cost_team(chance, n_ary=traits.n_ary)

    team = affordable(protocol, draw)
    return loosened(team, chance) if chance.random() < 0.5 else team


def varied_team(protocol: str, chance: Random) -> Team:
    """Return a random loosened team of any kind: several variables, costs, privately known constraints."""
    costs = protocol_named(protocol).traits.costs and chance.random() < 0.7
    return loose_team(protocol, chance, costs=costs)


KINDS: Mapping[str, Callable[[str, Random], Team]] = {"hard": hard_team, "costs": cost_team, "varied": varied_team}


def problems(protocol: str) -> dict[str, tuple[int, int]]:
    """Return how many problems of each kind a protocol gets in `make test`, and in `make test-slow`."""
    traits = protocol_named(protocol).traits
    if traits.allocates:
        return {"costs": (12, 40)}
    if not traits.costs:
        return {"hard": (40, 2700), "varied": (3, 2000)}
    if not traits.complete:  # runs are long
        return {"hard": (5, 180), "costs": (7, 40), "varied": (2, 2000)}
    return {"hard": (8, 2700), "costs": (14, 2000), "varied": (2, 2000)}


@pytest.fixture
def warm(warm_ace: None) -> Iterator[AceProcess]:
    """A solver for complex robots that is started once."""
    del warm_ace
    with AceProcess() as ace:
        yield ace


@pytest.mark.parametrize("protocol", protocol_names())
@count("batch", 0, 1)
def test_simulator_agrees_with_brute_force(protocol: str, batch: int, warm: AceProcess) -> None:
    """An incomplete protocol finds the best answer now and then."""
    complete = protocol_named(protocol).traits.complete
    with_answer, without, best = Counter[str](), Counter[str](), 0
    with cases() as each:
        for kind, counts in problems(protocol).items():
            for number in range(counts[batch]):
                with each(name := f"{kind} {protocol} {number}"):
                    chance = drawn(name)
                    team = KINDS[kind](protocol, chance)
                    outcome = check_against_brute_force(team, random_options(team, protocol, chance), warm)
                    (without if outcome.cost is None else with_answer)[kind] += 1
                    best += not complete and kind == "costs" and outcome.cost == minimum_cost(team)
    if complete and are_the_same():
        assert min(with_answer["hard"], without["hard"]) > problems(protocol)["hard"][batch] // 9
        assert with_answer["costs"] >= without["costs"]
    elif are_the_same():
        assert best > (with_answer["costs"] // 4 if batch else 0) or "costs" not in problems(protocol)


def test_problems_with_costs_have_no_solution_now_and_then() -> None:
    least = [minimum_cost(cost_team("dpop", Random(f"some {number}"))) for number in range(80)]
    assert 2 < least.count(INFINITE) < 40


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ANY_TEAM)
@given(seed=st.integers(0, 2**32), chance=st.randoms(use_true_random=False))
@examples(30)
def test_simulator_agrees_with_brute_force_and_shrinks(protocol: str, seed: int, chance: Random) -> None:
    """The same as above; what fails is made small."""
    team = hard_team(protocol, Random(seed))
    check_against_brute_force(team, random_options(team, protocol, chance))


@pytest.mark.parametrize(
    "protocol", [name if name in FAMILIES else pytest.param(name, marks=pytest.mark.more) for name in protocol_names()]
)
@count("batch", 0, 1)
def test_processes_agree_with_brute_force(protocol: str, batch: int, warm: AceProcess) -> None:
    with cases() as each:
        for kind in problems(protocol):
            for number in range((2 if protocol in FAMILIES else 1, 70)[batch]):
                with each(name := f"processes {kind} {protocol} {number}"):
                    chance = drawn(name)
                    team = KINDS[kind](protocol, chance)
                    options = Options(protocol=protocol, order=any_order(team, chance), timeout=HANG_S)
                    check_against_brute_force(team, options, warm)


@pytest.mark.slow
@pytest.mark.parametrize("protocol", protocol_names())
def test_the_network_agrees_with_brute_force(protocol: str) -> None:
    with cases() as each:
        for number in range(20):
            with each(name := f"network {protocol} {number}"):
                chance = drawn(name)
                team = varied_team(protocol, chance)
                options = Options(protocol=protocol, order=any_order(team, chance), runtime=Runtime.NETWORK)
                check_against_brute_force(team, options)


@looped("protocol", ANY_TEAM)
def test_a_turned_link_takes_a_variable_out_of_sight(protocol: str) -> None:
    """Domains were once compiled from the team in the files: eleven protocols found no solution, five crashed."""
    team = turned_interface()
    orders: list[Order | tuple[str, ...]] = [("C", "A", "B"), ("B", "C", "A"), Order.RANDOM]
    settings = {"cycles": "20"} if protocol == "p-dsa" else {}  # in a few cycles, both ends may always move together
    for order in orders:
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, order=order, settings=settings)
        assert check_against_brute_force(team, options).verdict is Verdict.SOLUTION


@count("teams", 12, 60)
@looped("protocol", COMPLETE)
def test_as_few_as_possible_step_aside(protocol: str, teams: int) -> None:
    """By weight. A team that has a solution flies as a whole."""
    aside = 0
    for number in range(teams):
        chance = drawn(f"fewest {protocol} {number}")
        team = affordable(protocol, partial(random_team, chance, n_ary=protocol_named(protocol).traits.n_ary))
        robots = tuple(replace(robot, weight=chance.choice((1, 1, 2, 3))) for robot in team.robots)
        team = replace(team, robots=robots)
        options = replace(random_options(team, protocol, chance), withdraw=Withdrawal.MINIMUM)
        outcome = solve(team, options)
        assert sum(team[name].weight for name in outcome.withdrawn) == minimum_withdrawal(team), number
        assert outcome.verdict is (Verdict.OPTIMAL if outcome.withdrawn else Verdict.SOLUTION), number
        assert outcome.verified, number
        aside += bool(outcome.withdrawn)
    assert 0 < aside < teams or not are_the_same()


@count("batch", 0, 1)
@pytest.mark.parametrize("runtime", ON_ONE_MACHINE)
def test_withdrawing_leaves_a_placement_that_nobody_could_join(runtime: Runtime, batch: int) -> None:
    wanted = (400 if batch else 60) if runtime is Runtime.SIMULATOR else (25 if batch else 3)
    number = 0
    while wanted:
        number += 1
        team = random_team(drawn(f"withdraw {runtime} {batch} {number}"))
        if next(solutions(team), None):
            continue
        wanted -= 1
        outcome = solve(team, Options(runtime=runtime, withdraw=Withdrawal.MAXIMAL, timeout=HANG_S))
        assert outcome.verdict is Verdict.SOLUTION, number
        assert outcome.withdrawn, number
        assert not joinable(team, outcome), number


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


def test_costs_that_do_not_fit_into_messages_are_refused() -> None:
    team = random_cost_team(Random("huge"))
    dear = Relation("Dear", 1, Semantics.SOFT, (), (), 10**18 - 1)
    first, *others = team.robots
    own = Constraint("D", dear, (first.variables[0].name,), (first.variables[0].name,), model=None)
    team = replace(team, robots=(replace(first, private=(*first.private, *[own] * 10)), *others))
    for protocol in MINIMISING:
        with pytest.raises(UnsupportedError, match="scale the costs down"):
            solve(team, Options(protocol=protocol, runtime=Runtime.SIMULATOR))


def test_a_result_joins_clocks_by_the_largest() -> None:
    parts = [Metrics({"Ok": 2}, 10, 5, 7), Metrics({"Ok": 1, "Nogood": 1}, 20, 3, 4)]
    joined = SearchResult.of(Verdict.SOLUTION, None, {}, parts, 1.5).metrics
    assert joined == Metrics({"Nogood": 1, "Ok": 3}, 30, 5, 11, 1.5)
