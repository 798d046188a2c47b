"""Runs: `solve` returns the outcome of a team. Every part of the program that solves a problem calls it.

`solve` and its `Options` are imported on first use, so that the command line starts quickly.
"""

from __future__ import annotations

TYPE_CHECKING = False  # without an import of `typing`
if TYPE_CHECKING:
    from robochoc.run.defaults import CENTRAL
    from robochoc.run.options import OnLoss, Options, Runtime, ScheduleName, Withdrawal
    from robochoc.run.orchestrator import solve

__all__ = ["CENTRAL", "OnLoss", "Options", "Runtime", "ScheduleName", "Withdrawal", "solve"]


def __getattr__(name: str) -> object:
    if name == "solve":
        from robochoc.run.orchestrator import solve  # noqa: PLC0415 - see above

        return solve
    if name == "CENTRAL":
        from robochoc.run.defaults import CENTRAL  # noqa: PLC0415 - see above

        return CENTRAL
    if name in __all__:
        from robochoc.run import options  # noqa: PLC0415 - see above

        return getattr(options, name)
    raise AttributeError(f"module 'robochoc.run' has no attribute {name!r}")
