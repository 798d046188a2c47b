"""A run of arrays is the run of the objects in the simulator: values of every cycle, findings, counts."""

from __future__ import annotations

from dataclasses import replace
from random import Random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robochoc.communication.arrays.session import ArraysRun, SimulatedArrays
from robochoc.communication.search_result import SearchResult
from robochoc.communication.simulator.channel import CHANNELS
from robochoc.communication.simulator.schedule import Concurrent
from robochoc.communication.simulator.simulator import Simulation
from robochoc.model.outcome import Metrics, Outcome, Verdict
from robochoc.model.problem import INFINITE, Constraint, Relation, Semantics, Team
from robochoc.run import runtimes, solve
from robochoc.run.incumbent import costs_by_cycle
from robochoc.run.options import Options, Runtime
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import RunParameters
from robochoc.solver.compile import Compiler
from robochoc.solver.compiled_team import CompiledTeam, ensure_compiled
from robochoc.solver.errors import UnsupportedError
from tests.support.array_teams import COUNTS, MAKERS, PROTOCOLS, random_settings
from tests.support.cost_problems import random_cost_team, with_costs
from tests.support.examples import count, examples
from tests.support.problems import team_of


def both(team: Team | CompiledTeam, protocol: str, parameters: RunParameters) -> tuple[SearchResult, SearchResult]:
    """Return the results in the simulator, and in arrays."""
    objects = Simulation(team, protocol_named(protocol), Concurrent(parameters.seed), parameters=parameters)
    return objects.search(), ArraysRun(team, protocol_named(protocol), parameters=parameters).search()


def assert_same(team: Team | CompiledTeam, protocol: str, parameters: RunParameters) -> SearchResult:
    """Both runs are the same. Where Max-Sum proves that there is no solution, the simulator stops in mid-cycle."""
    objects, arrays = both(team, protocol, parameters)
    assert arrays.verdict is objects.verdict
    if protocol == "maxsum" and objects.verdict is Verdict.NO_SOLUTION:
        return arrays
    assert arrays.findings == objects.findings
    assert (arrays.assignments, arrays.witness) == (objects.assignments, objects.witness)
    for name in COUNTS:
        assert getattr(arrays.metrics, name) == getattr(objects.metrics, name), name
    if arrays.verdict is Verdict.SOLUTION:
        trails = {name: found.trail for name, found in arrays.findings.items() if found.trail}
        costs = list(costs_by_cycle(ensure_compiled(team), trails, parameters.withdrawal_cost))
        assert list(arrays.cycle_costs) in (costs, costs[:1])  # without neighbours, there is one cycle
    return arrays


@pytest.mark.parametrize("protocol", PROTOCOLS)
@count("many", 16, 1500)
def test_random_teams_run_as_in_the_simulator(protocol: str, many: int) -> None:
    """Domains of several sizes, some empty; n-ary and hard constraints, unary costs, complex robots, robots alone."""
    with Compiler() as compiler:
        for seed in range(many):
            chance = Random(f"{protocol} {seed}")
            team = CompiledTeam(chance.choice(MAKERS)(chance), lambda robot: compiler.compile(robot).domain)
            assert_same(team, protocol, RunParameters(seed, random_settings(protocol, chance)))


@st.composite
def loose_teams(draw: st.DrawFn) -> Team:
    """Pairs with tables of any costs, several on the same robots; links without costs; robots alone; one value."""
    size = draw(st.integers(1, 6))
    domains = {name: tuple(range(draw(st.integers(1, 4)))) for name in "ABCDEF"[:size]}
    names = list(domains)
    costs = st.sampled_from((0, 0, 1, 2, 70_000, INFINITE))
    constraints = []
    for number in range(draw(st.integers(0, 7)) if size > 1 else 0):
        pair = tuple(draw(st.permutations(names))[:2])
        rows = tuple((one, other) for one in domains[pair[0]] for other in domains[pair[1]])
        paid = tuple(draw(costs) for _ in rows)
        relation = Relation(f"R{number}", 2, Semantics.SOFT, rows, paid, draw(costs))
        constraints.append(Constraint(f"C{number}", relation, pair, pair))
    return with_costs(team_of(domains, constraints))


@pytest.mark.parametrize("protocol", PROTOCOLS)
@given(team=loose_teams(), seed=st.integers(0, 2**70), word=st.integers(0, 1000))
@examples(25, 1000)
def test_any_costs_and_graphs_run_as_in_the_simulator(protocol: str, team: Team, seed: int, word: int) -> None:
    assert_same(team, protocol, RunParameters(seed, random_settings(protocol, Random(word))))


# The simulator, which computes long runs that nobody observes as arrays

LIMITS: tuple[dict[str, Any], ...] = (
    {}, {}, {"timeout": 60}, {"deadline": 60}, {"withdraw": "minimum"}, {"withdraw": "maximal"},
    {"order": "random"}, {"delay": 3}, {"schedule": "cycles"}, {"schedule": "random"}, {"message_loss": 0.2},
    {"channel": next(iter(CHANNELS.values()))}, {"messages": 40}, {"ncccs": 60}, {"preprocess": "ac"},
)  # fmt: skip


def outcome_in(monkeypatch: pytest.MonkeyPatch, team: Team, options: Options, robot_cycles: int) -> Outcome | str:
    """Return the outcome of a run in which arrays are used from this size on, without wall times; or the refusal."""
    monkeypatch.setattr(runtimes, "ROBOT_CYCLES", robot_cycles)
    try:
        found = solve(team, options)
    except UnsupportedError as refusal:
        return str(refusal)
    epochs = tuple(replace(one, metrics=untimed(one.metrics)) for one in found.epochs)
    return replace(found, metrics=untimed(found.metrics), preprocessing=None, epochs=epochs)


def untimed(metrics: Metrics) -> Metrics:
    """Return `metrics` without wall-clock times."""
    return replace(metrics, wall_s=0, compile_s=0)


@count("many", 60, 3000)
def test_the_simulator_has_the_same_outcomes_with_and_without_arrays(
    monkeypatch: pytest.MonkeyPatch, many: int
) -> None:
    """All options that the simulator accepts; `search` is counted, so that arrays are known to be used."""
    searched: list[str] = []
    search = SimulatedArrays.search

    def counted(self: SimulatedArrays, timeout: float | None = None, messages: int | None = None) -> SearchResult:
        searched.append(used)
        return search(self, timeout, messages)

    monkeypatch.setattr(SimulatedArrays, "search", counted)
    for seed in range(many):
        chance = Random(f"outcomes {seed}")
        used = chance.choice(PROTOCOLS)
        settings = random_settings(used, chance) | ({"anytime": "yes"} if chance.random() < 0.1 else {})
        limits = chance.choice(LIMITS)
        options = Options(used, Runtime.SIMULATOR, seed, settings=settings, cache=False, **limits)
        team = chance.choice(MAKERS)(chance)
        arrays, objects = (outcome_in(monkeypatch, team, options, size) for size in (0, 10**12))
        assert arrays == objects, (seed, options)
    assert {*searched} == {*PROTOCOLS}


def test_an_observer_sees_every_message(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtimes, "ROBOT_CYCLES", 0)
    team = random_cost_team(Random(1))
    seen: list[object] = []
    found = solve(team, Options("dsa", Runtime.SIMULATOR, settings={"cycles": "5"}), observer=seen.append)
    assert sum(type(event).__name__ == "Sent" for event in seen) == sum(found.metrics.messages.values()) > 0
