"""The rules by which `--with auto` chooses a central solver.

The order of the solvers follows a study (`python benchmarks/run.py central`, 100 instances of 20 families). Of the 74
that are not enumerated, 35 have no costs and 39 have costs. Always choosing one solver, with a limit of 5 s of CPU:

    solver     without costs             with costs
    cosoco     33 decided, 21 s in all   27 decided,  68 s
    toulbar2   33 decided, 26 s          34 decided,  31 s
    ACE        30 decided, 48 s          23 decided, 119 s
    CP-SAT     32 decided, 49 s          23 decided, 106 s
    the best   34 decided, 18 s          34 decided,  30 s

ACE is before CP-SAT only in the race without costs: it alone decided 3D queens with n = 10, by its cliques.
"""

from __future__ import annotations

from collections.abc import Callable, Collection

from robochoc.model.outcome import CENTRAL_SOLVER
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.cache import SolutionCache
from robochoc.solver.central import ACE, ENUMERATION, CentralAnswer, CentralSolver
from robochoc.solver.errors import SolverMissingError
from robochoc.solver.external_process import ExternalProcess
from robochoc.solver.external_programs import ACE_NETWORK, COSOCO, CP_SAT, TOULBAR2, ExternalProgram
from robochoc.solver.racing import RacingSolver

FOR_COSTS = (TOULBAR2, COSOCO, CP_SAT)
FOR_SATISFACTION = (COSOCO, TOULBAR2, CP_SAT)


def programs(*, has_costs: bool, without: Collection[str] = ()) -> list[ExternalProgram]:
    """Return the external solvers for problems with or without costs, the best first, with ACE among them.

    `without` are the names of solvers that must not be used. The list is empty if only ACE is left: `CentralSolver`
    does more than ACE as an external solver.
    """
    listed = FOR_COSTS if has_costs else FOR_SATISFACTION
    chosen = [one for one in listed if one.name not in without and one.is_installed()]
    if chosen and ACE not in without:
        # Without costs ACE is the second one, because its cliques prove what others do not.
        chosen.insert(len(chosen) if has_costs else 1, ACE_NETWORK)
    return chosen


class AutoSolver:
    """Solves teams with the best installed solver (`programs`), and the next one in parallel if it takes long.

    ACE alone counts solutions, and solves all problems if no external solver is installed. For the arguments see
    `CentralSolver`; `without` are the names of solvers that must not be used.
    """

    name = CENTRAL_SOLVER

    def __init__(
        self,
        cache: SolutionCache | None = None,
        deadline: float | None = None,
        progress: Callable[[], None] | None = None,
        solver: AceProcess | None = None,
        without: Collection[str] = (),
    ) -> None:
        self._enumerates = ENUMERATION not in without
        self._central = CentralSolver(
            cache, deadline, progress, solver if self._enumerates else None, always_ace=not self._enumerates
        )
        self._deadline = deadline
        self._progress = progress
        self._without = frozenset(without)

    def solve(self, team: Team, *, count: bool = False, withdrawal_cost: int | None = None) -> CentralAnswer:
        """Solve `team`. For the arguments, the answer and the errors see `CentralSolver.solve`."""
        has_costs = withdrawal_cost is not None or team.kind == ProblemKind.DISWCSP
        chosen = programs(has_costs=has_costs, without=self._without)
        if not chosen and ACE in self._without:
            raise SolverMissingError(
                f"--verify requires a solver other than ACE, which found the answer; run: {CP_SAT.install}"
            )
        if count or not chosen:
            return self._central.solve(team, count=count, withdrawal_cost=withdrawal_cost)

        runners = [ExternalProcess(one) for one in chosen]
        racing = RacingSolver(self.name, runners, self._deadline, self._progress, enumerates=self._enumerates)
        return racing.solve(team, withdrawal_cost=withdrawal_cost)


def only(
    program: ExternalProgram, deadline: float | None = None, progress: Callable[[], None] | None = None
) -> RacingSolver:
    """Return a central solver that uses `program` for all components."""
    return RacingSolver(program.name, [ExternalProcess(program)], deadline, progress)
