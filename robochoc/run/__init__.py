"""Runs: `solve` returns the outcome of a team. Every part of the program that solves a problem calls it.

`solve` and its `Options` are imported on first use, so that the command line starts quickly.
"""

from __future__ import annotations

from robochoc.system.lazy_names import lazy_names

TYPE_CHECKING = False  # without an import of `typing`
if TYPE_CHECKING:
    from robochoc.run.defaults import CENTRAL
    from robochoc.run.options import OnLoss, Options, Runtime, ScheduleName, Withdrawal
    from robochoc.run.orchestrator import solve

__all__ = ["CENTRAL", "OnLoss", "Options", "Runtime", "ScheduleName", "Withdrawal", "solve"]

_OPTIONS = dict.fromkeys(("OnLoss", "Options", "Runtime", "ScheduleName", "Withdrawal"), "robochoc.run.options")
__getattr__, __dir__ = lazy_names(
    __name__, {**_OPTIONS, "CENTRAL": "robochoc.run.defaults", "solve": "robochoc.run.orchestrator"}
)
