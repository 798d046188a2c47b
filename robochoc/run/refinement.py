"""Finds values of real variables on grids: first on the grids of the files, then on finer ones around the answer.

Each grid is an ordinary problem, which any protocol solves in any runtime. The last grids have the step of the
precision. Grids prove nothing about values between their points: the bound of the cost comes from
`verification/real_bound.py`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from msgspec import structs

from robochoc.journal.events import AnyEvent, Began, Observer
from robochoc.model.constraint import Domain, united_ranges
from robochoc.model.outcome import GridSearch, Outcome, Verdict
from robochoc.model.problem import ProblemKind, Team
from robochoc.model.real import RealInterval
from robochoc.model.symbols import real_places
from robochoc.model.team_edits import on_intervals
from robochoc.run.defaults import CENTRAL
from robochoc.run.evaluation import NOT_ON_GRIDS
from robochoc.run.options import Options
from robochoc.run.registry import protocol_named
from robochoc.solver.agent_problem import StartValues

if TYPE_CHECKING:
    from fractions import Fraction

MAX_GRIDS = 40
"""The maximum number of grids in a run."""
_MOST_MOVES = 3
"""The maximum number of grids in a row with the same step, whose answers are at the edge of the grid."""
_REACHES = {1: 6, 2: 4, 3: 2}
"""The minimum number of points on each side of the centre of a finer grid, by the real variables of the robot."""
_MOST_POINTS = 65
"""The maximum number of points of a grid that becomes denser, because it has no solution."""

_USED = 0.98
"""The part of the time until a deadline that grids may use."""

SolveGrid = Callable[[Team, Options, int, str], Outcome]
"""A function that solves a team on its present grids, with options. It receives their number and a description."""


class _Grid(NamedTuple):
    """The grid of a variable: its centre and step, in steps of the precision, and the points on each side."""

    real: RealInterval
    centre: int
    step: int
    reach: int

    @property
    def values(self) -> tuple[range, ...]:
        """The points in the interval, as ranges of a domain."""
        points = (self.centre + place * self.step for place in range(-self.reach, self.reach + 1))
        kept = dict.fromkeys(min(max(point, self.real.low), self.real.high) for point in points)
        return tuple(range(value, value + 1) for value in sorted(kept))

    def is_at_edge(self, value: int) -> bool:
        """Return whether better values may lie beyond the end of the grid at which `value` is."""
        is_end = value in {self.real.low, self.real.high}
        return not is_end and abs(value - self.centre) >= self.reach * self.step


def refines(team: Team, options: Options) -> bool:
    """Return whether the run of `team` replaces grids by finer ones.

    Teams with a scenario, and runs that count or list solutions, stay on the grids of the files.
    """
    if team.dynamic or options.count or options.improve is not None or options.refine == math.inf:
        return False
    return bool(real_places(team))


def solve_on_grids(team: Team, options: Options, solve_grid: SolveGrid) -> Outcome:
    """Return the best assignment on all grids, with a bound of the cost of any assignment.

    A continuous protocol needs no finer grids: its robots choose values anywhere in the intervals.

    Args:
        team: The team, without normalised costs.
        options: How to run, with the name of a protocol.
        solve_grid: Solves a team on its present grids.
    """
    grids: dict[str, _Grid] = {}
    for robot in team.robots:
        real = [(one.name, one.domain, one.domain.real) for one in robot.variables if one.domain.real]
        grids |= {name: _first_grid(interval, domain, len(real)) for name, domain, interval in real}
    scale = 10 ** max(grid.real.places for grid in grids.values())
    least = max(1, round((options.refine or 0) * scale))
    team_now = _with_values(team, options.start, grids)
    if options.protocol != CENTRAL and protocol_named(options.protocol).traits.continuous:
        until = None if options.limit_s is None else time.monotonic() + options.limit_s
        return _certified(team, solve_grid(on_intervals(team_now), options, 0, ""), until)
    best: Outcome | None = None
    history: list[GridSearch] = []
    moves, began, limit_s, deadline = 0, time.monotonic(), options.limit_s, options.deadline
    while True:
        step = max(grid.step for grid in grids.values())
        if deadline is not None:
            options = replace(options, deadline=_next_deadline(deadline, time.monotonic() - began, best))
        outcome = solve_grid(team_now, options, len(history), f"grids with the step {step / scale}")
        history.append(GridSearch(step / scale, outcome.verdict, outcome.cost))
        best = outcome if best is None else _better(team, best, outcome)
        is_over = len(history) == MAX_GRIDS or bool(outcome.lost)
        is_over = is_over or _is_over(options, best, limit_s, time.monotonic() - began)
        if is_over or (best.assignment and team.kind == ProblemKind.DISCSP):
            break
        if best.assignment:
            moves = moves + 1 if moves < _MOST_MOVES and _is_at_edge(grids, best) else 0
            finer = {name: _around(grid, best.assignment.get(name), least, moves) for name, grid in grids.items()}
        else:
            is_unfinished = deadline is not None and outcome.verdict == Verdict.UNKNOWN
            finer = grids if is_unfinished else {name: _denser(grid) for name, grid in grids.items()}
        if (finer == grids and best.assignment) or max(2 * grid.reach for grid in finer.values()) > _MOST_POINTS:
            break
        grids, team_now = finer, _on_grids(team, finer)
        options = _next_options(options, best, outcome)
    best = replace(best, grids=tuple(history), deadline=None if best.deadline is None else deadline)
    return _certified(team, best, None if limit_s is None else began + limit_s)


def _first_grid(real: RealInterval, domain: Domain, dimensions: int) -> _Grid:
    """Return the grid of a domain, as if its points were evenly spaced.

    Later grids of the robot, which has `dimensions` real variables, have at least the points in `_REACHES`.
    """
    points = len(domain)
    step = -(-(real.high - real.low) // max(points - 1, 1))
    reach = max(points // 2, _REACHES.get(dimensions, 1))
    return _Grid(real, (real.low + real.high) // 2, step, reach)


def _is_at_edge(grids: Mapping[str, _Grid], best: Outcome) -> bool:
    return any(grid.is_at_edge(best.assignment.get(name, grid.centre)) for name, grid in grids.items())


def _around(grid: _Grid, value: int | None, least: int, moves: int) -> _Grid:
    """Return a finer grid around `value`; after answers at the edge (`moves`), one with the same step."""
    if value is None:  # the robot has withdrawn
        return grid
    step = grid.step if moves else max(least, -(-grid.step // max(grid.reach, 2)))
    return grid._replace(centre=value, step=step)


def _denser(grid: _Grid) -> _Grid:
    """Return a grid with more points in the whole interval."""
    reach = 2 * grid.reach
    return grid._replace(reach=reach, step=max(1, -(-(grid.real.high - grid.real.low) // (2 * reach))))


def _on_grids(team: Team, grids: Mapping[str, _Grid]) -> Team:
    """Return `team` with these grids. It is as valid as `team`."""
    robots = []
    for robot in team.robots:
        own = (
            replace(one, domain=replace(one.domain, ranges=grids[one.name].values)) if one.name in grids else one
            for one in robot.variables
        )
        robots.append(replace(robot, variables=tuple(own)))
    return replace(team, robots=tuple(robots))


def _with_values(team: Team, start: StartValues, grids: Mapping[str, _Grid]) -> Team:
    """Return `team` with grids that contain the start values in the intervals."""
    robots = []
    for robot in team.robots:
        own = []
        for one in robot.variables:
            value, grid = start.get(one.name), grids.get(one.name)
            if value is not None and grid is not None and grid.real.low <= value <= grid.real.high:
                ranges = united_ranges([*one.domain.ranges, range(value, value + 1)])
                one = replace(one, domain=replace(one.domain, ranges=ranges))  # noqa: PLW2901 - the same variable
            own.append(one)
        robots.append(replace(robot, variables=tuple(own)))
    return replace(team, robots=tuple(robots)) if start else team


def _next_options(options: Options, best: Outcome, last: Outcome) -> Options:
    """Return the options for the next grids, which contain the best assignment."""
    messages = options.messages
    if messages is not None:
        messages -= sum(last.metrics.messages.values())
    start: StartValues = options.start if options.protocol == CENTRAL or options.standby else best.assignment
    return replace(options, messages=messages, start=start, kill=())


def _next_deadline(deadline: float, spent_s: float, best: Outcome | None) -> float:
    """Return the deadline of the next grid: half of the remaining time, or all of it if no answer was found so far."""
    return deadline if best is not None and not best.assignment else (deadline + spent_s) / 2


def _is_over(options: Options, best: Outcome, limit_s: float | None, spent_s: float) -> bool:
    """Return whether a limit is reached. With a deadline, little time is left at last, and not used."""
    part = 1 if options.deadline is None else _USED
    messages = sum(best.metrics.messages.values())
    return (limit_s is not None and spent_s >= part * limit_s) or (
        options.messages is not None and messages >= options.messages
    )


def _better(team: Team, best: Outcome, new: Outcome) -> Outcome:
    """Return the better outcome, with the metrics of both."""
    from fractions import Fraction  # noqa: PLC0415 - start-up: rarely needed

    sign = -1 if any(robot.costs.maximize for robot in team.robots) else 1

    def rank(outcome: Outcome) -> tuple[bool, int, Fraction]:
        weight = sum(team[name].weight for name in outcome.withdrawn)
        cost = Fraction(0) if outcome.cost is None else sign * Fraction(outcome.cost)
        return not outcome.assignment, weight, cost

    return replace(min(new, best, key=rank), metrics=best.metrics + new.metrics)


def _certified(team: Team, best: Outcome, until: float | None) -> Outcome:
    """Return an outcome whose verdict and bound hold for all values, not only for those on grids.

    The search for the bound ends at `until`, a time of the monotonic clock.
    """
    best = replace(best, bound=None, count=None, optima=None, confirmed=False, confirmed_by=())
    if best.verdict == Verdict.OPTIMAL:
        best = replace(best, verdict=Verdict.SOLUTION)
    if best.withdrawn or best.lost or (best.assignment and team.kind == ProblemKind.DISCSP):
        return best
    from robochoc.verification.real_bound import EVALUATIONS, certificate  # noqa: PLC0415 - start-up: few teams need it

    def is_late() -> bool:
        return until is not None and time.monotonic() >= until

    proof = certificate(team, best.assignment, 0 if is_late() else EVALUATIONS, is_late)
    if proof.is_infeasible:
        return replace(best, verdict=Verdict.NO_SOLUTION, verified=True, witness=None, reason=_INFEASIBLE)
    if best.verdict == Verdict.NO_SOLUTION:
        return replace(best, verdict=Verdict.UNKNOWN, witness=None, verified=False, reason=NOT_ON_GRIDS)
    if best.verdict == Verdict.SOLUTION and proof.bound == best.cost:
        return replace(best, verdict=Verdict.OPTIMAL)
    return replace(best, bound=proof.bound)


_INFEASIBLE = "interval arithmetic excludes all values of the real variables"


def numbered(observer: Observer | None, number: int, opened_by: str) -> Observer | None:
    """Return an observer for the search on the grids with this `number`, which is an epoch of the run."""
    if observer is None or number == 0:
        return observer

    def observe(event: AnyEvent) -> None:
        if isinstance(event, Began):
            event = structs.replace(event, epoch=number, opened_by=opened_by)
        observer(event)

    return observe
