"""Limits on messages, NCCCs and cycles, with all other options: a run that they end is unknown, and no other answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from random import Random

import pytest

from robochoc.generators.scenario import random_scenario
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits
from robochoc.run import Options, ScheduleName, Withdrawal, solve
from robochoc.run.registry import protocol_named, protocol_names
from robochoc.solver.errors import UnsupportedError
from tests.support.cases import looped
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import short_settings
from tests.support.examples import are_the_same, count, drawn
from tests.support.problems import random_team
from tests.support.random_options import random_options

pytestmark = [pytest.mark.fresh, pytest.mark.usefixtures("quick_encryption")]
PROTOCOLS = [name for name in protocol_names() if protocol_named(name).__module__.startswith("robochoc.")]
TEAMS: dict[str, Callable[[Random, Traits], Team]] = {
    "plain": lambda chance, traits: random_team(chance, n_ary=traits.n_ary),
    "costs": lambda chance, traits: random_cost_team(chance, n_ary=traits.n_ary),
    "several variables": lambda chance, _: random_complex_team(chance),
    "several variables and costs": lambda chance, _: random_complex_cost_team(chance),
    "changing": lambda chance, traits: random_scenario(random_team(chance, n_ary=traits.n_ary), 3, 0.3, 1),
}


@looped("kind", TEAMS)
@count("runs", 30, 600)
def test_a_limited_run_says_nothing_else_than_a_free_one(runs: int, kind: str) -> None:
    ended = 0
    for seed in range(runs):
        chance = drawn(f"limits {kind} {seed}")
        protocol = chance.choice(PROTOCOLS)
        offered = protocol_named(protocol)
        team = TEAMS[kind](chance, offered.traits)
        options = _options(team, protocol, chance)
        try:
            free = solve(team, options)
        except UnsupportedError:
            continue
        limited = _limited(options, chance)
        outcome = solve(team, limited)
        if outcome.verdict is Verdict.UNKNOWN:
            ended += 1
            assert outcome.reason, (kind, seed)
        else:
            said = outcome.verdict, outcome.cost, len(outcome.withdrawn)
            assert said == (free.verdict, free.cost, len(free.withdrawn)), (kind, seed, limited)
        if limited.cycles is not None and options.withdraw is None:  # which is a search of its own
            assert outcome.metrics.cycles <= limited.cycles, (kind, seed)
    assert ended or not are_the_same()


def _options(team: Team, protocol: str, chance: Random) -> Options:
    own = short_settings(protocol, 20)
    options = random_options(team, protocol, chance)
    return replace(options, settings=own, withdraw=chance.choice((None, None, *Withdrawal)))


def _limited(options: Options, chance: Random) -> Options:
    in_step = options.schedule is ScheduleName.CYCLES
    return replace(
        options,
        messages=chance.choice((None, None, 30)),
        ncccs=chance.choice((None, 1, 10, 100)),
        cycles=chance.choice((1, 5, 30)) if in_step else None,
    )
