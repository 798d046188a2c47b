"""What is known of the least cost at every moment of a run: bound <= optimum <= best so far, for every protocol."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from random import Random

import pytest

from robochoc.journal.events import AnyEvent, Bounded
from robochoc.journal.journal import JournalRecorder, read_journal
from robochoc.model.outcome import Verdict
from robochoc.model.problem import INFINITE, Team
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.known_costs import KnownCosts
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.run.registry import protocol_named
from tests.support.allocation_problems import ANY_TEAM
from tests.support.brute_force import least_cost
from tests.support.cases import looped
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import affordable, short_settings

pytestmark = pytest.mark.usefixtures("quick_encryption")
MINIMISING = tuple(name for name in ANY_TEAM if protocol_named(name).traits.costs)
SECRET = {"pc-syncbb"}
"""Complete protocols in which no robot learns the optimum."""
BOUNDING = tuple(name for name in MINIMISING if protocol_named(name).traits.complete and name not in SECRET)
UNPROVEN = tuple(name for name in MINIMISING if name not in {*BOUNDING, "adpop", "bounded-maxsum"})
"""Protocols without bounds; `adpop` and `bounded-maxsum` have bounds and tests of their own."""


def _events(team: Team, options: Options) -> tuple[list[AnyEvent], Verdict]:
    events: list[AnyEvent] = []
    return events, solve(team, options, observer=events.append).verdict


def _moments(team: Team, events: list[AnyEvent]) -> Iterator[KnownCosts]:
    objective = objective_to_record(team, Options())
    assert objective is not None
    known = KnownCosts(objective())
    for event in events:
        known.add(event)
        yield known


def _held(team: Team, options: Options) -> bool:
    """Assert it of one run; return whether anything was known of the optimum before the end."""
    least = least_cost(team)
    events, verdict = _events(team, options)
    known = None
    early = False
    for known in _moments(team, events):
        assert known.bound is None or known.bound <= least, options
        assert known.best is None or least <= known.best, options
        early = early or (known.bound is not None and known.bound < least)
    if known is None:  # a robot alone has no value that is allowed: nobody has said a word
        return False
    if least < INFINITE and verdict is Verdict.OPTIMAL:
        assert known.best == least, options
        assert options.protocol in UNPROVEN or (known.bound or 0) == least, options
    return early


def _options(protocol: str, seed: int, runtime: Runtime = Runtime.SIMULATOR) -> Options:
    schedule = ScheduleName.RANDOM if seed % 2 else ScheduleName.CONCURRENT
    return Options(
        protocol=protocol, runtime=runtime, seed=seed, bounds=True, cache=False, messages=20_000, schedule=schedule
    )


@pytest.mark.parametrize("count", [12, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("protocol", BOUNDING)
def test_that_the_optimum_is_between_the_bound_and_the_best_so_far(protocol: str, count: int) -> None:
    chance, early = Random(f"bounds {protocol} {count}"), 0
    for seed in range(count):
        draw = random_cost_team if seed % 4 else random_complex_cost_team
        team = affordable(protocol, partial(draw, chance))
        early += _held(team, _options(protocol, seed))
    assert early or "dpop" in protocol  # which knows nothing until it knows all


@looped("protocol", UNPROVEN)
def test_that_nothing_is_told_by_protocols_that_prove_nothing(protocol: str) -> None:
    chance = Random(protocol)
    settings = short_settings(protocol, 10)
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, bounds=True, settings=settings)
    for seed in range(3):
        team = affordable(protocol, partial(random_cost_team, chance, n_ary=False))
        events, _ = _events(team, replace(options, seed=seed))
        assert not any(isinstance(event, Bounded) for event in events)


@pytest.mark.slow
@looped("protocol", BOUNDING)
def test_that_it_holds_among_processes(protocol: str) -> None:
    chance = Random(f"processes {protocol}")
    for seed in range(4):
        team = affordable(protocol, partial(random_cost_team, chance))
        _held(team, Options(protocol=protocol, seed=seed, bounds=True, cache=False))


@looped("protocol", BOUNDING)
def test_that_a_journal_has_bounds_where_they_are_asked_for_and_is_the_same_otherwise(protocol: str) -> None:
    chance = Random(5)
    team = affordable(protocol, partial(random_cost_team, chance))

    def journal(*, bounds: bool) -> bytes:
        options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, bounds=bounds, cache=False)
        recorder = JournalRecorder(journal_header(team, options))
        solve(team, options, observer=recorder)
        return recorder.content()

    plain, bounded = read_journal(journal(bounds=False)), read_journal(journal(bounds=True))
    assert (plain.header.version, bounded.header.version) == (2, 3)
    assert any(isinstance(event, Bounded) for event in bounded.events)
    assert plain.events == tuple(event for event in bounded.events if not isinstance(event, Bounded))
