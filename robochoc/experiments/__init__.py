"""Studies: experiments that run protocols on problems, and their results.

    >>> import robochoc.experiments
    >>> rows = robochoc.experiments.read("study.sqlite")  # doctest: +SKIP

`study.py` reads the file of a study (its tables: `study_file.py`, `study_problems.py`, `study_runs.py`), `plan.py`
lists its runs, `runner.py` runs them, `store.py` stores the results, and `report.py` writes a report.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robochoc.experiments.results import read as read

__all__ = ["read"]


def __getattr__(name: str) -> object:
    """Import `read` on demand, as `robochoc experiment --help` must not wait for the database."""
    if name == "read":
        from robochoc.experiments.results import read  # noqa: PLC0415 - start-up

        return read
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
