"""Starts with repairs, rules for the answer, counts, bounds and withdrawals, in any combination, and brute force.

All journals are replayed. Robots in processes and on a network are compared too: no run of them may hang.
"""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import replace
from functools import partial
from random import Random
from typing import Any

import pytest

from robochoc.journal.journal import JournalRecorder, read_journal
from robochoc.model.costs import normalized
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.replay import replay
from robochoc.replay.rebuild import CannotReplayError
from robochoc.run import Options, Runtime, Withdrawal, solve
from robochoc.run.options import AnswerRule, Preprocess
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.run.registry import protocol_named, protocol_names
from tests.simulation.drawing import is_refused
from tests.simulation.invariants import violated
from tests.simulation.plan import Plan
from tests.support.brute_force import priced_solutions
from tests.support.encrypted_problems import affordable, short_settings
from tests.support.examples import are_the_same, drawn
from tests.support.loose_problems import loose_team
from tests.support.random_options import random_options

pytestmark = pytest.mark.fresh

ADDED: tuple[dict[str, Any], ...] = (
    {"repair": False},
    {"answer": AnswerRule.FINAL},
    {"count": True},
    {"bounds": True},
    {"messages": 40},
)
RARER: tuple[dict[str, Any], ...] = (
    {"withdraw": Withdrawal.MINIMUM},
    {"withdraw": Withdrawal.MAXIMAL},
    {"preprocess": Preprocess.AC},
)


def _start(team: Team, found: list[tuple[dict[str, int], float]], chance: Random) -> dict[str, int | None]:
    """Return a solution, any assignment, or a part of one."""
    if found and chance.random() < 0.4:
        return {**chance.choice(found)[0]}
    share = chance.choice((0.5, 1.0))
    return {name: chance.choice([*one.domain]) for name, one in team.variables.items() if chance.random() < share}


def _team(protocol: str, chance: Random) -> Team:
    return loose_team(protocol, chance, costs=protocol_named(protocol).traits.costs and chance.random() < 0.6)


def _options(team: Team, protocol: str, start: dict[str, int | None], runtime: Runtime, chance: Random) -> Options:
    """Return options at random that can be combined."""
    kind = protocol_named(protocol)
    settings = short_settings(protocol, chance.choice((1, 8))) if hasattr(kind.settings, "cycles") else {}
    messages = None if settings or kind.traits.complete else 2000
    options = replace(random_options(team, protocol, chance), settings=settings, messages=messages, cache=False)
    if runtime != Runtime.SIMULATOR:
        options = replace(options, runtime=runtime, schedule=Options.schedule, delay=0)
    rarer = [one for one in RARER if chance.random() < 0.15]
    for added in ({"start": start}, *(one for one in ADDED if chance.random() < 0.5), *rarer):
        more = replace(options, **added)
        options = options if is_refused(team, more) else more
    return options


def _solved(team: Team, options: Options) -> Outcome:
    """Return the outcome of a run whose journal is replayed."""
    recorder = JournalRecorder(journal_header(team, options), objective_to_record(normalized(team), options))
    recorder.outcome = outcome = solve(team, options, observer=recorder)
    with suppress(CannotReplayError):  # journals do not contain random keys
        replayed = replay(read_journal(recorder.content()))
        assert not (replayed.steps and replayed.differs), (options, replayed.difference, replayed.contradictions)
    return outcome


@pytest.mark.parametrize(
    ("runtime", "teams"),
    [
        (Runtime.SIMULATOR, 250),
        (Runtime.PROCESSES, 10),
        pytest.param(Runtime.NETWORK, 10, marks=pytest.mark.more),
        *(pytest.param(one, 500, marks=pytest.mark.slow) for one in (Runtime.SIMULATOR, Runtime.PROCESSES)),
        pytest.param(Runtime.NETWORK, 100, marks=pytest.mark.slow),
    ],
)
def test_answers_are_right_with_any_combination(runtime: Runtime, teams: int) -> None:
    seen = Counter[str]()
    counting = [name for name in protocol_names() if protocol_named(name).traits.counts]
    for number in range(teams):
        chance = drawn(f"combined start {number}")
        protocol = chance.choice(counting if chance.random() < 0.3 else protocol_names())
        team = affordable(protocol, partial(_team, protocol, chance))
        found = list(priced_solutions(team))
        options = _options(team, protocol, _start(team, found, chance), runtime, chance)
        outcome = _solved(team, options)
        assert not [*violated(Plan(number, team, options), outcome)], (number, options)
        if outcome.count is not None:
            least = min((cost for _, cost in found), default=0)
            assert outcome.count == sum(cost == least for _, cost in found), (number, options)
        seen.update(name for name in ("start", "bounds", "withdraw", "preprocess") if getattr(options, name))
        seen.update(f"{name} {getattr(options, name)}" for name in ("repair", "answer"))
        seen.update(count=outcome.count is not None)
    if are_the_same() and runtime == Runtime.SIMULATOR:
        assert all(seen.values()), seen
