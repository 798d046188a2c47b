"""The checker: checks a team's answer against every constraint in every file.

It shares no code with the protocols and the solver: constraints are evaluated in their original form, tuple by tuple
and term by term.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from decimal import Decimal
from typing import TYPE_CHECKING, assert_never

from robochoc.model.absence import restated
from robochoc.model.cost_units import Cost, cost_shown
from robochoc.model.expression import UndefinedValueError, evaluate
from robochoc.model.outcome import MOST_VIOLATIONS, ViolatedConstraint, Violations
from robochoc.model.problem import (
    INFINITE,
    Assignment,
    Constraint,
    Function,
    Predicate,
    Relation,
    Robot,
    Semantics,
    Team,
    Variable,
)
from robochoc.model.team_edits import constraints_in_force
from robochoc.system.errors import RobochocError

if TYPE_CHECKING:
    from fractions import Fraction

MAX_TRIES = 20_000
"""The maximum number of values that are tried for the variables of a withdrawn robot."""


class RefutedError(RobochocError):
    """The checker or the central solver refutes an answer: there is an error in the protocol or in this program."""


def violations(team: Team, assignment: Assignment, withdrawn: Collection[str] = ()) -> Iterator[str]:
    """Yield the reasons why `assignment` is not a solution for the robots of `team` that are not withdrawn.

    Every variable of a flying robot must have a value from its domain, and every constraint in force must hold.
    """
    flying = {name: variable for name, variable in team.variables.items() if team.owner[name] not in withdrawn}
    for name, variable in flying.items():
        if name not in assignment:
            yield f"{name} has no value"
        elif assignment[name] not in variable.domain.possible:
            yield f"{name} = {assignment[name]} is not in its domain"
    yield from (f"{name} is not a variable of a robot that flies" for name in assignment if name not in flying)
    for constraint in constraints_in_force(team, withdrawn):
        if (
            all(name in assignment for name in constraint.variables)
            and constraint_cost(constraint, assignment) == INFINITE
        ):
            values = ", ".join(f"{name} = {assignment[name]}" for name in constraint.variables)
            yield f"constraint {constraint.name} is broken by {values or 'the absence of a robot'}"


def violated_constraints(team: Team, assignment: Assignment) -> Violations:
    """Return the hard constraints of `team` that `assignment`, with values for all variables, violates."""
    number = hard = 0
    first: list[ViolatedConstraint] = []
    for robot in team.robots:
        for constraint in robot.constraints():
            if constraint_cost(constraint, assignment) == INFINITE:
                number += 1
                if len(first) < MOST_VIOLATIONS:
                    first.append(ViolatedConstraint(constraint.name, robot.name, constraint.variables))
            elif not constraint.is_hard:
                continue
            hard += 1
    return Violations(number, hard, tuple(first))


def assignment_cost(team: Team, assignment: Assignment) -> float:
    """Return the cost of `assignment` in all constraints in force; robots without values count as absent."""
    in_force = constraints_in_force(team, robots_without_values(team, assignment))
    return sum(constraint_cost(constraint, assignment) for constraint in in_force)


def robots_without_values(team: Team, assignment: Assignment) -> tuple[str, ...]:
    """Return the robots without values, which count as withdrawn."""
    return tuple(robot.name for robot in team.robots if robot.variables[0].name not in assignment)


def check_user_cost(team: Team, assignment: Assignment, cost: Cost | None, without: Collection[str] = ()) -> None:
    """Check a cost in the user's units against every constraint in every file in its original form.

    Args:
        team: The team as in its files, without normalised costs.
        assignment: The values of all robots that have not withdrawn.
        cost: The claimed cost; None if there is no assignment.
        without: The robots that have withdrawn.

    Raises:
        RefutedError: if the cost is wrong.
    """
    if cost is None:
        return
    places = max(robot.costs.places for robot in team.robots)
    from fractions import Fraction  # noqa: PLC0415 - start-up: many problems have no costs

    total = sum(_totals(team, assignment, without).values())
    if Fraction(cost) != total:
        exact = Decimal(int(total * 10**places)).scaleb(-places)
        raise RefutedError(
            f"the answer for {team.name} costs {cost_shown(exact)}, but the protocol claims {cost_shown(cost)}"
        )


def objective_costs(team: Team, assignment: Assignment, without: Collection[str] = ()) -> dict[str, Cost]:
    """Return the cost of `assignment` in each objective of `team`, in the user's units. See `check_user_cost`."""
    functions = (one.definition.places for one in team.constraints() if isinstance(one.definition, Function))
    places = max([*(robot.costs.places for robot in team.robots), *functions])
    totals = _totals(team, assignment, without)
    return {
        name: Decimal(int(totals[name] * 10**places)).scaleb(-places) if places else int(totals[name])
        for name in team.objectives
    }


def _totals(team: Team, assignment: Assignment, without: Collection[str]) -> dict[str, Fraction]:
    """Return the sum of costs for each objective, and for "" the constants and the costs without an objective."""
    from fractions import Fraction  # noqa: PLC0415 - start-up: many problems have no costs

    totals = dict.fromkeys(("", *team.objectives), Fraction(0))
    absent = {name for name in team.variables if team.owner[name] in without}
    for robot in team.robots:
        unit = Fraction(1, 10**robot.costs.places)
        totals[""] += robot.costs.constant * unit
        for constraint in robot.constraints():
            in_force = restated(constraint, absent)
            if in_force is not None:
                paid = int(constraint_cost(in_force, assignment))
                definition = constraint.definition
                own = Fraction(1, 10**definition.places) if isinstance(definition, Function) else unit
                totals[constraint.objective] += paid * own
    return totals


def needlessly_withdrawn(team: Team, assignment: Assignment, withdrawn: Collection[str]) -> Iterator[str]:
    """Yield withdrawn robots that could have values without breaking constraints.

    At most `MAX_TRIES` values are tried for each robot.
    """
    on: dict[str, list[Constraint]] = {name: [] for name in team.variables}
    for constraint in team.constraints():
        for variable in constraint.variables:
            on[variable].append(constraint)
    absent = {name for name in team.variables if team.owner[name] in withdrawn}
    for name in withdrawn:
        names = {variable.name for variable in team[name].variables}
        met = [restated(constraint, absent - names) for variable in names for constraint in on[variable]]
        in_force = [constraint for constraint in met if constraint is not None]
        others = (constraint for constraint in in_force if names.isdisjoint(constraint.variables))
        if all(constraint_cost(one, assignment) < INFINITE for one in others) and _can_be_placed(
            team[name].variables, assignment, in_force, [MAX_TRIES]
        ):
            yield name


def has_local_solution(robot: Robot) -> bool | None:
    """Return whether the private constraints of `robot` have a solution; None if `MAX_TRIES` tries do not suffice."""
    tries = [MAX_TRIES]
    if _can_be_placed(robot.variables, {}, robot.private, tries):
        return True
    return False if tries[0] else None


def _can_be_placed(
    open_still: Sequence[Variable], assignment: Assignment, own: Sequence[Constraint], tries: list[int]
) -> bool:
    """Return whether values for `open_still` can be added to `assignment` without breaking a constraint in `own`."""
    if not open_still:
        return True
    first, *rest = open_still
    for value in first.domain:
        if not tries[0]:
            return False
        tries[0] -= 1
        place = {**assignment, first.name: value}
        met = (c for c in own if first.name in c.variables and all(name in place for name in c.variables))
        if all(constraint_cost(constraint, place) < INFINITE for constraint in met) and _can_be_placed(
            rest, place, own, tries
        ):
            return True
    return False


def constraint_cost(constraint: Constraint, assignment: Assignment) -> float:
    """Return the cost of `constraint` for `assignment`: 0 if it holds, `INFINITE` if it is hard and violated."""
    values = tuple(assignment[term] if isinstance(term, str) else term for term in constraint.parameters)
    definition = constraint.definition
    if isinstance(definition, Relation):
        return _price_in_extension(definition, values)
    try:
        value = evaluate(definition.body, dict(zip(definition.parameters, values, strict=True)))
    except UndefinedValueError:
        return constraint.cost if isinstance(definition, Predicate) else INFINITE
    if isinstance(definition, Predicate):
        return 0 if value else constraint.cost
    return value


def _price_in_extension(relation: Relation, values: tuple[int, ...]) -> float:
    listed = [place for place, row in enumerate(relation.tuples) if row == values]
    match relation.semantics:
        case Semantics.SUPPORTS:
            return 0 if listed else INFINITE
        case Semantics.CONFLICTS:
            return INFINITE if listed else 0
        case Semantics.SOFT:
            return relation.costs[listed[0]] if listed else relation.default_cost
        case never:
            assert_never(never)
