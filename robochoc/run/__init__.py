"""A team goes in, an outcome comes out: everything that solves goes through here.

`solve` and its `Options` are imported when they are asked for, so that the command line starts quickly.
"""

from __future__ import annotations

TYPE_CHECKING = False  # that of `typing` would be imported for nothing else
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
