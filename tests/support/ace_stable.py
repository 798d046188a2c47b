"""Warm solvers for a whole worker: solvers of tests take processes over from each other.

To start a solver's process takes longer than what most tests ask of it. Where it is of no interest whose process it
is, `AceStable.lent` lets every solver of this process, also of programs that run within it, take over one that another
has closed in good health. Tests of the process itself do without.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from robochoc.solver import ace
from robochoc.solver.ace import AceProcess
from robochoc.solver.cp_sat import CpSatSolver
from robochoc.solver.cp_sat_messages import CpSatAnswer, CpSatTask
from tests.support.leftovers import shared_by_tests

_PROCESS = ("_process", "_folder", "_socket", "_lifeline", "_tasks")
"""The attributes of an `AceProcess` that are its process."""
_CP_SAT = ("_process", "_socket")
"""The same of a `CpSatSolver`."""


class AceStable:
    """Keeps the processes of ACE and of OR-Tools that no test uses at the moment; usually one of each."""

    def __init__(self) -> None:
        self._idle: list[dict[str, Any]] = []
        self._idle_cp_sat: list[dict[str, Any]] = []

    @contextmanager
    def lent(self) -> Iterator[None]:
        """While this lasts, a solver that starts takes over an idle process, and one that is closed leaves it."""
        with self._ace_lent(), self._cp_sat_lent():
            yield

    @contextmanager
    def _ace_lent(self) -> Iterator[None]:
        start, close = vars(AceProcess)["_start"], AceProcess.close

        def take_over(solver: AceProcess) -> None:
            if not self._idle:
                with shared_by_tests():
                    start(solver)
            else:
                vars(solver).update(self._idle.pop(), _java=True)

        def leave(solver: AceProcess) -> None:
            parts = vars(solver)
            if parts["_java"] and _is_fit(parts):
                self._idle.append({name: parts[name] for name in _PROCESS})
                parts.update(_process=None, _folder=None, _socket=None, _lifeline=-1)
            close(solver)

        with patch.multiple(AceProcess, _start=take_over, close=leave):
            yield

    @contextmanager
    def _cp_sat_lent(self) -> Iterator[None]:
        start, asked, close = vars(CpSatSolver)["_start"], vars(CpSatSolver)["_solve_task"], CpSatSolver.close

        def take_over(solver: CpSatSolver) -> object:
            if not self._idle_cp_sat:
                with shared_by_tests():
                    return start(solver)
            vars(solver).update(self._idle_cp_sat.pop())
            return vars(solver)["_socket"]

        def ask(solver: CpSatSolver, task: CpSatTask) -> CpSatAnswer:
            vars(solver)["asked"] = True  # a solver that is closed meanwhile is not fit for others
            answer: CpSatAnswer = asked(solver, task)
            vars(solver)["asked"] = False
            return answer

        def leave(solver: CpSatSolver) -> None:
            parts = vars(solver)
            if _runs(parts) and not parts.get("asked"):
                self._idle_cp_sat.append({name: parts[name] for name in _CP_SAT})
                parts.update(dict.fromkeys(_CP_SAT))
            close(solver)

        with patch.multiple(CpSatSolver, _start=take_over, _solve_task=ask, close=leave):
            yield

    def warm(self) -> None:
        """See to it that there is a process of ACE for the next solver."""
        if not self._idle:
            with self.lent(), AceProcess(always=True) as solver:
                solver.start()

    def close(self) -> None:
        """End all processes."""
        for kind, idle in ((AceProcess, self._idle), (CpSatSolver, self._idle_cp_sat)):
            while idle:
                solver = kind()
                vars(solver).update(idle.pop())
                solver.close()


def _runs(parts: dict[str, Any]) -> bool:
    return parts["_process"] is not None and parts["_process"].poll() is None


def _is_fit(parts: dict[str, Any]) -> bool:
    """Whether there is a process of ACE, which has answered all it was asked, and may be asked more."""
    return _runs(parts) and not parts["_searching"] and not parts["_buffer"] and parts["_tasks"] < ace.TASKS
