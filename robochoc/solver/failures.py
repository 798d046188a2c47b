"""Errors of the constraint solver. In a file of their own: to catch them one need not import the solver."""

from __future__ import annotations

from robochoc.solver.encoding import Codes
from robochoc.system.errors import TransferableError


class SolverMissingError(Exception):
    """There is no Java to run ACE with; says how to get it."""


class SolverLostError(Exception):
    """The solver's process died, or failed at the task; says what is known about it."""


class SolverTimeoutError(TransferableError):
    """The time was over before the solver's answer. `best` is the cheapest solution so far, where one was sought."""

    def __init__(self, best: Codes | None = None) -> None:
        super().__init__()
        self.best = best
