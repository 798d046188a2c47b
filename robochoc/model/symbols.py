"""Symbols: values with names. Internally they are integer codes: indices in a table common to the whole team."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace

from robochoc.model.constraint import Constraint, Definition, Domain, Predicate, Relation, Variable
from robochoc.model.expression import Apply, Name
from robochoc.model.problem import AddAgent, Change, Robot, Team

EITHER = ("eq", "ne", "neq")
"""The names of predefined predicates that compare integers, or symbols."""


def symbol_table(robots: Iterable[Robot]) -> tuple[str, ...]:
    """Return the names of a team's symbols."""
    return next((robot.symbol_table for robot in robots if robot.symbol_table), ())


def symbolic_variables(team: Team) -> tuple[str, ...]:
    """Return the variables with symbols as values, in `team` and in robots that its scenario adds."""
    return tuple(dict.fromkeys(one.name for one in _all_variables(team) if one.domain.symbols))


def real_places(team: Team) -> dict[str, int]:
    """Return the decimal places of each variable with real numbers as values, in `team` and its scenario."""
    return {one.name: one.domain.real.places for one in _all_variables(team) if one.domain.real}


def on_grids(team: Team) -> Team:
    """Return `team` on its present grids: an ordinary problem, with numbers of steps instead of real numbers."""

    def counted(constraint: Constraint) -> Constraint:
        definition = constraint.definition
        if isinstance(definition, Relation) or definition.real is None:
            return constraint
        return replace(constraint, definition=replace(definition, real=None))

    def on_grid(robot: Robot) -> Robot:
        variables = tuple(replace(one, domain=replace(one.domain, real=None)) for one in robot.variables)
        return replace(robot.with_constraints(counted), variables=variables)

    return replace(team, robots=tuple(map(on_grid, team.robots)))


def _all_variables(team: Team) -> Iterator[Variable]:
    for robot in team.robots:
        yield from robot.variables
    for event in team.scenario:
        for change in event.changes:
            if isinstance(change, AddAgent):
                yield from change.robot.variables


def with_marked_symbols(constraints: Iterable[Constraint], symbolic: Collection[str]) -> list[Constraint]:
    """Return `constraints` with definitions in which the symbolic parameters or columns are marked.

    Args:
        constraints: The constraints.
        symbolic: The variables whose domains are symbolic.
    """
    known: dict[tuple[int, tuple[int, ...]], tuple[Definition, Definition]] = {}
    marked = []
    for constraint in constraints:
        places = tuple(place for place, term in enumerate(constraint.parameters) if term in symbolic)
        if places:
            definition = constraint.definition
            made = known.setdefault((id(definition), places), (definition, _marked(definition, places)))[1]
            constraint = replace(constraint, definition=made)  # noqa: PLW2901 - the same constraint
        marked.append(constraint)
    return marked


def with_table(robot: Robot, names: tuple[str, ...]) -> Robot:
    """Return `robot` with the symbol table `names` in its symbolic domains, or in `Robot.symbols` if it has none."""
    if not names:
        return robot
    domains: dict[int, Domain] = {}
    for variable in robot.variables:
        if variable.domain.symbols and id(variable.domain) not in domains:
            domains[id(variable.domain)] = replace(variable.domain, symbols=names)
    variables = tuple(replace(one, domain=domains.get(id(one.domain), one.domain)) for one in robot.variables)
    declared = robot.declared and with_table(robot.declared, names)
    return replace(robot, variables=variables, symbols=() if domains else names, declared=declared)


def with_table_everywhere(team: Team, names: tuple[str, ...]) -> Team:
    """Return `team` with the symbol table `names`, including in the robots that its scenario adds."""

    def converted(change: Change) -> Change:
        return AddAgent(with_table(change.robot, names)) if isinstance(change, AddAgent) else change

    if not names:
        return team
    events = tuple(replace(event, changes=tuple(map(converted, event.changes))) for event in team.scenario)
    return replace(team, robots=tuple(with_table(robot, names) for robot in team.robots), scenario=events)


def _marked(definition: Definition, places: tuple[int, ...]) -> Definition:
    if isinstance(definition, Relation):
        return replace(definition, symbolic=places) if definition.tuples else definition
    if _compares_any(definition):
        return definition
    return replace(definition, symbolic=tuple(definition.parameters[place] for place in places))


def _compares_any(definition: Definition) -> bool:
    """Return whether `definition` is a predefined predicate for integers or symbols."""
    match definition:
        case Predicate(name=name, parameters=(one, other), body=Apply("eq" | "ne", (Name(left), Name(right)))):
            return name in EITHER and (left, right) == (one, other)
        case _:
            return False
