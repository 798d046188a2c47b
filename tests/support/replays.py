"""Recorded runs to be played again: random problems of every family that a protocol can take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from random import Random

import msgspec

from robochoc.journal.events import AnyEvent, Began, Given
from robochoc.journal.journal import Journal, JournalRecorder, read_journal
from robochoc.model.absence import may_count_when_absent
from robochoc.model.orders import Order
from robochoc.model.problem import ConstraintModel, ProblemKind, Team
from robochoc.replay import ReplayResult
from robochoc.run import Options, Withdrawal, solve
from robochoc.run.recording import journal_header
from robochoc.run.registry import protocol_named
from robochoc.solver.ace import AceProcess
from tests.support.allocation_problems import random_allocation_team, simple_allocation_team
from tests.support.asymmetric_problems import random_asymmetric_team
from tests.support.complex_changes import random_complex_changing_team
from tests.support.complex_problems import random_complex_team
from tests.support.cost_problems import random_complex_cost_team, random_cost_team
from tests.support.encrypted_problems import affordable, short_settings
from tests.support.pkc_problems import random_pkc_team
from tests.support.problems import random_team
from tests.support.random_changes import random_changing_team
from tests.support.random_options import random_schedule

ENOUGH = 500
"""Messages after which a run may end."""


def families(protocol: str) -> list[Callable[[Random], Team]]:
    """What makes random teams that `protocol` can take."""
    traits = protocol_named(protocol).traits
    if traits.allocates:
        return [simple_allocation_team, random_allocation_team]
    found: list[Callable[[Random], Team]] = [lambda chance: random_team(chance, n_ary=traits.n_ary)]
    if traits.costs:
        found.append(lambda chance: random_cost_team(chance, n_ary=traits.n_ary))
    if traits.n_ary:
        found.append(random_complex_cost_team if traits.costs else random_complex_team)
        found.append(lambda chance: random_changing_team(chance, 4))
    if traits.partially_known:
        found.append(random_asymmetric_team if traits.asymmetric else random_pkc_team)
    if traits.n_ary and not traits.costs:
        found.append(lambda chance: random_complex_changing_team(chance, 3))
    return found


def random_run(protocol: str, chance: Random, number: int) -> tuple[Team, Options]:
    """A team of the families in turn, and options at random, as far as the protocol and the team leave a choice."""
    makers = families(protocol)
    team = affordable(protocol, lambda: makers[number % len(makers)](chance))
    options = replace(random_schedule(chance), protocol=protocol, messages=ENOUGH, settings=short_settings(protocol, 8))
    if team.dynamic:
        return team, options
    parts = any(one.model is ConstraintModel.PKC for one in team.constraints())
    order = None if parts else chance.choice((None, Order.MIN_WIDTH, Order.RANDOM))
    return team, replace(options, withdraw=withdrawal(protocol, team, chance), order=order)


def withdrawal(protocol: str, team: Team, chance: Random) -> Withdrawal | None:
    """Who may withdraw, if anybody."""
    traits = protocol_named(protocol).traits
    parts = any(one.model is ConstraintModel.PKC for one in team.constraints())
    fewest = not parts and (traits.complete or not traits.costs)
    maximal = team.kind is ProblemKind.DISCSP and not any(
        one.model is ConstraintModel.PKC or may_count_when_absent(one) for one in team.constraints()
    )
    return chance.choice([None, None, *([Withdrawal.MINIMUM] * fewest), *([Withdrawal.MAXIMAL] * maximal)])


def recorded(team: Team, options: Options, solver: AceProcess | None = None) -> Journal:
    """The journal of a run, as it is read."""
    recorder = JournalRecorder(journal_header(team, options))
    recorder.outcome = solve(team, options, observer=recorder, solver=solver)
    return read_journal(recorder.content())


def identical(replayed: ReplayResult) -> bool:
    """Return whether everything was replayed, and identically, or nothing had to be: no robot took a step."""
    return (replayed.identical or replayed.decided_before) and not (replayed.stopped or replayed.unfinished)


def in_text(journal: Journal) -> Journal:
    """`journal` as its text form gives it back: what is not finite is null, and bytes are text."""
    lines = [msgspec.json.encode(event) for event in journal.events]
    return with_events(journal, [msgspec.json.decode(line, type=AnyEvent) for line in lines])


def in_binary(events: list[AnyEvent]) -> list[AnyEvent]:
    """`events` as a binary form gives them back: numbers and bytes are what they were, and tuples are lists."""
    return [msgspec.msgpack.decode(msgspec.msgpack.encode(event), type=AnyEvent) for event in events]


def with_events(journal: Journal, events: Sequence[AnyEvent]) -> Journal:
    return replace(journal, events=tuple(events))


def with_events_as_observed(team: Team, options: Options) -> tuple[Journal, list[AnyEvent]]:
    """The journal of a run, and its events as they were told: in the order in which a journal has them."""
    told: list[AnyEvent] = []
    recorder = JournalRecorder(journal_header(team, options))

    def observe(event: AnyEvent) -> None:
        told.append(event)
        recorder(event)

    solve(team, options, observer=observe)
    runs: list[list[AnyEvent]] = []
    for event in told:
        if isinstance(event, Began):
            runs.append([])
        runs[-1].append(event)
    return read_journal(recorder.content()), [event for run in runs for event in sorted(run, key=lambda one: one.t)]


def without_given(journal: Journal) -> Journal:
    """Return `journal` as older versions wrote it: without what robots were given."""
    return with_events(journal, [event for event in journal.events if not isinstance(event, Given)])
