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
from robochoc.privacy import Measure, PrivacyError, privacy_of
from robochoc.run.distributed import COUNTED_LIMIT
from robochoc.run.options import ScheduleName
from robochoc.run.registry import installed_protocol, installed_spelling, protocol_named
from robochoc.system.plain_text import counted

MEMORY_MB = 4096
"""The memory of a worker; a run that needs more fails."""
_FAILED = {Status.LOST, Status.REFUTED, Status.MEMORY, Status.CRASHED, Status.ERROR}
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
    """
    by_instance = [[_task(one, protocol, budget, seed) for protocol in protocols] for one in instances]
    tasks = [task for bundle in by_instance for task in bundle]
    places = {task.key: place for place, task in enumerate(tasks)}
    where = [(one, protocol) for one in instances for protocol in protocols]
    found: dict[int, RunResult] = {}
    workers: Workers = LocalWorkers(jobs, MEMORY_MB)
    with workers:
        for task, row in workers.rows(by_instance):
            place = places[task.key]
            instance, protocol = where[place]
            found[place] = _result(instance, protocol, row, times=times)
            if progress:
                progress(len(found), len(tasks))
    return LeaderboardResults(
        format=FORMAT,
        benchmark_set=SET_VERSION,
        robochoc=__version__,
        seed=seed,
        budget=budget,
        entrants=list(protocols),
        runs=[found[place] for place in range(len(tasks))],
    )


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
        reason=None if row.reason is None else row.reason[:1000],
        verdict=row.verdict,
        cost=int(row.cost) if row.cost is not None and is_answer else None,
        assignment=row.assignment if is_answer else {},
        messages=row.messages,
        bytes=row.bytes,
        ncccs=row.ncccs,
        curve=[(point.messages, int(point.cost)) for point in row.cost_over_time],
        privacy=_privacy(row.journal) if row.journal else None,
        cpu_s=row.cpu_s if times else None,
    )


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
        failed = [run for run in own if run.status in _FAILED]
        if failed:
            first = f"first {failed[0].instance}: {failed[0].reason or failed[0].status}"
            yield f"{one.name}: {len(failed):,} of {counted(len(own), 'run')} failed, {first}"


def comparable(run: RunResult) -> RunResult:
    """Return a run without its time, for comparisons of two runs."""
    return msgspec.structs.replace(run, cpu_s=None)
