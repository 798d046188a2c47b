"""Compiles the domains of a team's robots: solves their private constraints, by enumeration or by ACE."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from enum import StrEnum
from itertools import count
from types import TracebackType
from typing import TYPE_CHECKING, Self

from robochoc.model.problem import Robot, Team
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compiled_domain import MAX_SOLUTIONS, CompiledDomain, TooManySolutionsError, compile_domain
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.encoding import Codes, Network
from robochoc.solver.errors import SolverLostError, SolverTimeoutError, UnsupportedError
from robochoc.system.errors import RobochocError
from robochoc.system.garbage import collection_paused
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.time_limit import TimeLimitError, computed_by

if TYPE_CHECKING:
    from robochoc.solver.ace import AceProcess, SolverAnswer

PATIENCE_S = 60.0
"""The default maximum time for compiling one robot."""


@dataclass(frozen=True)
class CompileLimits:
    """The limits for compiling one robot: the number of local solutions, and ACE's time in seconds.

    With `always_ace`, ACE also solves small local problems.
    """

    solutions: int = MAX_SOLUTIONS
    time_s: float = PATIENCE_S
    always_ace: bool = False


class CompiledFrom(StrEnum):
    """The source of a robot's local solutions; if there are several, the most expensive source."""

    DIRECT = "direct"
    EQUAL = "equal"
    CACHE = "cache"
    ENUMERATED = "enumerated"
    ACE = "ace"


class CompileTimeoutError(RobochocError):
    """The time limit for a robot's local problem was exceeded."""

    def __init__(self, robot: str, limit_s: float) -> None:
        super().__init__(
            f"{robot}'s private constraints were not solved within {limit_s:g} s; increase --local-timeout,"
            " or move some of its variables to another robot"
        )
        self.robot = robot


class CompileError(RobochocError):
    """The solver's process died while solving a robot's local problem."""

    def __init__(self, robot: str, why: str) -> None:
        super().__init__(f"{robot} could not be compiled: {why}")
        self.robot = robot
        self.why = why


class NoLocalSolutionError(RobochocError):
    """The private constraints of `robot` have no solution."""

    def __init__(self, robot: str) -> None:
        super().__init__(f"{robot} alone has none: its private constraints have no solution")
        self.robot = robot


class TeamCompileTimeoutError(RobochocError):
    """The time limit of a run was exceeded before the robots could start."""


@dataclass(frozen=True)
class Compilation:
    """One robot's compiled domain, the source of its solutions, and the time taken to compile it."""

    robot: str
    domain: CompiledDomain
    source: CompiledFrom
    seconds: float


class Compiler:
    """Compiles robots one after the other, with one cache and at most one solver process.

    Leaving the context ends the process, unless it was given as `solver`. `deadline`, on the monotonic clock, is shared
    by all robots.
    """

    def __init__(
        self,
        limits: CompileLimits | None = None,
        cache: SolutionCache | None = None,
        deadline: float | None = None,
        solver: AceProcess | None = None,
    ) -> None:
        self._limits = limits or CompileLimits()
        self._cache = cache
        self._deadline = deadline
        self._given_solver = solver
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
            TooManySolutionsError: if the robot has more local solutions than the limit.
            CompileTimeoutError: if its local problem exceeds the time limit.
            CompileError: if the solver's process died.
            SolverMissingError: if ACE is needed, and Java is not available.
            UnsupportedError: if a constraint is too large.
            SolverTimeoutError: if the deadline for all robots has passed.
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
            solver.submit(network, limit=self._limits.solutions + 1, strategy="static", deadline=self._deadline)
            return solver.answer(deadline)
        except SolverTimeoutError as timeout:
            if self._deadline is not None and self._deadline <= limit:
                raise
            self._too_slow.add(network)
            raise CompileTimeoutError(robot, self._limits.time_s) from timeout
        except SolverLostError as lost:
            raise CompileError(robot, str(lost)) from lost

    def _solver(self) -> AceProcess:
        """Return the given solver, or a solver that is started on first use."""
        from robochoc.solver.ace import AceProcess  # noqa: PLC0415 - start-up: most robots need no solver

        if self._given_solver:
            return self._given_solver
        if self._own is None:
            self._own = AceProcess(always=self._limits.always_ace)
        return self._own


class TeamCompiler:
    """Compiles the teams in one run. `seconds` is the time spent on teams that needed a solver.

    `deadline` is on the monotonic clock, and may be changed. `stage` receives descriptions of the progress (None: no
    descriptions). See `Compiler` for the other arguments.
    """

    seconds: float = 0.0

    def __init__(
        self,
        limits: CompileLimits | None,
        cache: SolutionCache | None,
        deadline: float | None,
        solver: AceProcess | None,
        stage: Callable[[str], None] | None,
    ) -> None:
        self._limits, self._cache, self._solver = limits, cache, solver
        self.deadline = deadline
        self._stage = stage

    @collection_paused()
    def compile(self, team: Team, *, every: bool = False) -> CompiledTeam:
        """Return `team`, compiled.

        Raises:
            NoLocalSolutionError: if a robot has no values, unless `every` robot is to be compiled.
            TeamCompileTimeoutError: if the deadline has passed.
            Exception: the other errors of `Compiler.compile`.
        """
        began = time.monotonic()
        solved, number, name = False, count(1), ""

        def compile_robot(robot: Robot) -> CompiledDomain:
            nonlocal solved, name
            name = robot.name
            if self._stage:
                self._stage(f"compiling {name} ({next(number)} of {len(team.robots)})")
            compilation = compiler.compile(robot)
            solved = solved or compilation.source != CompiledFrom.DIRECT
            if not (compilation.domain.values or every):
                raise NoLocalSolutionError(robot.name)
            return compilation.domain

        try:
            with Compiler(self._limits, self._cache, self.deadline, self._solver) as compiler:
                return computed_by(self.deadline, CompiledTeam, team, compile_robot)
        except (SolverTimeoutError, TimeLimitError):
            name = name or next((robot.name for robot in team.robots), team.name)
            raise TeamCompileTimeoutError(f"the time limit was exceeded while {name} was compiled") from None
        finally:
            if solved:
                self.seconds += time.monotonic() - began


def _source(answer: SolverAnswer) -> CompiledFrom:
    """Return the source of the solver's `answer`."""
    from robochoc.solver.ace import SolvedBy  # noqa: PLC0415 - start-up: most robots need no solver

    sources = {
        SolvedBy.PROPAGATION: CompiledFrom.DIRECT,
        SolvedBy.ENUMERATION: CompiledFrom.ENUMERATED,
        SolvedBy.ACE: CompiledFrom.ACE,
    }
    return sources[answer.means]
