"""Runs protocols on instances of the benchmark set, in the simulator, under a budget."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress

import msgspec

from robochoc import __version__
from robochoc.experiments.digests import digest_of_protocol
from robochoc.experiments.runner import Workers
from robochoc.experiments.task import ASSIGNMENT, Limits, Recording, Row, Setup, Status, Task
from robochoc.experiments.workers import LocalWorkers
from robochoc.journal.reader import read_journal
from robochoc.leaderboard.instances import SET_VERSION, Instance
from robochoc.leaderboard.results import FORMAT, Budget, Entrant, LeaderboardResults, RunResult
from robochoc.leaderboard.saved_runs import FAILED, SavedRuns
from robochoc.model.outcome import Verdict
from robochoc.privacy import Measure, PrivacyError, privacy_of
from robochoc.run.alternatives import without_alternatives
from robochoc.run.distributed import COUNTED_LIMIT
from robochoc.run.options import ScheduleName
from robochoc.run.registry import installed_protocol, installed_spelling, protocol_named
from robochoc.system.plain_text import counted

MEMORY_MB = 4096
"""The memory of a worker; a run that needs more fails."""
_DIGITS = 6
"""The decimal places of the privacy loss: its logarithms may differ between machines beyond them."""


def entrants(names: Sequence[str]) -> list[Entrant]:
    """Return the protocols called `names`, without repetitions.

    Raises:
        UnknownProtocolError: if a protocol is not installed, or cannot be used.
    """
    return [_entrant(name) for name in dict.fromkeys(map(installed_spelling, names))]


def _entrant(name: str) -> Entrant:
    source, offer = digest_of_protocol(protocol_named(name)), installed_protocol(name)
    return Entrant(name=name, package=offer.package, place=offer.place if source else "", source=source)


def run_leaderboard(
    protocols: Sequence[Entrant],
    instances: Sequence[Instance],
    budget: Budget,
    *,
    seed: int = 0,
    jobs: int = 1,
    times: bool = False,
    progress: Callable[[int, int], None] | None = None,
    saved: SavedRuns | None = None,
) -> LeaderboardResults:
    """Run each protocol once on each instance.

    Args:
        protocols: The protocols.
        instances: The instances.
        budget: The limits of each run.
        seed: The seed of all runs.
        jobs: The number of worker processes.
        times: True if processor times are recorded, which differ from run to run.
        progress: Called with the number of finished runs and of all runs.
        saved: Finished runs, which are not repeated. New runs are added.
    """
    pairs = [(one, protocol) for one in instances for protocol in protocols]
    runs = run_pairs(pairs, budget, seed=seed, jobs=jobs, times=times, progress=progress, saved=saved)
    return LeaderboardResults(
        format=FORMAT,
        benchmark_set=SET_VERSION,
        robochoc=__version__,
        seed=seed,
        budget=budget,
        entrants=list(protocols),
        runs=runs,
    )


def run_pairs(
    pairs: Sequence[tuple[Instance, Entrant]],
    budget: Budget,
    *,
    seed: int,
    jobs: int,
    times: bool = False,
    progress: Callable[[int, int], None] | None = None,
    saved: SavedRuns | None = None,
) -> list[RunResult]:
    """Run protocols on instances, and return the results in the order of `pairs`, which are different.

    For the other arguments see `run_leaderboard`.
    """
    saved = saved or SavedRuns()
    missing = [pair for pair in pairs if (pair[0].name, pair[1].name) not in saved.found]
    tasks = [_task(instance, protocol, budget, seed) for instance, protocol in missing]
    where = {task.key: pair for task, pair in zip(tasks, missing, strict=True)}
    by_instance: dict[Instance, list[Task]] = {}
    for (instance, _), task in zip(missing, tasks, strict=True):
        by_instance.setdefault(instance, []).append(task)
    done = len(pairs) - len(missing)
    workers: Workers = LocalWorkers(jobs, MEMORY_MB)
    with workers:
        for task, row in workers.rows(by_instance.values()):
            saved.add(_result(*where[task.key], row, times=times))
            done += 1
            if progress:
                progress(done, len(pairs))
    return [saved.found[instance.name, protocol.name] for instance, protocol in pairs]


def _task(instance: Instance, protocol: Entrant, budget: Budget, seed: int) -> Task:
    schedule = ScheduleName.CONCURRENT if budget.cycles is None else ScheduleName.CYCLES
    setup = Setup(protocol=protocol.name, source=protocol.source, schedule=str(schedule))
    limits = Limits(timeout=budget.time_s, messages=budget.messages, ncccs=budget.ncccs, cycles=budget.cycles)
    record = [Recording.COST_OVER_TIME, ASSIGNMENT, *([Recording.JOURNAL] * instance.group.measures_privacy)]
    return Task(problem=instance.problem, setup=setup, seed=seed, limits=limits, record=tuple(map(str, record)))


def _result(instance: Instance, protocol: Entrant, row: Row, *, times: bool) -> RunResult:
    # If a limit ends a run before the last change, its answer is to another problem.
    is_answer = row.status == Status.DONE or not instance.group.events
    return RunResult(
        instance=instance.name,
        protocol=protocol.name,
        status=row.status,
        reason=_reason(row.reason),
        verdict=None if row.verdict is None else Verdict(row.verdict),
        cost=int(row.cost) if row.cost is not None and is_answer else None,
        assignment=row.assignment if is_answer else {},
        messages=row.messages,
        bytes=row.bytes,
        ncccs=row.ncccs,
        curve=[(point.messages, int(point.cost)) for point in row.cost_over_time],
        privacy=_privacy(row.journal) if row.journal else None,
        cpu_s=row.cpu_s if times else None,
    )


def _reason(reason: str | None) -> str | None:
    """Return a reason without names of other protocols: their number depends on the installed packages."""
    return None if reason is None else without_alternatives(reason)[:1000]


def _privacy(journal: bytes) -> float | None:
    """Return the mean loss over the kinds of secrets in a journal; None if it is not known."""
    with suppress(PrivacyError):
        report = privacy_of(read_journal(journal))
        losses = [report.system_loss(kind, Measure.ENTROPY) for kind in report.kinds()]
        known = [loss for loss in losses if loss is not None]
        if known and len(known) == len(losses):
            return round(sum(known) / len(known), _DIGITS)
    return None


def met_time_limit(run: RunResult) -> bool:
    """Return whether the time limit ended a run, whose results then depend on the machine."""
    return run.status == Status.LIMIT and not (run.reason or "").startswith(COUNTED_LIMIT)


def failures(results: LeaderboardResults) -> Iterator[str]:
    """Yield a sentence for each entrant with runs that failed, which is not the fault of a limit or the problem."""
    for one in results.entrants:
        own = [run for run in results.runs if run.protocol == one.name]
        failed = [run for run in own if run.status in FAILED]
        if failed:
            first = f"first {failed[0].instance}: {failed[0].reason or failed[0].status}"
            yield f"{one.name}: {len(failed):,} of {counted(len(own), 'run')} failed, {first}"


def comparable(run: RunResult) -> RunResult:
    """Return a run without its time and names of other protocols, for comparisons of two runs."""
    return msgspec.structs.replace(run, cpu_s=None, reason=_reason(run.reason))
