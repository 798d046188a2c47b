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
from robochoc.solver.external_process import ExternalProcess
from robochoc.solver.external_programs import PROGRAMS
from tests.support.leftovers import shared_by_tests

_PROCESS = ("_process", "_folder", "_socket", "_lifeline", "_tasks")
"""The attributes of an `AceProcess` that are its process."""
_EXTERNAL = ("_process", "_socket")
"""The same of an `ExternalProcess`."""


class AceStable:
    """Keeps the processes of ACE and of external solvers that no test uses at the moment; usually one of each."""

    def __init__(self) -> None:
        self._idle: list[dict[str, Any]] = []
        self._idle_external: dict[str, list[dict[str, Any]]] = {extra: [] for extra in PROGRAMS}

    @contextmanager
    def lent(self) -> Iterator[None]:
        """While this lasts, a solver that starts takes over an idle process, and one that is closed leaves it."""
        with self._ace_lent(), self._external_lent():
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
    def _external_lent(self) -> Iterator[None]:
        start, close = vars(ExternalProcess)["_start"], ExternalProcess.close

        def take_over(solver: ExternalProcess) -> object:
            if solver.program.extra not in PROGRAMS:  # ACE, whose process starts another one
                return start(solver)
            idle = self._idle_external[solver.program.extra]
            if not idle:
                with shared_by_tests():
                    return start(solver)
            vars(solver).update(idle.pop())
            return vars(solver)["_socket"]

        def leave(solver: ExternalProcess) -> None:
            parts = vars(solver)
            if solver.program.extra in PROGRAMS and _runs(parts) and parts["_task"] is None:
                self._idle_external[solver.program.extra].append({name: parts[name] for name in _EXTERNAL})
                parts.update(dict.fromkeys(_EXTERNAL))
            close(solver)

        with patch.multiple(ExternalProcess, _start=take_over, close=leave):
            yield

    def warm(self) -> None:
        """See to it that there is a process of ACE for the next solver."""
        if not self._idle:
            with self.lent(), AceProcess(always=True) as solver:
                solver.start()

    def close(self) -> None:
        """End all processes."""
        while self._idle:
            solver = AceProcess()
            vars(solver).update(self._idle.pop())
            solver.close()
        for extra, idle in self._idle_external.items():
            while idle:
                process = ExternalProcess(PROGRAMS[extra])
                vars(process).update(idle.pop())
                process.close()


def _runs(parts: dict[str, Any]) -> bool:
    return parts["_process"] is not None and parts["_process"].poll() is None


def _is_fit(parts: dict[str, Any]) -> bool:
    """Whether there is a process of ACE, which has answered all it was asked, and may be asked more."""
    return _runs(parts) and not parts["_searching"] and not parts["_buffer"] and parts["_tasks"] < ace.TASKS
