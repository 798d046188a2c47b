"""Errors of the constraint solvers. In a file of their own, so that catching them does not import a solver."""

from __future__ import annotations

from robochoc.solver.encoding import Codes
from robochoc.system.errors import TransferableError


class SolverMissingError(Exception):
    """Java, or OR-Tools, is missing. The message contains the command that installs it."""


class SolverLostError(Exception):
    """The solver's process died, or failed. The message contains the cause, if known."""


class SolverTimeoutError(TransferableError):
    """The deadline passed before the solver's answer. `best`: the cheapest solution so far, if costs are minimised."""

    def __init__(self, best: Codes | None = None) -> None:
        super().__init__()
        self.best = best
