"""Finds the solutions of a model one by one, or the reason why a model has no solution."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from robochoc.model.costs import cost_converter, normalized
from robochoc.model.outcome import Metrics, Verdict
from robochoc.model.problem import INFINITE, Assignment, ProblemKind
from robochoc.modelling.functions import forbidden
from robochoc.modelling.numbers import whole_number
from robochoc.run.defaults import CENTRAL
from robochoc.run.evaluation import check_assignment
from robochoc.run.options import CentralSolverName, Options
from robochoc.run.orchestrator import solve
from robochoc.solver.ace import AceProcess
from robochoc.solver.cache import SolutionCache
from robochoc.solver.central import CentralSolver
from robochoc.solver.compile import CompileLimits
from robochoc.solver.errors import SolverTimeoutError, UnsupportedError
from robochoc.system.errors import OptionError, RobochocError
from robochoc.system.time_limit import TimeLimitError
from robochoc.verification.checker import check_user_cost
from robochoc.verification.repeated_check import RepeatedCheck

if TYPE_CHECKING:
    from robochoc.modelling.constraints import ModelConstraint
    from robochoc.modelling.model import Model
    from robochoc.modelling.solution import Solution

LISTING_OPTIONS = frozenset({"cache", "central_with", "local", "runtime", "seed", "timeout"})
"""The options with which solutions can be listed. The others are for single searches, such as a journal."""
LISTINGS = {1: 1_000, 4: 10_000, 16: 100_000}
"""The maximum numbers of solutions with costs that are listed and sorted, by the number of searches before."""
LISTING_PATIENCE = 3.0
"""The maximum time for listing solutions with costs, as a multiple of the time of the searches before."""

Test = Callable[[Collection[int]], bool]
"""Returns whether the constraints with these indices can hold together."""


def solutions_of(model: Model, protocol: str, limit: int | None, options: dict[str, Any]) -> Iterator[Solution]:
    """Yield the distinct solutions of a model. The central solver lists them, others search for one at a time.

    Raises:
        OptionError: if the robots may withdraw: the values of a solution would exclude more than that solution.
        UnsupportedError: if events change the model.
        ExplorationError: if a search ends without a verdict.
    """
    if options.get("withdraw"):
        raise OptionError("solutions() cannot be used with withdraw: it lists solutions for all robots")
    _refuse_events(model, "solutions()")
    if limit is not None and ((number := whole_number(limit)) is None or number < 0):
        raise OptionError(f"limit={limit!r} is not allowed; expected None, or an integer, 0 or more")
    if limit == 0:
        return
    local = options.get("local")
    with AceProcess(always=isinstance(local, CompileLimits) and local.always_ace) as solver:
        for number, solution in enumerate(_solutions(_Searches(model, protocol, options, solver), limit), 1):
            yield solution
            if number == limit:
                return


class _Searches:
    """Searches for one solution each; after each, a constraint excludes its values.

    Attributes:
        team: The team of the model, without the constraints that exclude solutions.
        found: The solutions so far.
        spent_s: The time of all searches so far, in seconds.
    """

    def __init__(self, model: Model, protocol: str, options: Mapping[str, Any], solver: AceProcess) -> None:
        self.found: list[Solution] = []
        self.spent_s = 0.0
        self._options = options
        self._solver = solver
        self._protocol = protocol
        self._model = copy.copy(model)
        self._model._solver = solver  # noqa: SLF001 - not for users; starting Java takes longer than most searches
        self.team = self._model.team

    def next(self) -> Solution | None:
        """Return another solution; None if there is no other. Raises `ExplorationError`."""
        began = time.monotonic()
        solution = self._model.solve(self._protocol, **self._options)
        self.spent_s += time.monotonic() - began
        if solution.verdict == Verdict.UNKNOWN:
            raise _undecided(len(self.found) + 1, solution.reason or "a limit was reached")
        if not solution:
            return None
        self.found.append(solution)
        values = {one: solution.values[name] for name, one in self._model.variables.items() if name in solution.values}
        self._model.add(forbidden([*values], [[*values.values()]]))
        return solution

    @property
    def can_list(self) -> bool:
        """True if the central solver can list the other solutions instead of searching for each."""
        solver = self._options.get("central_with", CentralSolverName.AUTO)
        ace = solver in {CentralSolverName.AUTO, CentralSolverName.ACE}
        return (
            self.found[0].protocol == CENTRAL
            and not self.team.objectives
            and ace
            and self._options.keys() <= LISTING_OPTIONS
        )

    @property
    def timeout_s(self) -> float | None:
        """The time limit of each search, in seconds."""
        return self._options.get("timeout")

    def listing(self, limit: int | None, timeout_s: float | None) -> Iterator[Assignment]:
        """Yield the solutions, also those already found, without their costs. See `CentralSolver.solutions`."""
        cache = SolutionCache() if self._options.get("cache", True) else None
        return CentralSolver(cache, solver=self._solver).solutions(self.team, limit, timeout_s)


def _solutions(searches: _Searches, limit: int | None) -> Iterator[Solution]:
    """Yield the solutions: of problems with costs, one search for each until listing all of them is affordable."""
    while (solution := searches.next()) is not None:
        yield solution
        if not searches.can_list:
            continue
        if searches.team.kind == ProblemKind.DISCSP:
            yield from _listed(searches, limit)
            return
        size = LISTINGS.get(len(searches.found))
        if size is not None and (priced := _priced(searches, size)) is not None:
            yield from _with_costs(searches, priced)
            return


def _listed(searches: _Searches, limit: int | None) -> Iterator[Solution]:
    """Yield the solutions after the first one, listed by the central solver and checked."""
    first, number = searches.found[0], 1
    checker = RepeatedCheck(searches.team)
    try:
        for assignment in searches.listing(limit, searches.timeout_s):
            if assignment != first.assignment:
                if checker.cost(assignment) == INFINITE:
                    check_assignment(searches.team, assignment)
                number += 1
                yield replace(first, assignment=dict(assignment), metrics=Metrics())
    except (SolverTimeoutError, TimeLimitError):
        raise _undecided(number + 1, "the time limit was reached") from None


def _priced(searches: _Searches, size: int) -> list[tuple[float, Assignment]] | None:
    """Return the normalised costs of all solutions, and the solutions, the cheapest first.

    Returns None if there are more than `size`, or listing takes longer than `LISTING_PATIENCE` times the searches.
    """
    team = normalized(searches.team)
    until = time.monotonic() + max(1.0, LISTING_PATIENCE * searches.spent_s)
    priced: list[tuple[float, Assignment]] = []
    checker = RepeatedCheck(team)
    try:
        for assignment in searches.listing(size + 1, until - time.monotonic()):
            if len(priced) == size or time.monotonic() > until:
                return None
            if (cost := checker.cost(assignment)) == INFINITE:
                check_assignment(team, assignment)
            priced.append((cost, assignment))
    except (SolverTimeoutError, TimeLimitError):
        return None
    return sorted(priced, key=itemgetter(0))


def _with_costs(searches: _Searches, priced: Iterable[tuple[float, Assignment]]) -> Iterator[Solution]:
    """Yield the `priced` solutions that were not found yet."""
    team = normalized(searches.team)
    in_user_units = cost_converter(team)
    known = [solution.assignment for solution in searches.found]
    for total, assignment in priced:
        if assignment not in known:
            cost = in_user_units(total)
            if team is not searches.team:
                check_user_cost(searches.team, assignment, cost)
            yield replace(searches.found[0], assignment=dict(assignment), cost=cost, metrics=Metrics())


def _undecided(number: int, why: str) -> ExplorationError:
    return ExplorationError(f"the search for solution {number} ended without a verdict: {why}")


class ExplorationError(RobochocError):
    """A search ended without a verdict: at a limit, or because the protocol is incomplete."""


def _refuse_events(model: Model, function: str) -> None:
    if model.events:
        raise UnsupportedError(f"{function} is for models that do not change, but {model.name} has events")


def conflict_of(model: Model, timeout: float | None) -> tuple[ModelConstraint, ...] | None:
    """Return a minimal set of hard constraints that cannot hold together, or None if all constraints can hold together.

    The algorithm is QuickXplain (Junker, AAAI 2004); the central solver tests whether sets can hold together.

    Raises:
        UnsupportedError: if the model was loaded, so that its constraints are not objects of this model, or changes.
        ExplorationError: if the time limit was reached.
    """
    _refuse_events(model, "conflict()")
    if model.given is not None:
        if model.imported:
            raise UnsupportedError(
                "conflict() does not know CPMpy's constraints; call cpmpy.tools.mus with the constraints of your CPMpy"
                " model, not of this model"
            )
        raise UnsupportedError(
            "conflict() requires constraints that were added by add(); this model was loaded from files"
        )
    until = None if timeout is None else time.monotonic() + timeout
    every = _constraints(model)
    hard = [place for place, one in enumerate(every) if one.cost is None]
    with AceProcess() as solver:

        def can_hold(places: Collection[int]) -> bool:
            left = None if until is None else max(0.0, until - time.monotonic())
            options = Options(protocol=CENTRAL, timeout=left)
            verdict = solve(_with_only(model, places).team, options, solver=solver).verdict
            if verdict == Verdict.UNKNOWN:
                raise ExplorationError(f"no conflict was found within {timeout:g} s: set a longer timeout")
            return verdict != Verdict.NO_SOLUTION

        if can_hold(hard):
            return None
        found = sorted(_minimal([], hard, can_hold, test=False)) if can_hold([]) else []
    return tuple(every[place] for place in found)


def _constraints(model: Model) -> list[ModelConstraint]:
    return [*model.constraints, *(part for robot in model.robots.values() for part in robot.parts)]


def _with_only(model: Model, places: Collection[int]) -> Model:
    """Return a copy of a model without costs, and with only the constraints at these indices."""
    smaller = copy.copy(model)
    smaller.clear_objective()
    for place, constraint in enumerate(_constraints(smaller)):
        if place not in places:
            smaller.remove(constraint)
    return smaller


def _minimal(given: Sequence[int], open_: Sequence[int], can_hold: Test, *, test: bool) -> list[int]:
    """Return a minimal subset of `open_` that cannot hold together with `given`. All of `open_` cannot.

    `test` is true if `given` alone may already be in conflict.
    """
    if test and not can_hold(given):
        return []
    if len(open_) == 1:
        return [*open_]
    half = len(open_) // 2
    first, second = open_[:half], open_[half:]
    of_second = _minimal([*given, *first], second, can_hold, test=True)
    of_first = _minimal([*given, *of_second], first, can_hold, test=bool(of_second))
    return of_first + of_second
