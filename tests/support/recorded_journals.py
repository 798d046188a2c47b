"""Journals of real runs, and traces of them, for the sniffer's tests."""

from __future__ import annotations

from functools import lru_cache
from random import Random

from robochoc.generators.queens3d import queens3d
from robochoc.generators.tasks import tasks
from robochoc.journal.journal import Header, Journal, JournalRecorder, read_journal
from robochoc.model.problem import Team
from robochoc.run import Options, Runtime, ScheduleName, solve
from robochoc.run.registry import protocol_named
from robochoc.sniffer.page_data import PageData
from robochoc.sniffer.trace import Trace
from tests.support.cost_problems import random_cost_team
from tests.support.encrypted_problems import affordable


def record(team: Team, options: Options) -> Journal:
    """The journal of a run, written and read again."""
    recorder = JournalRecorder(
        Header(team=team.name, protocol=options.protocol, runtime=options.runtime, seed=options.seed)
    )
    recorder.outcome = solve(team, options, observer=recorder)
    return read_journal(recorder.content())


@lru_cache(maxsize=2)
def recorded(protocol: str, n: int = 3, schedule: ScheduleName = ScheduleName.CONCURRENT) -> Journal:
    """A short run in the simulator: queens in space, or a few robots with costs or tasks where it is about these."""
    traits = protocol_named(protocol).traits
    team = tasks(4, 4) if traits.allocates else _priced(protocol) if traits.costs else queens3d(n)
    options = Options(protocol=protocol, runtime=Runtime.SIMULATOR, schedule=schedule, messages=2_000, cache=False)
    return record(team, options)


def _priced(protocol: str) -> Team:
    """A few robots with costs: as small as the protocol needs it."""
    chance = Random(5)
    return affordable(protocol, lambda: random_cost_team(chance))


@lru_cache(maxsize=2)
def feed_of(protocol: str, n: int = 3) -> PageData:
    """The feed of that run."""
    return PageData(Trace.of(recorded(protocol, n)))


def words_of(feed: PageData) -> dict[str, set[str]]:
    """The sentences of a run, by the type of the message."""
    found: dict[str, set[str]] = {kind: set() for kind in feed.trace.kinds}
    for message, kind in enumerate(feed.trace.messages.kind):
        found[feed.trace.kinds[kind]].add(feed.words(message))
    return found
