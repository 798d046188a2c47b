"""Studies that tests carry out: small ones, and what of their results does not depend on the machine."""

from __future__ import annotations

import itertools
import sqlite3
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import msgspec

from robochoc.experiments.execute import TaskRunner
from robochoc.experiments.results import Results, read_results
from robochoc.experiments.runner import StudyProgress, run_study
from robochoc.experiments.store import Store
from robochoc.experiments.study import Study, study_of
from robochoc.experiments.study_file import Place
from robochoc.experiments.task import Row, Task

SMALL = """
[problems]
family = "random"
agents = 6
domain = 3
density = 0.5
tightness = [0.2, 0.5]
seed = "1..3"

[runs]
protocol = ["abt", "afc-ng"]
"""
COSTS = """
title = "Costs"
record = ["cost-over-time", "robots"]

[[problems]]
family = "coloring"
agents = [5, 7]
degree = 2.0
seed = "1..4"

[[runs]]
protocol = ["sfb", "syncbb"]

[[runs]]
protocol = "dsa"
settings = { cycles = 10, variant = ["A", "B"] }
"""
OF_THE_MACHINE = ("wall_s", "compile_s", "total_s", "cpu_s", "machine", "memory")


def study(text: str, place: Path = Path("study.toml")) -> Study:
    """Return the study whose file has this text."""
    return study_of(tomllib.loads(text), Place(place, text))


class RunsHere(TaskRunner):
    """Runs the tasks of a study in this process, in place of workers, which take half a second to start."""

    def rows(self, bundles: Iterable[Sequence[Task]]) -> Iterator[tuple[Task, Row]]:
        """Yield what comes of all tasks, as a worker sends it."""
        for task in itertools.chain.from_iterable(bundles):
            yield task, msgspec.json.decode(msgspec.json.encode(self.run(task)), type=Row)


def results_of(
    text: str, path: Path | None = None, jobs: int = 0, progress: Callable[[StudyProgress], None] | None = None
) -> Results:
    """Carry out the study whose file has this text, in this process or by `jobs` workers; return its results."""
    with Store(path) as store:
        run_study(study(text), store, jobs, progress=progress, workers=None if jobs else lambda _: RunsHere())
        return store.results()


def finished(text: str, path: Path | None = None) -> Results:
    """Return the results of a study whose runs are made once in these tests, and copied."""
    content = _finished(text.partition("[report]")[0])
    with TemporaryDirectory() as folder:
        place = path or Path(folder) / "results.sqlite"
        place.write_bytes(content)
        return results_of(text, place)


@cache
def _finished(text: str) -> bytes:
    """Return the file of a study's results."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "results.sqlite"
        results_of(text, path)
        return path.read_bytes()


def altered(path: Path, *changes: str) -> None:
    """Execute SQL on the file of results at `path`."""
    with closing(sqlite3.connect(path)) as database, database:
        for change in changes:
            database.executescript(change)


def comparable(results: Results | Path) -> list[dict[str, Any]]:
    """Return the rows without what depends on the machine."""
    found = read_results(results) if isinstance(results, Path) else results
    return [{name: value for name, value in row.items() if name not in OF_THE_MACHINE} for row in found.rows]
