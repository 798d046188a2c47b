"""Studies that tests carry out: small ones, and what of their results does not depend on the machine."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from robochoc.experiments.results import Results, read_results
from robochoc.experiments.runner import StudyProgress, run_study
from robochoc.experiments.store import Store
from robochoc.experiments.study import Study, study_of
from robochoc.experiments.table import Place

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


def results_of(
    text: str, path: Path | None = None, jobs: int = 1, progress: Callable[[StudyProgress], None] | None = None
) -> Results:
    """Carry out the study whose file has this text, and return its results."""
    with Store(path) as store:
        run_study(study(text), store, jobs, progress=progress)
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


def comparable(results: Results | Path) -> list[dict[str, Any]]:
    """Return the rows without what depends on the machine."""
    found = read_results(results) if isinstance(results, Path) else results
    return [{name: value for name, value in row.items() if name not in OF_THE_MACHINE} for row in found.rows]
