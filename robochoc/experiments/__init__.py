"""Studies: experiments that run protocols on problems, and their results.

    >>> import robochoc.experiments
    >>> rows = robochoc.experiments.read("study.sqlite")  # doctest: +SKIP

`study.py` reads a study's file (its tables: `study_file.py`, `study_problems.py`, `study_runs.py`), `plan.py` lists the
runs, `runner.py` executes them, `store.py` stores the results, and `report.py` writes a report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robochoc.system.lazy_names import lazy_names

if TYPE_CHECKING:
    from robochoc.experiments.results import read as read

__all__ = ["read"]

__getattr__, __dir__ = lazy_names(__name__, {"read": "robochoc.experiments.results"})
