"""One warm JVM for a whole worker: solvers of tests take it over and hand it on.

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

_PROCESS = ("_process", "_folder", "_socket", "_lifeline", "_tasks")
"""What of an `AceProcess` is its process."""


class AceStable:
    """Keeps solvers' processes that nobody uses at the moment; usually that is one."""

    def __init__(self) -> None:
        self._idle: list[dict[str, Any]] = []

    @contextmanager
    def lent(self) -> Iterator[None]:
        """While this lasts, a solver that starts takes over an idle process, and one that is closed leaves it."""
        start, close = vars(AceProcess)["_start"], AceProcess.close

        def take_over(solver: AceProcess) -> None:
            if not self._idle:
                start(solver)
            else:
                vars(solver).update(self._idle.pop())

        def leave(solver: AceProcess) -> None:
            parts = vars(solver)
            if parts["_java"] and _is_fit(parts):
                self._idle.append({name: parts[name] for name in _PROCESS})
                parts.update(_process=None, _folder=None, _socket=None, _lifeline=-1)
            close(solver)

        with patch.multiple(AceProcess, _start=take_over, close=leave):
            yield

    def warm(self) -> None:
        """See to it that there is a process for the next solver."""
        if not self._idle:
            with self.lent(), AceProcess(always=True) as solver:
                solver.start()

    def close(self) -> None:
        """End all processes."""
        while self._idle:
            solver = AceProcess()
            vars(solver).update(self._idle.pop())
            solver.close()


def _is_fit(parts: dict[str, Any]) -> bool:
    """Whether there is a process, which has answered all it was asked, and may be asked more."""
    alive = parts["_process"] is not None and parts["_process"].poll() is None
    return alive and not parts["_searching"] and not parts["_buffer"] and parts["_tasks"] < ace.TASKS
