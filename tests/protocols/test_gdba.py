"""One test per rule of GDBA (Okamoto, Zivan, Nahon, IJCAI 2016), named for it."""

from __future__ import annotations

import itertools
from random import Random

from robochoc.communication.simulator.schedule import Concurrent
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Relation, Semantics, Team
from robochoc.protocols.local_search.gdba import GDBA, MOST, Improve
from robochoc.protocols.local_search.mgm import MGM
from robochoc.protocols.settings import read_settings
from robochoc.protocols.shared.cycles import CycleProtocol, Value
from robochoc.run.incumbent import best_known, costs_by_cycle
from robochoc.solver.compiled_team import CompiledTeam
from tests.support.agents import replies, robot_of, started, value
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import pair, random_cost_team, random_hard_team, weighted_colouring
from tests.support.examples import count
from tests.support.local_search_runs import any_schedule, domains_of, played

VARIANTS = [*itertools.product("AM", ("NZ", "NM", "MX"), "ERCT")]


def robot(team: Team, **settings: str) -> GDBA:
    """A, which begins with the value 1."""
    it = robot_of(GDBA, team, "RA", 0.0)
    it.settings = read_settings(GDBA, settings)  # type: ignore[assignment, misc]
    started(it)
    return it


def cycle(it: GDBA, other: int, told: Improve) -> Improve:
    """Return A's message of a cycle in which B has the value `other`, and tells `told`."""
    ((_, said),) = replies(it, ("RB", Value((other,))))
    replies(it, ("RB", told))
    assert isinstance(said, Improve)
    return said


def test_the_largest_reduction_is_told() -> None:
    assert cycle(robot(pair()), 2, Improve(0, 9)) == Improve(0, 1)


@looped(("told", "moves"), [(Improve(0, 0), True), (Improve(0, 1), True), (Improve(0, 2), False)])
def test_the_largest_among_neighbours_moves_and_of_equals_the_first(told: Improve, moves: bool) -> None:  # noqa: FBT001
    it = robot(pair())
    cycle(it, 2, told)
    assert value(it) == ((2,) if moves else (1,))
    assert not it.raised


def test_modifiers_are_raised_where_neither_it_nor_a_neighbour_gains() -> None:
    it = robot(pair(), violation="NZ")
    cycle(it, 1, Improve(0, 1))
    assert not it.raised
    cycle(it, 1, Improve(0, 0))
    assert it.raised == {0: {(None, None): (0, 1)}}


@looped(("scope", "key"), [("E", (0, (1,))), ("R", (None, (1,))), ("C", (0, None)), ("T", (None, None))])
def test_the_scope_says_which_entries_are_raised(scope: str, key: tuple[object, object]) -> None:
    it = robot(pair(), violation="NZ", scope=scope)
    cycle(it, 1, Improve(0, 0))
    assert it.raised == {0: {key: (0, 1)}}


@looped(("violation", "costs", "raised"), [
    ("NZ", (0, 5, 3, 4), False), ("NZ", (2, 5, 3, 4), True), ("NM", (2, 5, 3, 4), False),
    ("NM", (2, 5, 3, 1), True), ("MX", (2, 5, 3, 4), False), ("MX", (2, 1, 3, 4), False),
    ("MX", (4, 1, 4, 4), True), ("MX", (4, 1, 4, 5), False), ("MX", (INFINITE, 1, INFINITE, 4), True),
    ("MX", (4, 1, 4, INFINITE), False),
])  # fmt: skip
def test_what_is_violated(violation: str, costs: tuple[float, ...], raised: bool) -> None:  # noqa: FBT001
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1), (1, 2), (2, 1), (2, 2)), costs)
    it = robot(pair(relation), violation=violation)
    cycle(it, 1, Improve(0, 0))
    assert bool(it.raised) is raised


@looped(("modifier", "waits"), [("A", (0, 1)), ("M", (1,))])
def test_it_leaves_a_local_minimum_once_it_weighs_enough(modifier: str, waits: tuple[int, ...]) -> None:
    """2 against 3: 2 + 1 gains nothing, 2 + 2 gains 1; 2 * 2 gains 1 at once."""
    it = robot(pair(), modifier=modifier, violation="NZ", scope="E")
    assert cycle(it, 1, Improve(0, 0)) == Improve(0, 0)
    for gained in waits:
        assert value(it) == (1,)
        assert cycle(it, 1, Improve(0, 0)) == Improve(0, gained)
    assert value(it) == (2,)


def test_a_broken_constraint_is_raised_by_a_broken_constraint() -> None:
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1), (2, 1)), (INFINITE, INFINITE), 7)
    for modifier in "AM":
        it = robot(pair(relation), modifier=modifier, scope="E", violation="NZ")
        assert cycle(it, 1, Improve(0, 0)) == Improve(0, 0)
        assert cycle(it, 1, Improve(0, 0)) == Improve(1, 0)
        assert value(it) == (2,)


def test_a_cost_that_outgrows_messages_is_told_as_the_largest() -> None:
    relation = Relation("T", 2, Semantics.SOFT, ((1, 1),), (2**61,), 0)
    it = robot(pair(relation), scope="E")
    it.raised[0] = {(0, (1,)): (0, 9)}
    assert cycle(it, 1, Improve(0, 0)) == Improve(0, MOST)


@looped("scope", "RT")
@looped("violation", ["NZ", "NM", "MX"])
@count("teams", 5, 40)
def test_added_to_all_own_values_alike_it_is_mgm(scope: str, violation: str, teams: int) -> None:
    chance = Random(f"as mgm {scope} {violation}")
    for seed in range(teams):
        team = chance.choice((random_cost_team, random_hard_team))(chance)
        if all(domains_of(team).values()):
            settings = {"modifier": "A", "scope": scope, "violation": violation, "cycles": "15"}
            one = played(team, GDBA, any_schedule(chance), seed, **settings)
            other = played(team, MGM, any_schedule(chance), seed, cycles=15)
            assert one.findings == other.findings
            linked = any(robot.parents or robot.children for robot in team.robots)
            assert (one.metrics.bytes != 0) == linked


@count("teams", 1, 30)
def test_every_variant_comes_close_to_the_least_cost(teams: int) -> None:
    """Costs of cycles are real ones: modifiers are never told as costs."""
    chance = Random("variants")
    optimal = runs = 0
    for seed, variant in itertools.product(range(teams), VARIANTS):
        team = random_cost_team(chance)
        least = least_cost(team)
        if least == INFINITE or not all(domains_of(team).values()):
            continue
        settings = dict(zip(("modifier", "violation", "scope"), variant, strict=True))
        result = played(team, GDBA, Concurrent(seed), seed, **settings, cycles=30)
        assert result.verdict is Verdict.SOLUTION
        found = best_known(CompiledTeam(team), result)
        if found is not None:
            assert found.cost >= least
            runs += 1
            optimal += found.cost == least
    assert optimal > runs // 2


@count("teams", 2, 20)
def test_on_weighted_colourings_it_leaves_the_minima_of_mgm(teams: int) -> None:
    chance = Random("colouring")
    sums: dict[type[CycleProtocol], float] = {GDBA: 0, MGM: 0}
    for seed in range(teams):
        team = weighted_colouring(chance, 14, 5, 3)
        for protocol in sums:
            result = played(team, protocol, Concurrent(seed), seed, cycles=40)
            trails = {name: found.trail for name, found in result.findings.items() if found.trail}
            sums[protocol] += min(costs_by_cycle(CompiledTeam(team), trails))
    assert sums[GDBA] < sums[MGM]
