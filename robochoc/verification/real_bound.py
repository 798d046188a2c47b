"""Lower bounds of the cost of teams with real variables, by branch and bound over boxes of values.

The bound of a box is the best of three: interval arithmetic, the mean value form (Moore, "Interval Analysis", 1966),
and, if the costs are convex, a tangent at the known assignment, which needs no small boxes. All numbers are exact.
Independent parts of the team are bounded separately. The module shares no code with the protocols and solvers.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from typing import NamedTuple

from robochoc.model.constraint import INFINITE, Constraint, Function, Predicate, Relation
from robochoc.model.cost_units import Cost, common_units
from robochoc.model.expression import Apply, Constant, Expression, UndefinedValueError, evaluate, names
from robochoc.model.expression.bounds import Interval, bounds
from robochoc.model.expression.slopes import Number, local_model
from robochoc.model.magnitudes import extent
from robochoc.model.problem import Assignment, Team
from robochoc.verification.price_tables import ROWS, PriceTable, count_in, price_table

EVALUATIONS = 40_000
"""The default maximum number of evaluations of a cost over a box."""

_TANGENTS = 60
"""The maximum number of tangents of convex costs."""
_FINENESS = 1024

_Box = dict[str, Interval]


class Certificate(NamedTuple):
    """A proven statement on all assignments of a team whose real variables are multiples of the precision.

    Attributes:
        bound: A bound of the cost in the user's units: no assignment costs less (or is worth more, if costs are
            maximised). None: no finite bound is known.
        is_infeasible: True if no assignment satisfies the hard constraints.
    """

    bound: Cost | None
    is_infeasible: bool = False


class _Cost(NamedTuple):
    """A cost: `weight` times the value of an expression, which is less than `slack` away from the true cost."""

    body: Expression
    weight: int
    slack: int = 0


class _Problem(NamedTuple):
    """A part of a team that shares no variables with the other parts. Costs are minimised.

    Attributes:
        box: The intervals of its variables.
        costs: The costs over these variables.
        hard: The hard predicates.
        tables: The relations, which have no expression.
        domains: The values of the variables, by name; of real variables, all multiples of the precision.
        restricted: The variables in hard constraints and relations.
    """

    box: _Box
    costs: Sequence[_Cost]
    hard: Sequence[Expression]
    tables: Sequence[PriceTable]
    domains: dict[str, Sequence[range]]
    restricted: Collection[str]

    @property
    def work(self) -> int:
        """The work for a box, in evaluations of a cost."""
        return len(self.costs) + len(self.hard) + sum(len(table.prices) // ROWS + 1 for table in self.tables)

    def least_price(self, box: _Box) -> int | None:
        """Return a lower bound of the costs in relations over `box`. None: `box` contains no allowed values."""
        counts = {name: count_in(self.domains[name], part) for name, part in box.items()}
        prices = [table.least(box, counts) for table in self.tables]
        if not all(counts.values()) or None in prices:
            return None
        return sum(price for price in prices if price is not None)


class _Open(NamedTuple):
    """A box that has not been excluded, with its bound and the slopes of the costs."""

    bound: int
    number: int
    box: _Box
    slopes: Mapping[str, Interval]


def certificate(
    team: Team, best: Assignment, evaluations: int = EVALUATIONS, is_late: Callable[[], bool] = lambda: False
) -> Certificate:
    """Return a bound of the cost of all assignments of `team`, on any grid.

    Args:
        team: The team, without normalised costs. Robots must not withdraw.
        best: The best known assignment, or no values.
        evaluations: The maximum number of evaluations of a cost over a box, for all parts together.
        is_late: Returns whether the search must end.
    """
    units = common_units(robot.costs for robot in team.robots)
    sign = -1 if units.maximize else 1
    finest = math.lcm(*(_divisor(one) for one in team.constraints()))
    problems = _parts(team, units.places, sign * finest)
    work = sum(problem.work for problem in problems) or 1
    total = 0
    for problem in problems:
        bound = _bound(problem, best, evaluations * problem.work // work, is_late)
        if bound is None:
            return Certificate(None, is_infeasible=True)
        total += bound
    return Certificate(units.in_user_units(sign * -(-total // finest)))  # costs are integers: the bound is rounded up


def _bound(problem: _Problem, best: Assignment, evaluations: int, is_late: Callable[[], bool]) -> int | None:
    """Return a lower bound of the costs; None if the hard constraints cannot be satisfied."""
    count = itertools.count()
    known = _cost_at(problem, best) if problem.box.keys() <= best.keys() else None
    first = _opened(problem, problem.box, best, next(count))
    if first is None:
        return None
    tangents = max(1, min(_TANGENTS, evaluations // max(1, len(problem.costs))))
    first = first._replace(bound=max(first.bound, _convex_bound(problem, best, tangents)))
    waiting, closed = [first], [] if known is None else [known]
    while waiting and evaluations > 0 and not is_late() and (known is None or waiting[0].bound < known):
        one = heapq.heappop(waiting)
        halves = _halves(one, () if best else problem.restricted)
        if not halves and not _is_undefined(problem, one.box):
            closed.append(one.bound)
            if known is None:
                break  # an assignment, of which no bound is lower
        for half in halves:
            evaluations -= problem.work + 1
            opened = _opened(problem, half, best, next(count))
            if opened is not None and (known is None or opened.bound < known):
                heapq.heappush(waiting, opened._replace(bound=max(opened.bound, one.bound)))
    return min([*(one.bound for one in waiting[:1]), *closed], default=None)


def _opened(problem: _Problem, box: _Box, best: Assignment, number: int) -> _Open | None:
    """Return `box` with its bound; None if it violates a hard constraint everywhere.

    Where the costs only rise or fall with a variable without hard constraints, only its better end remains.
    """
    least = problem.least_price(box)
    if least is None or any(bounds(body, box).high == 0 for body in problem.hard):
        return None
    point = {name: _nearest(best.get(name), part) for name, part in box.items()}
    intervals: float = least
    tangents, means = intervals, intervals
    slopes: dict[str, Interval] = {}
    gradient: dict[str, Interval] = {}
    steep: set[str] = set(problem.restricted)
    for cost in problem.costs:
        model = local_model(cost.body, box, point)
        low = _product(bounds(cost.body, box) if model is None else model.range, cost.weight).low - cost.slack
        intervals += low
        if model is None:
            tangents, means = tangents + low, means + low
            steep.update(names(cost.body))
            continue
        at = int(cost.weight * model.value) - cost.slack
        means += at
        _add(slopes, model.slopes, cost.weight)
        if model.convex if cost.weight > 0 else model.concave:
            tangents += at
            _add(gradient, {name: Interval(int(one), int(one)) for name, one in model.gradient.items()}, cost.weight)
        else:
            tangents += low
    means += sum(_descent(slope, box[name], point[name]) for name, slope in slopes.items())
    tangents += sum(_descent(slope, box[name], point[name]) for name, slope in gradient.items())
    left = {name: part if name in steep else _better_end(part, slopes.get(name)) for name, part in box.items()}
    return _Open(math.floor(max(intervals, means, tangents)), number, left, slopes)


def _convex_bound(problem: _Problem, best: Assignment, tangents: int) -> int:
    """Return the best bound by this number of tangents at points on the way to the minimum, if all costs are convex.

    The way follows gradients with the steps of Barzilai and Borwein (IMA Journal of Numerical Analysis 8, 1988). The
    tangents are exact, so that each of them is a bound wherever the way leads.
    """
    point: dict[str, Number] = {name: _nearest(best.get(name), part) for name, part in problem.box.items()}
    least = problem.least_price(problem.box) or 0
    lows = [_product(bounds(cost.body, problem.box), cost.weight).low - cost.slack for cost in problem.costs]
    bounds_found = [int(sum(lows)) + least]
    before: tuple[dict[str, Number], dict[str, Number]] | None = None
    for _ in range(tangents):
        bound, gradient = Fraction(least), dict[str, Number]()
        for cost in problem.costs:
            model = local_model(cost.body, problem.box, point)
            if model is None or not (model.convex if cost.weight > 0 else model.concave):
                return bounds_found[0]
            bound += cost.weight * model.value - cost.slack
            for name, slope in model.gradient.items():
                gradient[name] = gradient.get(name, 0) + cost.weight * slope
        for name, slope in gradient.items():
            low, high = problem.box[name]
            bound += min(slope * (int(high) - point[name]), slope * (int(low) - point[name]))
        bounds_found.append(math.floor(bound))
        point, before = _next_point(problem.box, point, gradient, before), (point, gradient)
    return max(bounds_found)


def _next_point(
    box: _Box,
    point: dict[str, Number],
    gradient: dict[str, Number],
    before: tuple[dict[str, Number], dict[str, Number]] | None,
) -> dict[str, Number]:
    """Return the point after a step against the gradient, in fractions of 1/`_FINENESS`."""
    widest = max((part.high - part.low for part in box.values()), default=0)
    steepest = max((abs(float(slope)) for slope in gradient.values()), default=0.0) or 1.0
    length = widest / 8 / steepest
    if before is not None:
        moved = {name: float(point[name] - before[0][name]) for name in point}
        changed = {name: float(gradient.get(name, 0) - before[1].get(name, 0)) for name in point}
        curvature = sum(moved[name] * changed[name] for name in point)
        if curvature > 0:
            length = sum(one * one for one in moved.values()) / curvature
    found: dict[str, Number] = {}
    for name, (low, high) in box.items():
        target = min(max(float(point[name]) - length * float(gradient.get(name, 0)), low), high)
        found[name] = Fraction(round(target * _FINENESS), _FINENESS)
    return found


def _nearest(value: int | None, part: Interval) -> int:
    """Return the value nearest to `value` in an interval, or its centre if there is no value."""
    low, high = int(part.low), int(part.high)
    return (low + high) // 2 if value is None else min(max(value, low), high)


def _add(slopes: dict[str, Interval], added: Mapping[str, Interval], weight: int) -> None:
    for name, slope in added.items():
        low, high = _product(slope, weight)
        before = slopes.get(name, _ZERO)
        slopes[name] = Interval(before.low + low, before.high + high)


def _product(part: Interval, weight: int) -> Interval:
    low, high = sorted((part.low * weight, part.high * weight))
    return Interval(low, high)


def _descent(slope: Interval, part: Interval, at: int) -> float:
    """Return the greatest descent in an interval from a point in it, as a number of 0 or less."""
    return min(slope.low * (part.high - at), slope.high * (part.low - at), 0)


def _better_end(part: Interval, slope: Interval | None) -> Interval:
    """Return the end of an interval with the lower cost; the whole interval if the slope has both signs."""
    if slope is None or slope.low >= 0:
        return Interval(part.low, part.low)
    return Interval(part.high, part.high) if slope.high <= 0 else part


def _halves(one: _Open, first: Collection[str]) -> list[_Box]:
    """Return both halves of a box, divided where the costs vary most. A single assignment has no halves.

    The variables `first` are divided before the others.
    """
    wide = [name for name, part in one.box.items() if part.low < part.high]
    if not wide:
        return []

    def variation(name: str) -> tuple[bool, float, float]:
        width, slope = one.box[name].high - one.box[name].low, one.slopes.get(name, _ZERO)
        return name in first, width * max(-slope.low, slope.high), width

    name = max(wide, key=variation)
    low, high = one.box[name]
    middle = int(low + high) // 2
    return [{**one.box, name: Interval(low, middle)}, {**one.box, name: Interval(middle + 1, high)}]


def _is_undefined(problem: _Problem, box: _Box) -> bool:
    """Return whether a condition or a cost is undefined, or false, for the single assignment in `box`.

    Costs with slopes are defined, and their variables may be at ends of larger boxes.
    """
    point = {name: int(part.low) for name, part in box.items()}
    steps = [cost.body for cost in problem.costs if local_model(cost.body, box, point) is None]
    try:
        for body in steps:
            evaluate(body, point)
        return not all(evaluate(body, point) for body in problem.hard)
    except UndefinedValueError:
        return True


def _cost_at(problem: _Problem, best: Assignment) -> int | None:
    """Return the cost of an assignment; None if it is undefined."""
    least = problem.least_price({name: Interval(best[name], best[name]) for name in problem.box})
    try:
        return None if least is None else least + sum(cost.weight * evaluate(cost.body, best) for cost in problem.costs)
    except UndefinedValueError:
        return None


def _parts(team: Team, places: int, weight: int) -> list[_Problem]:
    """Return the independent parts of a team, with costs in units of 10**-`places` times `weight`."""
    leader: dict[str, str] = {name: name for name in team.variables}

    def found(name: str) -> str:
        while leader[name] != name:
            leader[name] = name = leader[leader[name]]
        return name

    for constraint in team.constraints():
        first, *others = constraint.variables
        for other in others:
            leader[found(other)] = found(first)
    groups: dict[str, _Problem] = {}
    for name, variable in team.variables.items():
        group = groups.setdefault(found(name), _Problem({}, [], [], [], {}, set()))
        group.box[name] = extent(variable.domain)
        ranges = variable.domain.ranges
        group.domains[name] = [range(one.low, one.high + 1)] if (one := variable.domain.real) else ranges
    for robot in team.robots:
        unit = weight * 10 ** (places - robot.costs.places)
        for constraint in robot.constraints():
            name = found(constraint.variables[0])
            groups[name] = _with_constraint(groups[name], constraint, unit, places, weight)
    return [*groups.values()]


def _with_constraint(problem: _Problem, constraint: Constraint, unit: int, places: int, weight: int) -> _Problem:
    """Return `problem` with a constraint, whose costs are multiplied by `unit`, or by `weight` if it is a function."""
    match constraint.definition:
        case Relation() as relation:
            table = price_table(constraint, relation, unit, problem.domains)
            restricted = {*problem.restricted, *constraint.variables}
            return problem._replace(tables=[*problem.tables, table], restricted=restricted)
        case Function() as function:
            factor = weight * 10 ** (places - function.places)
            match constraint.applied:
                case Apply("div", (dividend, Constant(divisor))) if divisor > 0:
                    cost = _Cost(dividend, factor // divisor, abs(factor))
                case body:
                    cost = _Cost(body, factor)
            return problem._replace(costs=[*problem.costs, cost])
        case Predicate() if constraint.cost == INFINITE:
            restricted = {*problem.restricted, *constraint.variables}
            return problem._replace(hard=[*problem.hard, constraint.applied], restricted=restricted)
        case _:
            body = Apply("if", (constraint.applied, Constant(0), Constant(int(constraint.cost))))
            return problem._replace(costs=[*problem.costs, _Cost(body, unit)])


def _divisor(constraint: Constraint) -> int:
    """Return the constant by which the value of a function is divided at last; 1 if there is none."""
    if isinstance(constraint.definition, Function):
        match constraint.applied:
            case Apply("div", (_, Constant(divisor))) if divisor > 0:
                return divisor
    return 1


_ZERO = Interval(0, 0)
