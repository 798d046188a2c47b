"""Verifies results: computes each cost again, compares answers and claims with published ones, and repeats runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from itertools import groupby

import msgspec

from robochoc.leaderboard.certificates import Certificate, published
from robochoc.leaderboard.claims import claims_proof, wrong_claims
from robochoc.leaderboard.export import checked_team
from robochoc.leaderboard.instances import instance_named
from robochoc.leaderboard.results import Entrant, LeaderboardResults, RunResult, is_peer_name
from robochoc.leaderboard.running import comparable, entrants, met_time_limit, run_pairs
from robochoc.model.change import team_after_events
from robochoc.model.outcome import Verdict
from robochoc.model.problem import Team
from robochoc.protocols.traits import Traits
from robochoc.run.registry import UnknownProtocolError, protocol_named
from robochoc.system.plain_text import counted
from robochoc.verification.checker import RefutedError, check_user_cost, violations

REPETITION_S = 60.0
"""The default time limit of a repeated run, in seconds: results of other people may state any limit."""
_ANSWERS = {Verdict.SOLUTION, Verdict.OPTIMAL}


def wrong_answers(results: LeaderboardResults) -> Iterator[str]:
    """Yield a sentence for each fault of a run that can be found without repeating the run.

    Raises:
        ChangedInstanceError: if a generated team differs from the published list.
    """
    traits = _known_traits(results.entrants)
    for name, runs in groupby(sorted(results.runs, key=lambda run: run.instance), key=lambda run: run.instance):
        team = checked_team(instance_named(name))
        last = team_after_events(team, len(team.scenario))
        for run in runs:
            best = published()[name]
            for fault in (*_faults(run, last, best), *wrong_claims(run, last, best, traits.get(run.protocol))):
                yield f"{run.protocol} on {name}: {fault}"


def has_answer(run: RunResult) -> bool:
    """Return whether a run has an answer: an assignment, or the claim that there is none."""
    return run.verdict == Verdict.NO_SOLUTION or _has_assignment(run)


def _has_assignment(run: RunResult) -> bool:
    # A run that a limit ended is unknown, but has a cost if its best assignment satisfies all hard constraints.
    return run.verdict in _ANSWERS or run.cost is not None


def _known_traits(given: Sequence[Entrant]) -> dict[str, Traits]:
    """Return the traits of the protocols that can be found here, by name."""
    found = {}
    for one in given:
        with suppress(UnknownProtocolError):
            found[one.name] = protocol_named(one.name).traits
    return found


def _faults(run: RunResult, team: Team, best: Certificate) -> Iterator[str]:
    """Yield the reasons why an answer is wrong. `team` is the team at the end of the run."""
    if run.verdict == Verdict.NO_SOLUTION and best.verdict != Verdict.NO_SOLUTION:
        yield f"claims no-solution, but {best.proved_by} found one"
    if not _has_assignment(run):
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
    elif run.verdict == Verdict.OPTIMAL and not best.is_reached_by(run.cost):
        yield f"claims the optimum {run.cost}, but {best.known}"


class Repetition:
    """The runs of a file that are repeated, and the reasons why others are not.

    Only protocols that can be found here are run. Results that name a module do not make robochoc import it.

    Args:
        results: The results.
        number: The number of repeated runs, at equal distances. None: all. Proofs that an incomplete protocol claims
            are also repeated, since its traits do not decide whether it can prove them.
        limit_s: The maximum number of seconds of each repeated run, whatever limit the results state.
    """

    def __init__(self, results: LeaderboardResults, number: int | None, limit_s: float = REPETITION_S) -> None:
        self._results = results
        time_s = min(results.budget.time_s, limit_s)
        self._budget = msgspec.structs.replace(results.budget, time_s=time_s)
        self.remarks: list[str] = []
        self.unfinished = 0
        self.faults: list[str] = []
        self._here: dict[str, Entrant] = {}
        for one in results.entrants:
            self._find(one)
        here = [run for run in results.runs if run.protocol in self._here]
        incomplete = {name for name in self._here if not protocol_named(name).traits.complete}
        proofs = [run for run in here if run.protocol in incomplete and claims_proof(run)]
        chosen = {(run.instance, run.protocol) for run in (*selected(here, number), *proofs)}
        self.runs = [run for run in here if (run.instance, run.protocol) in chosen]

    def _find(self, before: Entrant) -> None:
        """Find the protocol here, with the same source files, to repeat its runs. Otherwise note the reason."""
        runs = counted(sum(run.protocol == before.name for run in self._results.runs), "run")
        if is_peer_name(before.name):
            self.remarks.append(f"{runs} of {before.name} not repeated: only the answers of peers are checked")
            return
        try:
            (now,) = entrants([before.name])
        except UnknownProtocolError as unknown:
            hint = f"its module is not installed; if you trust it, add --protocol {before.place}"
            self.remarks.append(f"{runs} of {before.name} not repeated: {hint if before.place else unknown}")
            return
        if now.name != before.name:
            self.faults.append(f"{before.name}: the protocol is called {now.name}")
            return
        if not now.source and before.source:
            self.faults.append(f"{before.name}: is a protocol of robochoc, but the results have a digest of its files")
        elif now.source != before.source:
            self.remarks.append(f"{runs} of {before.name} not repeated: its files ({now.package}) have changed")
            return
        self._here[before.name] = now

    def changed_runs(self, jobs: int = 1, progress: Callable[[int, int], None] | None = None) -> Iterator[str]:
        """Repeat the runs, and yield a sentence for each one with another result.

        A repeated run that meets the time limit is not compared, but noted in the remarks.

        Args:
            jobs: The number of worker processes.
            progress: Called with the number of finished runs and of all runs.
        """
        yield from self.faults
        pairs = [(instance_named(run.instance), self._here[run.protocol]) for run in self.runs]
        repeated = run_pairs(pairs, self._budget, seed=self._results.seed, jobs=jobs, progress=progress)
        for before, now in zip(self.runs, repeated, strict=True):
            run = f"{before.protocol} on {before.instance}"
            if met_time_limit(now):
                self.unfinished += 1
                limit = f"{self._budget.time_s:g} s: increase --timeout"
                self.remarks.append(f"{run} not compared: it met the time limit of {limit}")
            elif fields := _differences(comparable(before), comparable(now)):
                yield f"{run}: repeated with different {', '.join(fields)}"


def _differences(before: RunResult, now: RunResult) -> list[str]:
    return [one for one in before.__struct_fields__ if getattr(before, one) != getattr(now, one)]


def selected(runs: Sequence[RunResult], number: int | None) -> list[RunResult]:
    """Return `number` runs at equal distances, or all (None)."""
    if number is None or number >= len(runs):
        return list(runs)
    return [runs[place * len(runs) // number] for place in range(number)]
