"""Distinct names for a robot's domains and definitions: objects in Python, names in a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import count
from typing import TypeVar

from robochoc.formats.definitions import PREDEFINED
from robochoc.model.problem import Constraint, Definition, Domain, GlobalPredicate, Robot


def with_names_apart(robot: Robot) -> Robot:
    """Return `robot`, in which different domains have different names, and different definitions, too.

    The first keeps its name, the others of that name are called NAME.2, NAME.3, ...
    """
    domains = _names(variable.domain for variable in robot.variables)
    definitions = _names(
        (one.definition for one in _constraints(robot) if not isinstance(one.definition, GlobalPredicate)), PREDEFINED
    )
    if domains is None and definitions is None:
        return robot
    return _renamed(robot, domains or {}, definitions or {})


def _constraints(robot: Robot) -> Iterable[Constraint]:
    yield from robot.private
    yield from robot.shared
    for child in robot.children:
        yield from child.constraints


_Named = TypeVar("_Named", Domain, Definition)


def _names(things: Iterable[_Named], predefined: Mapping[str, _Named] = {}) -> dict[_Named, str] | None:
    """Return distinct names for the `things` whose own names are ambiguous. None where all own names are distinct."""
    first: dict[str, _Named] = dict(predefined)
    names: dict[_Named, str] = {}
    for thing in things:
        present = first.setdefault(thing.name, thing)
        if present is not thing and present != thing:
            names.setdefault(thing, "")
    taken = {*first}
    for thing in list(names):
        name = next(name for number in count(2) if (name := f"{thing.name}.{number}") not in taken)
        names[thing] = name
        taken.add(name)
    return names or None


def _renamed(robot: Robot, domains: Mapping[Domain, str], definitions: Mapping[Definition, str]) -> Robot:
    def renamed(constraints: Iterable[Constraint]) -> tuple[Constraint, ...]:
        return tuple(
            replace(one, definition=replace(one.definition, name=definitions[one.definition]))
            if one.definition in definitions
            else one
            for one in constraints
        )

    return replace(
        robot,
        variables=tuple(
            replace(one, domain=replace(one.domain, name=domains[one.domain])) if one.domain in domains else one
            for one in robot.variables
        ),
        private=renamed(robot.private),
        parents=tuple(replace(one, constraints=renamed(one.constraints)) for one in robot.parents),
        children=tuple(replace(one, constraints=renamed(one.constraints)) for one in robot.children),
    )
