"""Errors of local problems and of constraint solvers. A separate file, so that catching them imports no solver."""

from __future__ import annotations

from robochoc.system.errors import RobochocError


class UnsupportedError(RobochocError):
    """The problem is valid, but not supported by this version or protocol. The message names an alternative."""


class TooLargeError(UnsupportedError):
    """The problem is too large for this protocol, which could only be detected during the search."""


class SolverMissingError(RobochocError):
    """Java, or OR-Tools, is missing. The message contains the command that installs it."""


class SolverLostError(RobochocError):
    """The solver's process died or failed. The message contains the cause, if known."""


class SolverTimeoutError(RobochocError):
    """The deadline passed before the solver's answer. `best`: the cheapest solution so far, if costs are minimised."""

    def __init__(self, best: tuple[int, ...] | None = None) -> None:
        super().__init__()
        self.best = best
