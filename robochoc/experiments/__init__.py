"""Studies: which protocols are run on which problems, where, and what came out.

    >>> import robochoc.experiments
    >>> rows = robochoc.experiments.read("study.sqlite")  # doctest: +SKIP

`study.py` reads the file of a study, `plan.py` makes its runs, `runner.py` carries them out, `store.py` keeps what came
of them, and `report.py` draws it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robochoc.experiments.results import read as read

__all__ = ["read"]


def __getattr__(name: str) -> object:
    """Import what is asked for: who runs `robochoc experiment --help` waits for no database."""
    if name == "read":
        from robochoc.experiments.results import read  # noqa: PLC0415 - as the docstring says

        return read
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
