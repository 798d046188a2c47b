"""The plan of a study: all its runs, in the order of the study's file."""

from __future__ import annotations

from collections.abc import Iterator

from robochoc.experiments.study import Study
from robochoc.experiments.task import Task
from robochoc.system.errors import RobochocError

MAX_RUNS = 1_000_000


class TooManyRunsError(RobochocError, ValueError):
    """The study has too many runs for one file of results."""


def plan_of(study: Study) -> dict[str, Task]:
    """Return the runs of a study by key. The runs on one problem follow each other.

    Raises:
        TooManyRunsError: if there are more than `MAX_RUNS` runs.
    """
    count = len(study.problems) * sum(len(seeds) for _, seeds, _ in study.setups) * study.repeat
    if count > MAX_RUNS:
        raise TooManyRunsError(f"the study has {count:,} runs; at most {MAX_RUNS:,} are allowed")
    return {task.key: task for task in _tasks(study)}


def _tasks(study: Study) -> Iterator[Task]:
    for problem in study.problems:
        for setup, seeds, limits in study.setups:
            for seed in seeds:
                for repetition in range(1, study.repeat + 1):
                    yield Task(
                        problem=problem,
                        setup=setup,
                        seed=seed,
                        limits=limits,
                        repetition=repetition,
                        record=tuple(map(str, study.record)),
                    )
