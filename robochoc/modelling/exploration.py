"""Finds all solutions of a model one by one, or the reason why a model has no solution."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import TYPE_CHECKING

from robochoc.model.outcome import Verdict
from robochoc.modelling.functions import forbidden
from robochoc.modelling.numbers import whole_number
from robochoc.run.defaults import CENTRAL
from robochoc.run.options import Options
from robochoc.run.orchestrator import solve
from robochoc.solver.ace import AceProcess
from robochoc.solver.compile import CompileLimits
from robochoc.solver.errors import UnsupportedError
from robochoc.system.errors import OptionError, RobochocError

if TYPE_CHECKING:
    from robochoc.modelling.constraints import ModelConstraint
    from robochoc.modelling.model import Model
    from robochoc.modelling.solution import Solution

Test = Callable[[Collection[int]], bool]
"""Returns whether the constraints with these indices can hold together."""


def solutions_of(model: Model, protocol: str, limit: int | None, options: dict[str, object]) -> Iterator[Solution]:
    """Yield the distinct solutions of a model: after each solution, a constraint excludes its values.

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
    rest = copy.copy(model)
    number = 0
    local = options.get("local")
    with AceProcess(always=isinstance(local, CompileLimits) and local.always_ace) as solver:
        rest._solver = solver  # noqa: SLF001 - not for users; starting Java takes longer than most searches
        while limit is None or number < limit:
            solution = rest.solve(protocol, **options)  # type: ignore[arg-type] # options of `solve`
            if solution.verdict == Verdict.UNKNOWN:
                why = solution.reason or "a limit was reached"
                raise ExplorationError(f"the search for solution {number + 1} ended without a verdict: {why}")
            if not solution:
                return
            yield solution
            number += 1
            values = {one: solution.values[name] for name, one in rest.variables.items() if name in solution.values}
            rest.add(forbidden([*values], [[*values.values()]]))


class ExplorationError(RobochocError):
    """A search ended without a verdict: at a limit, or because the protocol is incomplete."""


def _refuse_events(model: Model, function: str) -> None:
    if model.events:
        raise UnsupportedError(f"{function} is for models that do not change, but {model.name} has events")


def conflict_of(model: Model, timeout: float | None) -> tuple[ModelConstraint, ...] | None:
    """Return a minimal set of hard constraints that cannot hold together, or None if all can.

    The algorithm is QuickXplain (Junker, AAAI 2004); the central solver tests whether sets can hold together.

    Raises:
        UnsupportedError: if the model was loaded, so that its constraints are not objects of this model, or changes.
        ExplorationError: if the time limit was reached.
    """
    _refuse_events(model, "conflict()")
    if model.given is not None:
        if model.imported:
            raise UnsupportedError(
                "conflict() does not know CPMpy's constraints; call cpmpy.tools.mus(model.constraints) for these"
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
