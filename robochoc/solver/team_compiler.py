"""Compiles a whole team, within the time of a run."""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING

from robochoc.model.problem import Robot, Team
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import CompiledFrom, Compiler, Limits
from robochoc.solver.compiled_team import CompiledTeam
from robochoc.solver.domain import CompiledDomain
from robochoc.solver.failures import SolverTimeoutError
from robochoc.system.errors import TransferableError
from robochoc.system.time_limit import TimeLimitError, computed_by

if TYPE_CHECKING:
    from robochoc.solver.ace import AceProcess


class NoLocalSolutionError(TransferableError):
    """The private constraints of `robot` leave it no local solution."""

    def __init__(self, robot: str) -> None:
        super().__init__(f"{robot} alone has none: its private constraints leave it no local solution")
        self.robot = robot


class OutOfTimeError(Exception):
    """The time for everything was over before the robots could start."""


class TeamCompiler:
    """Compiles teams of one run. `seconds` is how long solvers took for it; no solver, no time.

    `deadline` is on the monotonic clock, and may be changed. `stage` is called with a few words on the progress. For
    the others see `Compiler`.
    """

    seconds: float = 0.0

    def __init__(
        self,
        limits: Limits | None,
        cache: SolutionCache | None,
        deadline: float | None,
        solver: AceProcess | None,
        stage: Callable[[str], None],
    ) -> None:
        self._limits, self._cache, self._solver = limits, cache, solver
        self.deadline = deadline
        self._stage = stage

    def compile(self, team: Team, *, every: bool = False) -> CompiledTeam:
        """Return `team`, which is what robots will work on, compiled.

        Raises:
            NoLocalSolutionError: at the first robot without values, unless `every` robot is wanted;
                `OutOfTimeError`; and as `Compiler.compile` does.
        """
        began = time.monotonic()
        solved, number, name = False, count(1), ""

        def compile_robot(robot: Robot) -> CompiledDomain:
            nonlocal solved, name
            name = robot.name
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
            raise OutOfTimeError(f"the time was over while {name} was compiled") from None
        finally:
            if solved:
                self.seconds += time.monotonic() - began
