"""The checker: holds what a team claims against every constraint of every file.

It shares nothing with the protocols and with what they see of a problem (`solver/`): constraints are evaluated as
the files state them, tuple by tuple and term by term.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from robochoc.model.expression import UndefinedValueError, evaluate
from robochoc.model.problem import INFINITE, Assignment, Constraint, Relation, Robot, Semantics, Team, Variable

MAX_TRIES = 20_000
"""Values to be tried for the variables of a robot that stepped aside."""


class RefutedError(Exception):
    """What a protocol claims is refuted by the checker, or by a second opinion: a fault of the protocol, or ours."""


def violations(team: Team, assignment: Assignment, withdrawn: Collection[str] = ()) -> Iterator[str]:
    """Yield why `assignment` is no answer for the robots of `team` that have not withdrawn; nothing when it is one.

    Every variable of a flying robot has a value of its domain and every constraint among flying robots holds.
    """
    flying = {name: variable for name, variable in team.variables.items() if team.owner[name] not in withdrawn}
    for name, variable in flying.items():
        if name not in assignment:
            yield f"{name} has no value"
        elif assignment[name] not in variable.domain:
            yield f"{name} = {assignment[name]} is not in its domain"
    yield from (f"{name} is no variable of a robot that flies" for name in assignment if name not in flying)
    for constraint in team.constraints():
        if (
            all(name in assignment for name in constraint.variables)
            and constraint_cost(constraint, assignment) == INFINITE
        ):
            values = ", ".join(f"{name} = {assignment[name]}" for name in constraint.variables)
            yield f"constraint {constraint.name} is broken by {values}"


def assignment_cost(team: Team, assignment: Assignment) -> float:
    """Return what `assignment` pays in all, over the constraints whose variables it covers."""
    met = (c for c in team.constraints() if all(name in assignment for name in c.variables))
    return sum(constraint_cost(constraint, assignment) for constraint in met)


def needlessly_withdrawn(team: Team, assignment: Assignment, withdrawn: Collection[str]) -> Iterator[str]:
    """Yield robots that stepped aside although they had a place beside those that fly.

    A robot of many variables is given `MAX_TRIES` tries; who has found no place by then is believed.
    """
    constraints = list(team.constraints())
    for name in withdrawn:
        names = [variable.name for variable in team[name].variables]
        own = [c for c in constraints if {*assignment, *names}.issuperset(c.variables) and set(names) & {*c.variables}]
        if _has_a_place(team[name].variables, assignment, own, [MAX_TRIES]):
            yield name


def has_local_solution(robot: Robot) -> bool | None:
    """Return whether the private constraints of `robot` have a solution. None: `MAX_TRIES` tries were too few."""
    tries = [MAX_TRIES]
    if _has_a_place(robot.variables, {}, robot.private, tries):
        return True
    return False if tries[0] else None


def _has_a_place(
    open_still: Sequence[Variable], assignment: Assignment, own: Sequence[Constraint], tries: list[int]
) -> bool:
    """Return whether values for `open_still` can be added to `assignment` without breaking one of `own`."""
    if not open_still:
        return True
    first, *rest = open_still
    for value in first.domain:
        if not tries[0]:
            return False
        tries[0] -= 1
        place = {**assignment, first.name: value}
        met = (c for c in own if first.name in c.variables and all(name in place for name in c.variables))
        if all(constraint_cost(constraint, place) < INFINITE for constraint in met) and _has_a_place(
            rest, place, own, tries
        ):
            return True
    return False


def constraint_cost(constraint: Constraint, assignment: Assignment) -> float:
    """Return what `assignment` pays at `constraint`: 0 where it holds, `INFINITE` where it is broken and hard."""
    values = tuple(assignment[term] if isinstance(term, str) else term for term in constraint.parameters)
    definition = constraint.definition
    if isinstance(definition, Relation):
        return _price_in_extension(definition, values)
    try:
        holds = evaluate(definition.body, dict(zip(definition.parameters, values, strict=True)))
    except UndefinedValueError:
        holds = 0
    return 0 if holds else constraint.cost


def _price_in_extension(relation: Relation, values: tuple[int, ...]) -> float:
    listed = [place for place, row in enumerate(relation.tuples) if row == values]
    match relation.semantics:
        case Semantics.SUPPORTS:
            return 0 if listed else INFINITE
        case Semantics.CONFLICTS:
            return INFINITE if listed else 0
        case Semantics.SOFT:
            return relation.costs[listed[0]] if listed else relation.default_cost
