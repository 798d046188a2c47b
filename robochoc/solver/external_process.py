"""The process of an external solver, which receives networks and returns solutions. All external solvers share it."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress

import msgspec

from robochoc.solver.encoding import Costs, Network
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.solver.external_programs import ExternalProgram
from robochoc.solver.linear import Formula, Junction
from robochoc.solver.network_task import (
    LENGTH,
    MAX_LENGTH,
    FromSolver,
    NetworkTask,
    TaskAnswer,
    TaskComparison,
    TaskFailed,
    TaskJunction,
    TaskTable,
)
from robochoc.solver.process_socket import end_process, start_by_port
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import signals_delayed
from robochoc.system.time_limit import computed_by

REPORT_TIME_S = 0.6
"""The time after the deadline in which a solver may report its best solution, in seconds."""
_LONGEST_WAIT_S = 1e6
_CHUNK = 1 << 20


class ExternalProcess:
    """The process of `program`, started by the first task. `close` ends it, and the programs that it has started."""

    def __init__(self, program: ExternalProgram) -> None:
        self.program = program
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self._buffer = bytearray()
        self._task: NetworkTask | None = None

    @property
    def name(self) -> str:
        """The name of the solver."""
        return self.program.name

    @property
    def pid(self) -> int | None:
        """The id of the process, if it is running."""
        return self._process.pid if self._process else None

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when the answer arrives."""
        if self._socket is None:
            raise ValueError("the solver has no task")
        return self._socket.fileno()

    def submit(self, network: Network, costs: Costs, deadline: float | None) -> None:
        """Send a task: find one solution, the cheapest with `costs`.

        Raises:
            SolverMissingError: if the solver is not installed.
            SolverLostError: if the process died.
            UnsupportedError: if the solver does not support the network.
            TimeLimitError: if the deadline passes before the process has received the task.
        """
        if (why := self.program.refusal(network, costs)) is not None:
            raise UnsupportedError(f"{why}; use --with auto")
        if not self.program.is_installed():
            raise SolverMissingError(f"{self.name} is not installed; run: {self.program.install}")
        task = computed_by(deadline, _task, network, costs, deadline)
        if self.program.is_single_use:
            self.close()
        self._task = task
        body = msgspec.msgpack.encode(task)
        connection = self._socket or self._start()
        try:
            computed_by(deadline, connection.sendall, LENGTH.pack(len(body)) + body)
        except OSError as error:
            raise self._lost(error) from None

    def receive(self) -> TaskAnswer | None:
        """Return the answer after `fileno` has become readable. None: only a part of it has arrived.

        Raises:
            SolverMissingError: if the solver's package cannot be imported.
            SolverLostError: if the process died or failed, or its answer is invalid.
        """
        if self._socket is None or self._task is None:
            raise ValueError("the solver has no task")
        try:
            chunk = self._socket.recv(_CHUNK)
        except OSError as error:
            raise self._lost(error) from None
        if not chunk:
            raise self._lost(None)
        self._buffer += chunk
        if len(self._buffer) < LENGTH.size:
            return None
        (length,) = LENGTH.unpack_from(self._buffer)
        if length > MAX_LENGTH or len(self._buffer) > LENGTH.size + length:
            raise self._invalid(f"{max(length, len(self._buffer)):,} bytes")
        if len(self._buffer) < LENGTH.size + length:
            return None
        body = bytes(self._buffer[LENGTH.size :])
        self._buffer.clear()
        try:
            message: FromSolver = msgspec.msgpack.decode(body, type=FromSolver)
        except msgspec.DecodeError as error:
            raise self._invalid(str(error)) from None
        task, self._task = self._task, None
        return self._checked(message, task)

    def interrupt(self) -> None:
        """Make the process report its best solution, because the deadline has passed."""
        if self._process is not None and self.program.interrupt is not None:
            self._process.send_signal(self.program.interrupt)

    def last_answer(self, until: float) -> TaskAnswer:
        """Return the best solution that the process reports until the time `until`, and end it if it has none."""
        with suppress(SolverLostError):
            while self._socket is not None and (left := until - time.monotonic()) > 0:
                if not select.select([self], [], [], left)[0]:
                    break
                if (answer := self.receive()) is not None:
                    return answer
        self.close()
        return TaskAnswer(None, proven=False)

    @signals_delayed()
    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            if IS_POSIX and self.program.ends_group:
                with suppress(ProcessLookupError):
                    os.killpg(self._process.pid, signal.SIGKILL)
            end_process(self._process)
            self._process = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        self._buffer.clear()
        self._task = None

    def _checked(self, message: FromSolver, task: NetworkTask) -> TaskAnswer:
        """Return the answer to `task` in `message`."""
        if isinstance(message, TaskFailed):
            self.close()
            if message.missing:
                is_complete = "; run: " in message.why  # by `AceProcess`
                why = f"{self.name} cannot be used ({message.why}); run: {self.program.install}"
                raise SolverMissingError(message.why if is_complete else why)
            raise SolverLostError(f"{self.name} failed: {message.why}")
        if message.codes is not None:
            if len(message.codes) != len(task.domains):
                raise self._invalid(f"{len(message.codes)} values for {len(task.domains)} variables")
            for place, (code, domain) in enumerate(zip(message.codes, task.domains, strict=True)):
                if code not in domain:
                    raise self._invalid(f"code {code} of variable {place} is not in its domain")
            cost = sum(unit * message.codes[place] for place, unit in task.costs)
            if message.bound > cost:
                raise self._invalid(f"a bound of {message.bound:,} for a cost of {cost:,}")
        return message

    def _invalid(self, what: str) -> SolverLostError:
        self.close()
        return SolverLostError(f"{self.name} returned an invalid answer: {what}")

    def _lost(self, error: OSError | None) -> SolverLostError:
        self.close()
        return SolverLostError(f"the process of {self.name} was lost ({error or 'it closed the connection'})")

    @signals_delayed()
    def _start(self) -> socket.socket:
        if not IS_POSIX:
            try:
                self._process, self._socket = start_by_port(self._start_by_port)
            except OSError as error:
                raise self._lost(error) from None
            return self._socket
        ours, theirs = socket.socketpair()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                self._command(str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
                process_group=0,  # so that `close` also ends the programs that it has started
            )
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
        self._socket = ours
        return ours

    def _command(self, address: str) -> list[str]:
        return [sys.executable, "-P", "-m", self.program.module, address]

    def _start_by_port(self, address: str) -> subprocess.Popen[bytes]:
        """Start the process where descriptors cannot be passed."""
        return subprocess.Popen(  # noqa: S603 - our own module
            self._command(address), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )


def _task(network: Network, costs: Costs, deadline: float | None) -> NetworkTask:
    tables = tuple(TaskTable(table.scope, table.allowed, table.rows) for table in network.tables)
    return NetworkTask(network.domains, tables, tuple(costs), deadline, tuple(map(_message, network.formulas)))


def _message(formula: Formula) -> TaskComparison | TaskJunction:
    """Return `formula` as a message."""
    if isinstance(formula, Junction):
        return TaskJunction(formula.every, tuple(map(_message, formula.parts)))
    terms = tuple([(int(place), factor) for place, factor in formula.terms])
    return TaskComparison(terms, formula.sign, formula.bound)
