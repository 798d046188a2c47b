"""A central solver that gives each independent component to an external solver, or to two of them in parallel.

Solvers receive tables over codes (`solver/encoding.py`, `solver/weighted.py`). The sum of costs is at most
`weighted.MAX_TOTAL_COST`, which fits in 64 bits.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from types import TracebackType
from typing import Self

from robochoc.model.outcome import Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.solver.ace import AceProcess
from robochoc.solver.central import ENUMERATION, HEDGE_S, CentralAnswer
from robochoc.solver.errors import SolverLostError, SolverMissingError, UnsupportedError
from robochoc.solver.external_process import REPORT_TIME_S, ExternalProcess
from robochoc.solver.network_task import TaskAnswer
from robochoc.solver.weighted import WeightedComponent, constant_costs, priced_components
from robochoc.system.time_limit import TimeLimitError, computed_by

_TICK_S = 0.2
NOTHING = TaskAnswer(None, proven=False)


class Pending:
    """Only a part of an answer has arrived."""


class RacingSolver:
    """Solves teams with `runners`, the most promising first; `name` is the name of the whole in messages.

    The first solver starts at once, the second one if there is no answer after `HEDGE_S`. If a solver fails, the next
    one replaces it. With `enumerates`, small components are enumerated. `deadline` is on the monotonic clock;
    `progress` is called during the search. Processes end after each task; inside a context, they are reused.
    """

    def __init__(
        self,
        name: str,
        runners: Sequence[ExternalProcess],
        deadline: float | None = None,
        progress: Callable[[], None] | None = None,
        *,
        enumerates: bool = False,
    ) -> None:
        self.name = name
        self._runners = runners
        self._deadline = deadline
        self._progress = progress
        self._small = AceProcess() if enumerates else None
        self._is_context = False

    def __enter__(self) -> Self:
        self._is_context = True
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._is_context = False
        self.close()

    def close(self) -> None:
        """End all processes."""
        for runner in self._runners:
            runner.close()

    def solve(self, team: Team, *, count: bool = False, withdrawal_cost: int | None = None) -> CentralAnswer:
        """Solve `team`. For the arguments, the answer and the errors see `CentralSolver.solve`.

        Raises:
            SolverMissingError: if no solver is installed.
            SolverLostError: if all solvers have failed.
            UnsupportedError: if a constraint or its costs are too large, or `count` is true.
        """
        if count:
            raise UnsupportedError(f"{self.name} cannot count solutions; use --with auto or ace")
        try:
            return self._solve(team, withdrawal_cost)
        except TimeLimitError:
            return CentralAnswer(Verdict.UNKNOWN)
        finally:
            if not self._is_context:
                self.close()

    def _solve(self, team: Team, withdrawal_cost: int | None) -> CentralAnswer:
        parts = computed_by(self._deadline, priced_components, team, withdrawal_cost)
        cost = bound = constant_costs(team)
        assignment: dict[str, int] | None = {}
        proven, solvers = True, dict[str, None]()
        for part in sorted(parts, key=lambda part: len(part.network.domains)):
            found, solver = self._cheapest(part if withdrawal_cost is not None else self._unpropagated(part))
            solvers |= {solver: None} if solver else {}
            if found.codes is None and found.proven:
                return CentralAnswer(Verdict.NO_SOLUTION, solvers=(solver,))
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
        names = tuple(sorted(solvers))
        if not has_costs:
            return CentralAnswer(Verdict.SOLUTION, assignment, solvers=names)
        verdict = Verdict.OPTIMAL if proven else Verdict.UNKNOWN
        return CentralAnswer(verdict, assignment, cost=cost, bound=bound, solvers=names)

    def _unpropagated(self, part: WeightedComponent) -> WeightedComponent:
        """Return `part`, with its network before propagation if propagation has shown that it has no solution.

        So a solver decides, unless small components are enumerated.
        """
        if self._small is not None or not part.network.impossible:
            return part
        return replace(part, network=part.part.network, costs=())

    def _cheapest(self, part: WeightedComponent) -> tuple[TaskAnswer, str]:
        """Return the answer for one component, and the solver."""
        network = part.network
        if network.impossible:
            return TaskAnswer(None, proven=True), ENUMERATION
        if self._small is not None:
            small = self._small.without_search(network, part.costs, self._deadline)
            if small is not None:
                codes = small.solutions[0] if small.found else None
                bound = 0 if codes is None else sum(unit * codes[place] for place, unit in part.costs)
                return TaskAnswer(codes, proven=True, bound=bound), ENUMERATION
        if self._time_is_over:
            return NOTHING, ""
        try:
            return self._race(part)
        except BaseException:
            self.close()
            raise

    def _race(self, part: WeightedComponent) -> tuple[TaskAnswer, str]:
        """Return the first proven answer. At the deadline, return the best answer of all solvers."""
        waiting = iter(self._runners)
        answers: list[tuple[TaskAnswer, str]] = []
        failures: list[Exception] = []
        running = self._next_started(part, waiting, failures)
        hedge = time.monotonic() + HEDGE_S
        while running and not self._time_is_over:
            for runner in select.select(running, [], [], self._patience())[0]:
                answer = _received(runner, failures)
                if isinstance(answer, Pending):
                    continue
                running.remove(runner)
                if answer is not None and answer.proven:
                    for loser in running:
                        loser.close()
                    return answer, runner.name
                answers += [(answer, runner.name)] if answer is not None else []
            if self._progress:
                self._progress()
            if not running or (len(running) == 1 and time.monotonic() >= hedge and not self._time_is_over):
                running += self._next_started(part, waiting, failures)
        if not answers and not running and not self._time_is_over:
            raise failures[-1]
        for runner in running:
            runner.interrupt()
        until = time.monotonic() + REPORT_TIME_S
        answers += [(runner.last_answer(until), runner.name) for runner in running]
        return _best(part, answers)

    def _next_started(
        self, part: WeightedComponent, waiting: Iterator[ExternalProcess], failures: list[Exception]
    ) -> list[ExternalProcess]:
        """Start the next solver that supports the component, if any. Add the errors of others to `failures`."""
        for runner in waiting:
            try:
                runner.submit(part.network, part.costs, self._deadline)
            except (SolverMissingError, SolverLostError, UnsupportedError) as error:
                failures.append(error)
                continue
            return [runner]
        return []

    @property
    def _time_is_over(self) -> bool:
        return self._deadline is not None and time.monotonic() >= self._deadline

    def _patience(self) -> float:
        return _TICK_S if self._deadline is None else max(0.0, min(_TICK_S, self._deadline - time.monotonic()))


def _received(runner: ExternalProcess, failures: list[Exception]) -> TaskAnswer | Pending | None:
    """Return the answer of a runner. None: it has failed; the error is added to `failures`."""
    try:
        return runner.receive() or Pending()
    except (SolverLostError, SolverMissingError) as error:
        failures.append(error)
        return None


def _best(part: WeightedComponent, answers: Sequence[tuple[TaskAnswer, str]]) -> tuple[TaskAnswer, str]:
    """Return the cheapest of several answers, with the highest bound of all."""
    found = [(answer, name) for answer, name in answers if answer.codes is not None]
    bound = max((answer.bound for answer, _ in answers), default=0)
    proven = next(((answer, name) for answer, name in answers if answer.proven), None)
    if proven is not None:
        return proven
    if not found:
        return TaskAnswer(None, proven=False, bound=bound), ""
    answer, name = min(found, key=lambda one: part.cost(one[0].codes or ()))
    return TaskAnswer(answer.codes, proven=False, bound=bound), name
