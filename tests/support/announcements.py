"""The costs that the observers of a run have seen, and the answer of the run."""

from __future__ import annotations

from collections.abc import Iterable

from robochoc.journal.events import AnyEvent, Improved
from robochoc.journal.journal import read_journal
from robochoc.journal.recorder import JournalRecorder
from robochoc.model.cost_units import Cost
from robochoc.model.costs import normalized
from robochoc.model.outcome import Outcome
from robochoc.model.problem import Team
from robochoc.run import Options, solve
from robochoc.run.known_costs import KnownCosts
from robochoc.run.recording import journal_header, objective_to_record
from robochoc.verification.checker import assignment_cost


def observed(team: Team, options: Options) -> tuple[Outcome, list[AnyEvent], list[Cost]]:
    """Return the outcome of a run, its events in the order of the reports, and all costs that were announced."""
    events: list[AnyEvent] = []
    recorder = JournalRecorder(journal_header(team, options), objective_to_record(team, options))

    def observe(event: AnyEvent) -> None:
        events.append(event)
        recorder(event)

    outcome = solve(team, options, observer=observe)
    costs = [event.cost for event in read_journal(recorder.content()).events if isinstance(event, Improved)]
    make = objective_to_record(team, options)
    assert make is not None
    known = KnownCosts(make())
    for event in events:
        known.add(event)
        costs += [] if known.best is None else [known.best]
    return outcome, events, costs


def best_of(team: Team, costs: Iterable[Cost]) -> Cost:
    return (max if team.user_units.maximize else min)(costs)


def check_announcements(team: Team, options: Options) -> bool:
    """Assert that the answer of a run is the best that was announced; return whether anything was."""
    outcome, _, costs = observed(team, options)
    if not costs:
        return False
    assert outcome.assignment, options
    assert outcome.cost is not None
    assert best_of(team, [outcome.cost, *costs]) == outcome.cost, options
    assert assignment_cost(normalized(team), outcome.assignment) is not None
    return True
