"""The central solver: solves a whole team's problem, counts its solutions or minimises its cost, by ACE if it is large.

Unlike the robots, the central solver reads every file. It confirms or refutes the verdict of a team, and counts
solutions. Components without common constraints are solved separately. Large components are sent to ACE with explicit
cliques (`solver/cliques.py`). Two strategies run in parallel, and the first answer counts.
"""

from __future__ import annotations

import math
import select
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import field, replace
from typing import Protocol

from robochoc.model.outcome import CENTRAL_SOLVER, Verdict
from robochoc.model.problem import Assignment, ProblemKind, Team
from robochoc.solver.ace import AceProcess, SolvedBy, SolverAnswer
from robochoc.solver.ace_messages import Strategy
from robochoc.solver.cache import SolutionCache
from robochoc.solver.cliques import with_cliques
from robochoc.solver.encoding import Codes, Component, Network, components
from robochoc.solver.errors import SolverTimeoutError
from robochoc.solver.listing import Replayable, combinations, listed_solutions
from robochoc.solver.symmetry import break_symmetries, orbits, symmetries
from robochoc.solver.weighted import WeightedComponent, constant_costs, priced_components
from robochoc.system.lazy_dataclass import dataclass
from robochoc.system.time_limit import TimeLimitError, computed_by

MAX_CLIQUE_ROWS = 20_000
"""The maximum number of solutions of a clique that becomes a table; other cliques become an allDifferent."""
TABLE_PATIENCE_S = 20.0
"""The maximum total time for computing the tables of cliques."""
MAX_ORBITS = 20_000
"""The maximum number of solutions, up to symmetry, that are listed for counting. If there are more, ACE counts."""
MANY_ROWS = 100_000
"""The number of table rows from which ACE is started immediately, while the first task is prepared."""
HEDGE_S = 5.0
"""The time without an answer, in seconds, after which the second strategy starts in parallel."""
_TICK_S = 0.2
NO_SOLUTIONS = SolverAnswer(0, complete=True, solutions=())
ENUMERATION = "enumeration"
"""The name of the solver of small components, in `CentralAnswer.solvers`."""
ACE = "ACE"


@dataclass(frozen=True)
class CentralAnswer:
    """The answer of the central solver.

    Attributes:
        verdict: The answer to the problem.
        assignment: A solution; if costs are minimised, the cheapest one found.
        count: The number of solutions, if requested.
        cost: The cost of the assignment, if costs are minimised.
        bound: A lower bound on the cost of all assignments, if costs are minimised.
        solvers: The names of the solvers that found the answer. Several, if they solved different components.
    """

    verdict: Verdict
    assignment: dict[str, int] = field(default_factory=dict)
    count: int | None = None
    cost: int | None = None
    bound: int | None = None
    solvers: tuple[str, ...] = ()


@dataclass(frozen=True)
class _SearchRequest:
    """Find up to `limit` solutions, or their number. `in_order`: try the static variable order first."""

    limit: int | None = None
    count_only: bool = False
    in_order: bool = False

    @property
    def strategies(self) -> tuple[Strategy, Strategy]:
        return ("static", "default") if self.in_order else ("default", "static")


class TeamSolver(Protocol):
    """A solver of whole teams: `CentralSolver` or `RacingSolver` (`solver/racing.py`)."""

    @property
    def name(self) -> str:
        """The name of the solver in messages."""

    def solve(self, team: Team, *, count: bool = False, withdrawal_cost: int | None = None) -> CentralAnswer:
        """Solve `team`. See `CentralSolver.solve`."""


class CentralSolver:
    """Solves teams: small ones by enumeration, others (all teams with `always_ace`) by ACE.

    `deadline` is on the monotonic clock; `progress` is called while ACE works. If a warm `solver` is given, it is left
    running, and its own setting determines whether it enumerates small tasks.
    """

    name = CENTRAL_SOLVER

    def __init__(
        self,
        cache: SolutionCache | None = None,
        deadline: float | None = None,
        progress: Callable[[], None] | None = None,
        solver: AceProcess | None = None,
        *,
        always_ace: bool = False,
    ) -> None:
        self._solver = solver
        self._always_ace = always_ace
        self._cache = cache
        self._deadline = deadline
        self._progress = progress
        self._tables: dict[Network, tuple[Codes, ...] | None] = {}
        self._used: set[str] = set()

    def solve(self, team: Team, *, count: bool = False, withdrawal_cost: int | None = None) -> CentralAnswer:
        """Solve `team`, or count its solutions.

        Args:
            team: The team. The cost of a DCOP is minimised.
            count: True to return the number of solutions instead of one.
            withdrawal_cost: The cost of withdrawing a robot of weight 1, if robots may withdraw. Costs and withdrawals
                are then minimised together. Withdrawn robots have no values.

        Returns:
            The answer. If the deadline has passed, its verdict is `unknown`, with the best solution so far.

        Raises:
            SolverMissingError: if ACE is needed, and Java is not available.
            SolverLostError: if the solver's process died.
            UnsupportedError: if a constraint or its costs are too large.
        """
        self._used.clear()
        try:
            if withdrawal_cost is not None or (team.kind == ProblemKind.DISWCSP and not count):
                parts = computed_by(self._deadline, priced_components, team, withdrawal_cost)
                answer = self._minimum(team, parts)
            else:
                answer = self._all_components(team, count=count)
        except (SolverTimeoutError, TimeLimitError):
            return CentralAnswer(Verdict.UNKNOWN)
        if answer.verdict != Verdict.UNKNOWN and not self._used:
            self._used.add(ENUMERATION)
        return replace(answer, solvers=tuple(sorted(self._used)))

    def solutions(self, team: Team, limit: int | None = None, timeout_s: float | None = None) -> Iterator[Assignment]:
        """Yield each assignment without violated hard constraints once. Costs are ignored.

        Args:
            team: The team.
            limit: The number of solutions that are needed. None: all. More than `limit` solutions may be found.
            timeout_s: A time limit for each search, in seconds. A search finds many solutions.

        Raises:
            SolverTimeoutError: if a time limit is reached.
            TimeLimitError: if a time limit is reached before a search.
        """
        with ExitStack() as processes:
            ace = self._solver or processes.enter_context(AceProcess(always=self._always_ace))
            spare = processes.enter_context(AceProcess(always=True))

            def search(network: Network, size: int) -> SolverAnswer:
                self._deadline = None if timeout_s is None else time.monotonic() + timeout_s
                return self._search(network, ace, spare, _SearchRequest(limit=size, in_order=True))

            self._deadline = None if timeout_s is None else time.monotonic() + timeout_s
            variables, constraints = team.variables.values(), list(team.constraints())
            parts = computed_by(self._deadline, components, variables, constraints, may_split=True)
            if any(part.network.impossible for part in parts):
                return
            parts.sort(key=lambda part: -math.prod(len(domain) for domain in part.network.domains))
            first, *others = (listed_solutions(part.network, search, limit) for part in parts)
            replayable = [*map(Replayable, others)]
            if not all(any(True for _ in one) for one in replayable):
                return
            for found in combinations([first, *replayable]):
                assignment: dict[str, int] = {}
                for part, codes in zip(parts, found, strict=True):
                    assignment.update(zip(part.names, part.decoded(codes), strict=True))
                yield {name: assignment[name] for name in team.variables}

    def first_solution(self, part: Component) -> SolverAnswer:
        """Return one solution of a connected component, or the answer that there is none.

        Raises:
            SolverTimeoutError: if the deadline has passed during the search.
            TimeLimitError: if the deadline has passed before the search.
        """
        with ExitStack() as processes:
            ace = self._solver or processes.enter_context(AceProcess(always=self._always_ace))
            spare = processes.enter_context(AceProcess(always=True))
            return self._solve(part, ace, spare, count=False)

    def _all_components(self, team: Team, *, count: bool) -> CentralAnswer:
        """Solve the components of a problem without costs, the smallest first, or multiply their counts."""
        with ExitStack() as processes:
            ace = self._solver or processes.enter_context(AceProcess(always=self._always_ace))
            spare = processes.enter_context(AceProcess(always=True))
            variables, constraints = team.variables.values(), list(team.constraints())
            parts = computed_by(self._deadline, components, variables, constraints, may_split=True, may_add=not count)
            if sum(len(table.rows) for part in parts for table in part.network.tables) > MANY_ROWS:
                ace.start()
            parts.sort(key=lambda part: math.prod(len(domain) for domain in part.network.domains))
            found = []
            for part in parts:
                found.append(self._solve(part, ace, spare, count=count))
                if not found[-1].found:
                    return CentralAnswer(Verdict.NO_SOLUTION, count=0 if count else None)
        if count:
            return CentralAnswer(Verdict.SOLUTION, count=math.prod(answer.found for answer in found))
        assignment: dict[str, int] = {}
        for part, answer in zip(parts, found, strict=True):
            assignment.update(zip(part.names, part.decoded(answer.solutions[0]), strict=True))
        return CentralAnswer(Verdict.SOLUTION, {name: assignment[name] for name in team.variables})

    def _minimum(self, team: Team, parts: list[WeightedComponent]) -> CentralAnswer:
        """Return the cheapest solution of the independent components in `parts`."""
        parts.sort(key=lambda part: math.prod(len(domain) for domain in part.network.domains))
        cost = bound = constant_costs(team)
        assignment: dict[str, int] | None = {}
        proven = True
        with ExitStack() as processes:
            ace = self._solver or processes.enter_context(AceProcess(always=self._always_ace))
            for part in parts:
                codes, optimal = self._cheapest(part, ace)
                if codes is None and optimal:
                    return CentralAnswer(Verdict.NO_SOLUTION)
                proven = proven and optimal
                bound += part.cost(codes) if codes is not None and optimal else part.base
                if codes is None or assignment is None:
                    assignment = None
                    continue
                cost += part.cost(codes)
                assignment.update(part.decoded(codes))
        if assignment is None:
            return CentralAnswer(Verdict.UNKNOWN, bound=bound)
        assignment = {name: assignment[name] for name in team.variables if name in assignment}
        return CentralAnswer(Verdict.OPTIMAL if proven else Verdict.UNKNOWN, assignment, cost=cost, bound=bound)

    def _cheapest(self, part: WeightedComponent, ace: AceProcess) -> tuple[Codes | None, bool]:
        """Return the cheapest solution found, if any, and whether it is proven to be optimal."""
        network = part.network
        if network.impossible:
            return None, True
        if len(part.part.names) == 1 and not network.formulas:
            (domain, *_), tables = network.domains, network.tables
            return min(tables[0].rows, key=lambda row: row[-1]) if tables else (domain[0],), True
        if self._time_is_over:
            return None, False
        try:
            if ace.submit(network, limit=1, costs=part.costs, deadline=self._deadline):
                self._watch(ace)
            answer = ace.answer(self._deadline)
        except SolverTimeoutError as over:
            self._used.add(ACE)
            return over.best, False
        self._used.add(_solver_name(answer))
        return (answer.solutions[0] if answer.found else None), True

    def _watch(self, ace: AceProcess) -> None:
        """Wait for the answer. Raises `SolverTimeoutError`."""
        while not select.select([ace], [], [], self._patience())[0]:
            if self._progress:
                self._progress()
            if self._time_is_over:
                raise ace.abort()

    @property
    def _time_is_over(self) -> bool:
        return self._deadline is not None and time.monotonic() >= self._deadline

    def _solve(self, part: Component, ace: AceProcess, spare: AceProcess, *, count: bool) -> SolverAnswer:
        """Return the number of solutions of one component, or its first solution."""
        network = part.network
        if network.impossible:
            return NO_SOLUTIONS
        if not network.tables and not network.formulas:
            (domain,) = network.domains
            return SolverAnswer(len(domain), complete=True, solutions=((domain[0],),))
        group = computed_by(self._deadline, symmetries, part)
        if group:
            smaller = computed_by(self._deadline, break_symmetries, network, group)
            if not count:
                return self._search(smaller, ace, spare, _SearchRequest(limit=1, in_order=True))
            first = self._search(smaller, ace, spare, _SearchRequest(limit=MAX_ORBITS, in_order=True))
            if first.complete:
                images = computed_by(self._deadline, orbits, first.solutions, group, network)
                return SolverAnswer(len(images), complete=True, solutions=())
        request = _SearchRequest(count_only=True, in_order=True) if count else _SearchRequest(limit=1)
        return self._search(network, ace, spare, request)

    def _search(self, network: Network, ace: AceProcess, spare: AceProcess, request: _SearchRequest) -> SolverAnswer:
        strong = computed_by(self._deadline, with_cliques, network, lambda clique: self._table(ace, clique))
        if strong.impossible:
            return NO_SOLUTIONS
        answer = self._race(strong, ace, spare, request)
        self._used.add(_solver_name(answer))
        return answer

    def _table(self, ace: AceProcess, clique: Network) -> tuple[Codes, ...] | None:
        """Return all solutions of a clique. None: there are too many, or the search takes too long."""
        if clique not in self._tables:
            self._tables[clique] = self._known_or_solved(ace, clique)
        return self._tables[clique]

    def _known_or_solved(self, ace: AceProcess, clique: Network) -> tuple[Codes, ...] | None:
        known = self._cache.get(clique) if self._cache else None
        if known is not None:
            self._used.add(ACE)  # the cache contains only answers of ACE
            return known if len(known) <= MAX_CLIQUE_ROWS else None
        patience = time.monotonic() + TABLE_PATIENCE_S
        deadline = patience if self._deadline is None else min(patience, self._deadline)
        try:
            answer = ace.solve(clique, limit=MAX_CLIQUE_ROWS + 1, strategy="static", deadline=deadline)
        except SolverTimeoutError:
            if self._deadline is not None and deadline == self._deadline:
                raise
            return None
        self._used.add(_solver_name(answer))
        if not answer.complete or answer.found > MAX_CLIQUE_ROWS:
            return None
        if self._cache and answer.means == SolvedBy.ACE:
            self._cache.put(clique, answer.solutions)
        return answer.solutions

    def _race(self, network: Network, first: AceProcess, second: AceProcess, request: _SearchRequest) -> SolverAnswer:
        """Return the answer of the faster of two strategies; the second starts if the first takes long."""
        usual, other = request.strategies
        limit, count_only, deadline = request.limit, request.count_only, self._deadline
        if not first.submit(network, limit=limit, count_only=count_only, strategy=usual, deadline=deadline):
            return first.answer()
        running = [first]
        hedge = time.monotonic() + HEDGE_S
        while not (ready := select.select(running, [], [], self._patience())[0]):
            if self._progress:
                self._progress()
            if self._time_is_over:
                break
            if second not in running and time.monotonic() >= hedge:
                second.submit(network, limit=limit, count_only=count_only, strategy=other, deadline=deadline)
                running.append(second)
        for ace in running:
            if ace not in ready[:1]:
                ace.close()
        if not ready:
            raise SolverTimeoutError
        winner: AceProcess = ready[0]
        return winner.answer(self._deadline)

    def _patience(self) -> float:
        return _TICK_S if self._deadline is None else max(0.0, min(_TICK_S, self._deadline - time.monotonic()))


def _solver_name(answer: SolverAnswer) -> str:
    return ACE if answer.means == SolvedBy.ACE else ENUMERATION
