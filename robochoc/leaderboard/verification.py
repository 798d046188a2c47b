"""Verifies results: computes each cost again, compares each answer with the published one, and repeats runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby

from robochoc.leaderboard.certificates import Certificate, published
from robochoc.leaderboard.export import checked_team
from robochoc.leaderboard.instances import instance_named
from robochoc.leaderboard.results import Entrant, LeaderboardResults, RunResult
from robochoc.leaderboard.running import comparable, entrants, run_leaderboard
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.verification.checker import RefutedError, check_user_cost, violations

_ANSWERS = {Verdict.SOLUTION, Verdict.OPTIMAL}


def wrong_answers(results: LeaderboardResults) -> Iterator[str]:
    """Yield a sentence for each run whose answer is wrong.

    Raises:
        ChangedInstanceError: if a generated team differs from the published list.
    """
    for name, runs in groupby(sorted(results.runs, key=lambda run: run.instance), key=lambda run: run.instance):
        team = checked_team(instance_named(name))
        last = team_after_events(team, len(team.scenario))
        for run in runs:
            for fault in _faults(run, last, published()[name]):
                yield f"{run.protocol} on {name}: {fault}"


def _faults(run: RunResult, team: Team, best: Certificate) -> Iterator[str]:
    """Yield the reasons why an answer is wrong. `team` is the team at the end of the run."""
    if run.verdict == Verdict.NO_SOLUTION and best.verdict != Verdict.NO_SOLUTION:
        yield f"claims no-solution, but {best.proved_by} found one"
    # A run that a limit ended is unknown, but has a cost if its best assignment satisfies all hard constraints.
    if run.verdict not in _ANSWERS and run.cost is None:
        return
    yield from violations(team, run.assignment)
    if any(name not in run.assignment for name in team.variables):
        return
    try:
        check_user_cost(team, run.assignment, run.cost)
    except RefutedError as wrong:
        yield str(wrong)
    if best.cost is None:
        return
    if run.cost is None:
        yield "has an assignment, but no cost"
    elif run.verdict == Verdict.OPTIMAL and run.cost != best.cost:
        yield f"claims the optimum {run.cost}, but {best.proved_by} and {best.agreed_by} proved {best.cost}"


def selected(runs: Sequence[RunResult], number: int | None) -> list[RunResult]:
    """Return `number` runs at equal distances, or all (None)."""
    if number is None or number >= len(runs):
        return list(runs)
    return [runs[place * len(runs) // number] for place in range(number)]


def changed_runs(results: LeaderboardResults, runs: Sequence[RunResult], jobs: int = 1) -> Iterator[str]:
    """Repeat runs, and yield a sentence for each one with another result.

    Raises:
        UnknownProtocolError: if a protocol is not installed.
    """
    by_instance: dict[str, list[RunResult]] = {}
    for run in runs:
        by_instance.setdefault(run.instance, []).append(run)
    yield from _other_sources(results, {run.protocol for run in runs})
    for name, own in by_instance.items():
        named = entrants([run.protocol for run in own])
        repeated = run_leaderboard(named, [instance_named(name)], results.budget, seed=results.seed, jobs=jobs)
        for before, now in zip(own, repeated.runs, strict=True):
            if comparable(before) != comparable(now):
                fields = [
                    one
                    for one in before.__struct_fields__
                    if getattr(comparable(before), one) != getattr(comparable(now), one)
                ]
                yield f"{before.protocol} on {name}: another {', '.join(fields)}"


def _other_sources(results: LeaderboardResults, names: set[str]) -> Iterator[str]:
    """Yield a sentence for each protocol that is installed in another version than that of the results."""
    given: list[Entrant] = [one for one in results.entrants if one.name in names]
    for before, now in zip(given, entrants([one.name for one in given]), strict=True):
        if before.source != now.source:
            yield f"{before.name}: the installed protocol has other source files ({now.package})"
