"""Compiles the domains of a team's robots: what private constraints connect is enumerated, or goes to ACE."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from types import TracebackType
from typing import TYPE_CHECKING, Self

from robochoc.model.problem import Robot
from robochoc.solver.cache import SolutionCache
from robochoc.solver.domain import MAX_SOLUTIONS, CompiledDomain, TooManySolutionsError, compile_domain
from robochoc.solver.encoding import Codes, Network, UnsupportedError
from robochoc.solver.failures import SolverLostError, SolverTimeoutError
from robochoc.system.errors import TransferableError

if TYPE_CHECKING:
    from robochoc.solver.ace import AceProcess
    from robochoc.solver.query import SolverAnswer

PATIENCE_S = 60.0
"""The default maximum time for compiling one robot."""


@dataclass(frozen=True)
class Limits:
    """The limits of compiling one robot: a number of local solutions, and seconds of ACE's time.

    With `always_ace`, ACE solves small local problems too.
    """

    solutions: int = MAX_SOLUTIONS
    time_s: float = PATIENCE_S
    always_ace: bool = False


class CompiledFrom(StrEnum):
    """The source of a robot's local solutions; of several, the most expensive one."""

    DIRECT = "direct"
    EQUAL = "equal"
    CACHE = "cache"
    ENUMERATED = "enumerated"
    ACE = "ace"


class CompileTimeoutError(TransferableError):
    """A robot's local problem took too long."""

    def __init__(self, robot: str, limit_s: float) -> None:
        super().__init__(
            f"{robot}'s private constraints were not solved within {limit_s:g} s; give it more time (--local-timeout),"
            " or give some of its variables to a robot of their own"
        )
        self.robot = robot


class CompileError(TransferableError):
    """The solver was lost over a robot's local problem."""

    def __init__(self, robot: str, why: str) -> None:
        super().__init__(f"{robot} could not be compiled: {why}")
        self.robot = robot
        self.why = why


@dataclass(frozen=True)
class Compilation:
    """One robot's compiled domain, where it came from, and how long that took."""

    robot: str
    domain: CompiledDomain
    source: CompiledFrom
    seconds: float


class Compiler:
    """Compiles robots one after the other, with one solver's process (none, if none is needed) and one cache.

    Left as a context, the process is gone, unless it was given as `solver`. `deadline` is on the monotonic clock, and
    for all together.
    """

    def __init__(
        self,
        limits: Limits | None = None,
        cache: SolutionCache | None = None,
        deadline: float | None = None,
        solver: AceProcess | None = None,
    ) -> None:
        self._limits = limits or Limits()
        self._cache = cache
        self._deadline = deadline
        self._lent = solver
        self._own: AceProcess | None = None
        self._known: dict[Network, tuple[Codes, ...]] = {}
        self._too_slow: set[Network] = set()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._own:
            self._own.close()

    def compile(self, robot: Robot) -> Compilation:
        """Return the compiled domain of `robot`.

        Raises:
            TooManySolutionsError: if it has more local solutions than the limit.
            CompileTimeoutError: if its local problem takes too long.
            CompileError: if the solver's process died.
            SolverMissingError: if ACE is needed, and there is no Java.
            UnsupportedError: if a constraint is too large.
            SolverTimeoutError: if the time for all robots is over.
        """
        began = time.monotonic()
        sources = [CompiledFrom.DIRECT]

        def solve(network: Network) -> Sequence[Codes]:
            solutions, source = self._solutions(robot.name, network, began + self._limits.time_s)
            sources.append(source)
            return solutions

        try:
            domain = compile_domain(robot, solve, self._limits.solutions)
        except UnsupportedError as refusal:
            raise UnsupportedError(f"{robot.name}: {refusal}") from refusal
        costliest = max(sources, key=list(CompiledFrom).index)
        return Compilation(robot.name, domain, costliest, time.monotonic() - began)

    def _solutions(self, robot: str, network: Network, limit: float) -> tuple[tuple[Codes, ...], CompiledFrom]:
        if network in self._too_slow:
            raise CompileTimeoutError(robot, self._limits.time_s)
        known = self._known.get(network)
        source = CompiledFrom.EQUAL
        if known is None and self._cache is not None:
            known = self._cache.get(network)
            source = CompiledFrom.CACHE
        if known is None:
            answer = self._solved(robot, network, limit)
            known, source = answer.solutions, _source(answer)
            if self._cache is not None and answer.complete and source == CompiledFrom.ACE:
                self._cache.put(network, known)
        self._known[network] = known
        if len(known) > self._limits.solutions:
            raise TooManySolutionsError(robot, self._limits.solutions)
        return known, source

    def _solved(self, robot: str, network: Network, limit: float) -> SolverAnswer:
        deadline = limit if self._deadline is None else min(limit, self._deadline)
        solver = self._solver()
        try:
            solver.begin(network, limit=self._limits.solutions + 1, strategy="static", deadline=self._deadline)
            return solver.answer(deadline)
        except SolverTimeoutError as timeout:
            if self._deadline is not None and self._deadline <= limit:
                raise
            self._too_slow.add(network)
            raise CompileTimeoutError(robot, self._limits.time_s) from timeout
        except SolverLostError as lost:
            raise CompileError(robot, str(lost)) from lost

    def _solver(self) -> AceProcess:
        """Return the solver that was lent, or one of our own, which is made when the first network asks for it."""
        from robochoc.solver.ace import AceProcess  # noqa: PLC0415 - start-up: most robots need no solver

        if self._lent:
            return self._lent
        if self._own is None:
            self._own = AceProcess(always=self._limits.always_ace)
        return self._own


def _source(answer: SolverAnswer) -> CompiledFrom:
    """Return what the solver's `answer` comes from."""
    from robochoc.solver.query import SolvedBy  # noqa: PLC0415 - start-up: most robots need no solver

    sources = {
        SolvedBy.PROPAGATION: CompiledFrom.DIRECT,
        SolvedBy.ENUMERATION: CompiledFrom.ENUMERATED,
        SolvedBy.ACE: CompiledFrom.ACE,
    }
    return sources[answer.means]
