"""The shared state of a run on this machine: time, cache, constraint solver and observers."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING

from robochoc.communication.kill_schedule import KillSchedule
from robochoc.communication.search_result import Progress
from robochoc.journal.events import Observer
from robochoc.model.outcome import Approximation
from robochoc.model.problem import Team
from robochoc.model.symbols import real_places
from robochoc.run.options import CentralSolverName, Options
from robochoc.solver.cache import SolutionCache
from robochoc.solver.compile import TeamCompiler

if TYPE_CHECKING:
    from robochoc.solver.ace import AceProcess
    from robochoc.solver.central import CentralSolver, TeamSolver
    from robochoc.solver.solver_choice import AutoSolver


class RunContext:
    """The context of one run. The clock of the run starts when the context is created.

    Args:
        options: How to run, with the name of a protocol.
        observer: Receives all events.
        progress: Receives the number of messages and the stage of the run from time to time.
        solver: A constraint solver that is already running. None: a solver is started when it is needed.
        spent_s: The seconds that the run had already taken when the context was created.
        proves_reals: True if the caller proves verdicts and bounds for real variables itself. Otherwise the outcome
            contains no proofs that hold on a grid only.
    """

    def __init__(
        self,
        options: Options,
        observer: Observer | None = None,
        progress: Callable[[Progress], None] | None = None,
        solver: AceProcess | None = None,
        spent_s: float = 0.0,
        *,
        proves_reals: bool = False,
    ) -> None:
        self.options = options
        self.observer = observer
        self.proves_reals = proves_reals
        self.progress = progress
        self.solver = solver
        self.cache = SolutionCache() if options.cache else None
        self.kills = KillSchedule(options.kill)
        self.restart(spent_s)

    def restart(self, spent_s: float = 0.0) -> None:
        """Restart the clock of the run, with `spent_s` seconds already spent."""
        self.began = time.monotonic() - spent_s
        limit_s = self.options.limit_s
        self.deadline = None if limit_s is None else self.began + limit_s

    def searched(self, team: Team) -> Approximation | None:
        """Return the part of the problem that is searched, unless the caller proves more. None: the whole problem."""
        if real_places(team) and not self.proves_reals:
            return Approximation.GRIDS
        return Approximation.SAMPLES if any(robot.sampled for robot in team.robots) else None

    def left_s(self) -> float | None:
        """Return the remaining seconds; None if there is no limit."""
        return None if self.deadline is None else max(0.0, self.deadline - time.monotonic())

    def show_stage(self, stage: str) -> None:
        """Report a stage of the run other than the search, such as the compilation of a robot."""
        if self.progress:
            self.progress(Progress(0, time.monotonic() - self.began, stage))

    def team_compiler(self) -> TeamCompiler:
        """Return a compiler of the robots' domains."""
        show = self.show_stage if self.progress else None
        return TeamCompiler(self.options.local, self.cache, self.deadline, self.solver, show)

    def deciding_solver(self, warm: AceProcess) -> TeamSolver:
        """Return the solver of the merged problem. ACE runs in `warm`, unless the run already has a process."""
        match self.options.central_with:
            case CentralSolverName.AUTO if not self.options.local.always_ace:
                return self._auto_solver(warm)
            case CentralSolverName.AUTO | CentralSolverName.ACE:
                return self.central_solver(warm)
            case name:
                return self._external_solver(name)

    def _auto_solver(self, warm: AceProcess | None, without: Sequence[str] = ()) -> AutoSolver:
        """Return a central solver that chooses the solvers, except those named in `without`."""
        from robochoc.solver.solver_choice import AutoSolver  # noqa: PLC0415 - start-up: rarely needed

        show = partial(self.show_stage, "the central solver decides the whole team")
        return AutoSolver(self.cache, self.deadline, show, self.solver or warm, without)

    def _external_solver(self, name: str) -> TeamSolver:
        """Return a central solver that uses one external program."""
        from robochoc.solver.external_programs import PROGRAMS  # noqa: PLC0415 - start-up: rarely needed
        from robochoc.solver.solver_choice import only  # noqa: PLC0415 - the same

        program = PROGRAMS[name]
        return only(program, self.deadline, partial(self.show_stage, f"{program.name} decides the whole team"))

    def second_opinions(self) -> list[TeamSolver]:
        """Return the solvers that check proofs by robots: the best one, and OR-Tools if it is installed."""
        from robochoc.solver.external_programs import CP_SAT  # noqa: PLC0415 - start-up: rarely needed

        opinions: list[TeamSolver] = [self.solver_without(())]
        return [*opinions, self._external_solver(CP_SAT.extra)] if CP_SAT.is_installed() else opinions

    def solver_without(self, names: Sequence[str]) -> TeamSolver:
        """Return a central solver that uses none of the solvers `names`."""
        return self._auto_solver(None, names)

    def central_solver(self, warm: AceProcess | None = None) -> CentralSolver:
        """Return a central solver. It uses the process `warm`, unless the run already has a process."""
        from robochoc.solver.central import CentralSolver  # noqa: PLC0415 - start-up: rarely needed

        show = partial(self.show_stage, "ACE decides the whole team")
        always_ace = self.options.local.always_ace
        return CentralSolver(self.cache, self.deadline, show, self.solver or warm, always_ace=always_ace)
