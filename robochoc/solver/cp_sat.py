"""OR-Tools as a second central solver: CP-SAT solves the whole team's problem in a separate process.

CP-SAT receives the same tables over codes as ACE (`solver/encoding.py`, `solver/weighted.py`), but uses no cliques, no
symmetries and no enumeration. The sum of costs is at most `weighted.MAX_TOTAL_COST`, which fits easily in 64 bits.
"""

from __future__ import annotations

import importlib.util
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

import msgspec

from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.central import CentralAnswer
from robochoc.solver.cp_sat_messages import (
    LENGTH,
    CpSatAnswer,
    CpSatComparison,
    CpSatFailed,
    CpSatJunction,
    CpSatTable,
    CpSatTask,
    FromCpSat,
)
from robochoc.solver.encoding import Costs, Network
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.solver.linear import Formula, Junction
from robochoc.solver.process_socket import start_by_port
from robochoc.solver.weighted import WeightedComponent, constant_costs, priced_components
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import signals_delayed
from robochoc.system.time_limit import TimeLimitError, computed_by

NAME = "OR-Tools"
INSTALL = "pip install 'robochoc[ortools]'"
REPORT_TIME_S = 0.6
"""The time after the deadline in which CP-SAT may report its best solution, in seconds."""
_TICK_S = 0.2
_LONGEST_WAIT_S = 1e6
_CHUNK = 1 << 20


def is_installed() -> bool:
    """Return whether OR-Tools is installed, without importing it."""
    return importlib.util.find_spec("ortools") is not None


class CpSatSolver:
    """Solves teams with CP-SAT. The process ends after each task; inside a context, it is reused for the next task.

    `deadline` is on the monotonic clock; `progress` is called during the search.
    """

    name = NAME

    def __init__(self, deadline: float | None = None, progress: Callable[[], None] | None = None) -> None:
        self._deadline = deadline
        self._progress = progress
        self._process: subprocess.Popen[bytes] | None = None
        self._socket: socket.socket | None = None
        self._is_context = False

    def __enter__(self) -> Self:
        self._is_context = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_context = False
        self.close()

    @property
    def pid(self) -> int | None:
        """The id of the process, if it is running."""
        return self._process.pid if self._process else None

    def solve(self, team: Team, *, count: bool = False, withdrawal_cost: int | None = None) -> CentralAnswer:
        """Solve `team`. For the arguments, the answer and the errors see `CentralSolver.solve`.

        Raises:
            SolverMissingError: if OR-Tools is not installed.
            SolverLostError: if the process died.
            UnsupportedError: if a constraint or its costs are too large, or `count` is true.
        """
        if count:
            raise UnsupportedError("OR-Tools cannot count solutions; use ACE")
        if not is_installed():
            raise SolverMissingError(f"OR-Tools is not installed; run: {INSTALL}")
        try:
            return self._solve(team, withdrawal_cost)
        except TimeLimitError:
            return CentralAnswer(Verdict.UNKNOWN)
        finally:
            if not self._is_context:
                self.close()

    @signals_delayed()
    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            if self._process.stdin is not None:
                self._process.stdin.close()
            self._process = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _solve(self, team: Team, withdrawal_cost: int | None) -> CentralAnswer:
        parts = computed_by(self._deadline, priced_components, team, withdrawal_cost)
        cost = bound = constant_costs(team)
        assignment: dict[str, int] | None = {}
        proven = True
        for part in sorted(parts, key=lambda part: len(part.network.domains)):
            found = self._cheapest(part)
            if found.codes is None and found.proven:
                return CentralAnswer(Verdict.NO_SOLUTION)
            proven = proven and found.proven
            bound += part.base + part.unit * found.bound
            if found.codes is None or assignment is None:
                assignment = None
                continue
            cost += part.cost(found.codes)
            assignment.update(part.decoded(found.codes))
        has_costs = withdrawal_cost is not None or team.kind == ProblemKind.DISWCSP
        if assignment is None:
            return CentralAnswer(Verdict.UNKNOWN, bound=bound if has_costs else None)
        assignment = {name: assignment[name] for name in team.variables if name in assignment}
        if not has_costs:
            return CentralAnswer(Verdict.SOLUTION, assignment)
        return CentralAnswer(Verdict.OPTIMAL if proven else Verdict.UNKNOWN, assignment, cost=cost, bound=bound)

    def _cheapest(self, part: WeightedComponent) -> CpSatAnswer:
        """Return CP-SAT's answer for one component."""
        network = part.network
        if not all(network.domains):
            return CpSatAnswer(None, proven=True)
        if self._deadline is not None and time.monotonic() >= self._deadline:
            return CpSatAnswer(None, proven=False)
        return self._solve_task(_task(network, part.costs, self._deadline))

    # The process

    def _solve_task(self, task: CpSatTask) -> CpSatAnswer:
        connection = self._socket or self._start()
        body = msgspec.msgpack.encode(task)
        try:
            connection.settimeout(self._left_s())
            connection.sendall(LENGTH.pack(len(body)) + body)
            message = self._receive_message(connection)
        except TimeoutError:
            message = None
        except OSError as error:
            self.close()
            raise SolverLostError(f"the process of OR-Tools was lost ({error})") from None
        if isinstance(message, CpSatFailed):
            self.close()
            if message.missing:
                raise SolverMissingError(f"OR-Tools cannot be used ({message.why}); run: {INSTALL}")
            raise SolverLostError(f"OR-Tools failed: {message.why}")
        if message is None:
            self.close()
            return CpSatAnswer(None, proven=False)
        return message

    @signals_delayed()
    def _start(self) -> socket.socket:
        if not IS_POSIX:
            try:
                self._process, self._socket = start_by_port(_start_by_port)
            except OSError as error:
                raise SolverLostError(f"the process of OR-Tools was lost ({error})") from None
            return self._socket
        ours, theirs = socket.socketpair()
        try:
            self._process = subprocess.Popen(  # noqa: S603 - our own module
                _command(str(theirs.fileno())),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                pass_fds=(theirs.fileno(),),
            )
        except BaseException:
            ours.close()
            raise
        finally:
            theirs.close()
        self._socket = ours
        return ours

    def _receive_message(self, connection: socket.socket) -> FromCpSat | None:
        """Return the answer. None: the deadline has passed. Raises `OSError` if the process died."""
        buffer = bytearray()
        while True:
            if len(buffer) >= LENGTH.size and len(buffer) == LENGTH.size + LENGTH.unpack_from(buffer)[0]:
                message: FromCpSat = msgspec.msgpack.decode(bytes(buffer[LENGTH.size :]), type=FromCpSat)
                return message
            left = self._left_s()
            if left is not None and left <= 0:
                return None
            if not select.select([connection], [], [], _TICK_S if left is None else min(_TICK_S, left))[0]:
                if self._progress:
                    self._progress()
                continue
            chunk = connection.recv(_CHUNK)
            if not chunk:
                raise OSError("it closed the connection")
            buffer += chunk

    def _left_s(self) -> float | None:
        """Return the time to wait for an answer, in seconds. None: no limit."""
        return (
            None if self._deadline is None else min(self._deadline + REPORT_TIME_S - time.monotonic(), _LONGEST_WAIT_S)
        )


def _command(address: str) -> list[str]:
    return [sys.executable, "-P", "-m", "robochoc.solver.cp_sat_process", address]


def _start_by_port(address: str) -> subprocess.Popen[bytes]:
    """Start the process where descriptors cannot be passed."""
    return subprocess.Popen(  # noqa: S603 - our own module
        _command(address), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )


def _task(network: Network, costs: Costs, deadline: float | None) -> CpSatTask:
    tables = tuple(CpSatTable(table.scope, table.allowed, table.rows) for table in network.tables)
    return CpSatTask(network.domains, tables, tuple(costs), deadline, tuple(map(_message, network.formulas)))


def _message(formula: Formula) -> CpSatComparison | CpSatJunction:
    """Return `formula` as a message."""
    if isinstance(formula, Junction):
        return CpSatJunction(formula.every, tuple(map(_message, formula.parts)))
    terms = tuple([(int(place), factor) for place, factor in formula.terms])
    return CpSatComparison(terms, formula.sign, formula.bound)
