"""Normalised costs: protocols and solvers work on integer costs of 0 or more, whose sum is minimised.

Users write decimals, negative costs and utilities that are maximised. `normalized` converts such a team to one with the
same solutions in the same order: utilities change their sign, functions are scaled to the team's unit, and the minimum
cost of a constraint with negative costs is subtracted from its costs (`Constraint.offset`). `user_cost` converts a sum
of normalised costs back to the user's number. All of this is integer arithmetic, so nothing is rounded.
"""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace

from robochoc.model.absence import can_be_restated, restated
from robochoc.model.constraint import (
    INFINITE,
    Constraint,
    Domain,
    Function,
    Predicate,
    Relation,
    Semantics,
    united_ranges,
)
from robochoc.model.cost_units import PLAIN_COSTS, Cost, CostUnits, common_units
from robochoc.model.expression import Apply, Constant, Expression
from robochoc.model.expression.bounds import ANY_INTEGER, Interval, bounds
from robochoc.model.problem import AddAgent, AddConstraint, AddValue, Change, Robot, ScenarioEvent, Team
from robochoc.system.errors import RobochocError

MAX_TRIED = 4096
"""The maximum number of value combinations for which the least cost of a function is computed exactly."""

Domains = Mapping[str, Domain]


class NormalizationError(RobochocError, ValueError):
    """Raised if the costs of a team cannot be normalised."""


class UnboundedCostError(NormalizationError):
    """Raised if the cost of a function has no bounds, because the domain of a variable is unknown."""


class SeveralObjectivesError(NormalizationError):
    """Raised if a single cost is required, but the team has several objectives."""


def refuse_several_objectives(one: Team | Robot) -> None:
    """Raise `SeveralObjectivesError` if the costs of a team or a robot belong to several objectives."""
    if one.objectives:
        names = ", ".join(one.objectives)
        weights = ",".join(f"{name}=1" for name in one.objectives)
        raise SeveralObjectivesError(
            f"there are several objectives ({names}), and this requires a single cost: robochoc solve and robochoc"
            f" export combine them (--objectives weighted:{weights}), and robochoc import reads the exported problem"
        )


_NORMALIZED = "_normalized"
"""The name under which a team stores its normalised form."""


def normalized(team: Team) -> Team:
    """Return `team` with minimised integer costs of 0 or more, and with the user's units in `user_units`.

    If the costs already have this form, `team` is returned unchanged. The result is stored with `team`: the choice of a
    protocol and the run both need it, and functions over many values take seconds.

    Raises:
        UnboundedCostError: if the cost of a function has no bounds.
        SeveralObjectivesError: if there are several objectives.
    """
    stored = vars(team)
    if _NORMALIZED not in stored:
        found = _normalized(team)
        stored[_NORMALIZED] = None if found is team else found
    return stored[_NORMALIZED] or team


def _normalized(team: Team) -> Team:
    if not any(map(_needs_normalizing, [*team.robots, *_joining(team)])):
        return team
    units = common_units(robot.costs for robot in team.robots)
    domains = _domains(team)
    robots = tuple(normalized_robot(robot, units, domains) for robot in team.robots)
    events = tuple(
        replace(event, changes=tuple(_normalized_change(change, units, domains) for change in event.changes))
        for event in team.scenario
    )
    return replace(team, robots=robots, scenario=events)


def normalized_robot(robot: Robot, units: CostUnits, domains: Domains) -> Robot:
    """Return `robot` with normalised costs.

    Args:
        robot: The robot.
        units: The units of the robot's team.
        domains: The known domains of variables. A cost function over a variable without a known domain must have bounds
            that follow from its expression.

    Raises:
        UnboundedCostError: if the cost of a function has no bounds.
        SeveralObjectivesError: if there are several objectives.
    """
    refuse_several_objectives(robot)
    finer = 10 ** (units.places - robot.costs.places)
    normalized_costs = robot.with_constraints(lambda one: normalized_constraint(one, units, domains, finer))
    return replace(
        normalized_costs,
        costs=PLAIN_COSTS,
        user_units=CostUnits(units.maximize, units.places, robot.costs.constant * finer),
    )


def normalized_constraint(constraint: Constraint, units: CostUnits, domains: Domains, finer: int = 1) -> Constraint:
    """Return `constraint` with costs of 0 or more. Its unit of costs is `finer` units of the team."""
    sign = -1 if units.maximize else 1
    match constraint.definition:
        case Relation(semantics=Semantics.SOFT) as relation:
            return _with_relation(constraint, relation, sign * finer)
        case Predicate() as predicate if constraint.cost < INFINITE:
            return _with_predicate(constraint, predicate, int(constraint.cost) * sign * finer)
        case Function() as function:
            return _with_function(constraint, function, sign * 10 ** (units.places - function.places), domains)
        case Relation() | Predicate():
            return constraint


def user_cost(team: Team, total: float, without: Collection[str] = ()) -> Cost:
    """Return a cost in the user's units.

    Args:
        team: A normalised team.
        total: A sum of normalised costs of the constraints of `team`.
        without: The withdrawn robots. Their constraints were restated or dropped.
    """
    return cost_converter(team, without)(total)


def cost_converter(team: Team, without: Collection[str] = ()) -> Callable[[float], Cost]:
    """Return `user_cost` for many sums: the offsets of all constraints are added once."""
    sign = -1 if team.user_units.maximize else 1
    offset = _taken_out(team, without)
    return lambda total: team.user_units.in_user_units(sign * (int(total) + offset))


def flat_units(team: Team) -> CostUnits:
    """Return the user's units of a normalised `team`, with the offsets of its constraints in the constant."""
    sign = -1 if team.user_units.maximize else 1
    return replace(team.user_units, constant=team.user_units.constant + sign * _taken_out(team))


def _taken_out(team: Team, without: Collection[str] = ()) -> int:
    absent = {name for name in team.variables if team.owner[name] in without}
    in_force = (restated(constraint, absent) if absent else constraint for constraint in team.constraints())
    return sum(constraint.offset for constraint in in_force if constraint is not None)


def normalized_joining(team: Team, robot: Robot) -> Robot:
    """Return `robot`, as read from its file, with normalised costs for a `team` that it joins or rejoins.

    Raises:
        UnboundedCostError: if the cost of a function has no bounds, or the bounds of another robot's function were
            computed for other values than the robot's variables have now.
    """
    before = _domains(team)
    domains = dict(before)
    _widen(domains, robot)
    own = {variable.name for variable in robot.variables}
    wider = {name for name in own if name in before and len(domains[name]) > len(before[name])}
    for constraint in _held_by_others(team, robot.name):
        if isinstance(constraint.definition, Function) and (new := wider.intersection(constraint.variables)):
            raise UnboundedCostError(
                f"{min(new)} has new values, but bounds of other robots' functions hold for its old values only"
            )
    return normalized_robot(robot, team.user_units, domains)


def normalized_event(team: Team, event: ScenarioEvent) -> ScenarioEvent:
    """Return `event`, which is not in the scenario, with normalised costs for `team`.

    Raises:
        UnboundedCostError: if the cost of a function in the event has no bounds, or a value is added to a variable, but
            the bounds of its functions were computed for its current values.
    """
    domains = _domains(replace(team, scenario=(event,)))
    for change in event.changes:
        if isinstance(change, AddValue) and any(
            isinstance(constraint.definition, Function) and change.variable in constraint.variables
            for constraint in team.constraints()
        ):
            raise UnboundedCostError(
                f"the value {change.value} of {change.variable} is new, but the bounds of its functions hold for the"
                " values in the files and the scenario only"
            )
    changes = tuple(_normalized_change(change, team.user_units, domains) for change in event.changes)
    return replace(event, changes=changes)


def _needs_normalizing(robot: Robot) -> bool:
    """Return whether the costs of `robot` are not normalised yet."""
    if robot.user_units != PLAIN_COSTS:
        return False
    return bool(robot.objectives) or robot.costs != PLAIN_COSTS or any(map(_may_be_negative, robot.constraints()))


def _may_be_negative(constraint: Constraint) -> bool:
    match constraint.definition:
        case Relation() as relation:
            return relation.finite_costs[0] < 0
        case Predicate():
            return constraint.cost < 0
        case Function():
            return True


def _joining(team: Team) -> list[Robot]:
    changes = itertools.chain.from_iterable(event.changes for event in team.scenario)
    return [change.robot for change in changes if isinstance(change, AddAgent)]


def _held_by_others(team: Team, name: str) -> Iterable[Constraint]:
    """Yield the constraints held by all robots except `name`, now or after some event."""
    for robot in [*team.robots, *_joining(team)]:
        if robot.name != name:
            yield from robot.constraints()
    for event in team.scenario:
        for change in event.changes:
            if isinstance(change, AddConstraint) and change.agent != name:
                yield change.constraint


def _domains(team: Team) -> dict[str, Domain]:
    """Return the domains of all variables, including the values added by the scenario."""
    domains = {name: variable.domain for name, variable in team.variables.items()}
    for event in team.scenario:
        for change in event.changes:
            if isinstance(change, AddAgent):
                _widen(domains, change.robot)
            elif isinstance(change, AddValue) and change.variable in domains:
                _add(domains, change.variable, [range(change.value, change.value + 1)])
    return domains


def _widen(domains: dict[str, Domain], robot: Robot) -> None:
    """Add the domains of `robot`: a robot that has left may rejoin with other values."""
    for variable in robot.variables:
        domains.setdefault(variable.name, variable.domain)
        _add(domains, variable.name, variable.domain.ranges)


def _add(domains: dict[str, Domain], variable: str, ranges: Iterable[range]) -> None:
    known = domains[variable]
    domains[variable] = replace(known, ranges=united_ranges([*known.ranges, *ranges]))


def _normalized_change(change: Change, units: CostUnits, domains: Domains) -> Change:
    match change:
        case AddAgent(robot):
            return replace(change, robot=normalized_robot(robot, units, domains))
        case AddConstraint(constraint=constraint):
            return replace(change, constraint=normalized_constraint(constraint, units, domains))
        case _:
            return change


def _with_relation(constraint: Constraint, relation: Relation, factor: int) -> Constraint:
    costs = [_scaled(cost, factor) for cost in relation.costs]
    default = _scaled(relation.default_cost, factor)
    least = int(min(0, *costs, default))
    moved = replace(
        relation, costs=tuple(cost - least for cost in costs), default_cost=default - least if least else default
    )
    return replace(constraint, definition=moved, offset=least)


def _scaled(cost: float, factor: int) -> float:
    return INFINITE if cost == INFINITE else int(cost) * factor


def _with_predicate(constraint: Constraint, predicate: Predicate, cost: int) -> Constraint:
    """Return a predicate with this `cost`. If it is negative: a function that is positive if the predicate holds."""
    if cost >= 0:
        return replace(constraint, cost=cost)
    body = Apply("if", (predicate.body, Constant(-cost), Constant(0)))
    name = predicate.name.removeprefix("global:")
    function = Function(name, predicate.parameters, body, predicate.symbolic, predicate.real)
    return replace(constraint, definition=function, cost=INFINITE, offset=cost)


def _with_function(constraint: Constraint, function: Function, factor: int, domains: Domains) -> Constraint:
    """Return a function whose expression is bounded: from 0 to the maximum cost for values in `domains`."""
    body = function.body if factor == 1 else Apply("mul", (Constant(factor), function.body))
    least, most = _bounds(constraint, body, function.parameters, domains)
    if least < 0:
        body = Apply("add", (body, Constant(-least)))
        most -= least
    low, high = bounds(body, defaultdict(lambda: ANY_INTEGER))
    if high > most:
        body = Apply("min", (body, Constant(most)))
    if low < 0:
        body = Apply("max", (body, Constant(0)))
    return replace(constraint, definition=replace(function, body=body, places=0), offset=min(0, least))


def _bounds(constraint: Constraint, body: Expression, parameters: tuple[str, ...], domains: Domains) -> tuple[int, int]:
    """Return the minimum and the maximum cost of a function, or bounds on them."""
    names = constraint.variables
    if len(names) > 1 and can_be_restated(constraint):  # the costs for fewer robots may differ
        low, high = bounds(body, defaultdict(lambda: ANY_INTEGER))
        return int(low), int(high)
    size = math.prod(len(domains[name].possible) if name in domains else MAX_TRIED + 1 for name in names)
    if size <= MAX_TRIED:
        tried = replace(constraint, definition=Function("", parameters, body))
        values = itertools.product(*(domains[name].possible for name in names))
        costs = [tried.price(dict(zip(names, one, strict=True))) for one in values]
        finite = [int(cost) for cost in costs if cost < INFINITE] or [0]
        return min(finite), max(finite)
    limits = {formal: _interval(term, domains) for formal, term in zip(parameters, constraint.parameters, strict=True)}
    low, high = bounds(body, limits)
    if math.isinf(low) or math.isinf(high):
        unknown = " and ".join(name for name in names if name not in domains)
        raise UnboundedCostError(
            f"the cost of {constraint.name} has no bounds, because the domain of {unknown} is unknown here; write"
            " bounds into the function: max(0, min(..., 100))"
        )
    return int(low), int(high)


def _interval(term: str | int, domains: Domains) -> Interval:
    if isinstance(term, int):
        return Interval(term, term)
    if term not in domains or not domains[term]:
        return ANY_INTEGER
    possible = domains[term].possible
    ranges = (possible,) if isinstance(possible, range) else possible.ranges
    return Interval(ranges[0][0], ranges[-1][-1])
