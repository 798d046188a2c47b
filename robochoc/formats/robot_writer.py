"""Write a robot's XML file in the form of the paper's Figure 2: order of elements, counts, two spaces per level."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import TypeVar

from lxml import etree

from robochoc.formats.costs import cost_text, scale_text
from robochoc.formats.definitions import PREDEFINED
from robochoc.formats.global_constraints import write_global
from robochoc.formats.random_variables import write_random
from robochoc.formats.real_numbers import real_domain_text, source_of
from robochoc.model.expression import text
from robochoc.model.problem import (
    INFINITE,
    Constraint,
    CostUnits,
    Definition,
    Domain,
    Function,
    GlobalPredicate,
    Predicate,
    Relation,
    Robot,
    Semantics,
    Term,
    Topic,
)
from robochoc.model.real import DEFAULT_PLACES
from robochoc.model.uncertainty import as_declared

_Named = TypeVar("_Named", Domain, Definition)
_TABLE = "symbols"
"""The name of the domain that lists all symbols of the team."""


def robot_xml(robot: Robot) -> bytes:
    """Return `robot` as the content of its XML file, for `read_robot`.

    If two different domains or definitions have the same name, one of them is renamed.

    Raises:
        ValueError: if a cost is not an integer, or a name contains characters that XML does not allow.
    """
    robot = with_distinct_names(as_declared(robot))
    instance = etree.Element("instance")
    presentation = etree.SubElement(instance, "presentation", type=robot.kind)
    if robot.weight != Robot.weight:
        presentation.set("weight", str(robot.weight))
    _write_units(presentation, robot.costs)
    if robot.objectives:
        presentation.set("objectives", " ".join(robot.objectives))
    _write_precision(presentation, robot)
    _write_domains(instance, robot)
    variables = etree.SubElement(instance, "variables", nbVariables=str(len(robot.variables)))
    for variable in robot.variables:
        etree.SubElement(variables, "variable", name=variable.name, domain=variable.domain.name)
    write_random(instance, robot)
    _write_topics(instance, robot)
    _write_definitions(instance, robot)
    _write_constraints(instance, robot.private, robot.costs)
    _write_neighbours(instance, robot)
    body = etree.tostring(instance, pretty_print=True, encoding="unicode")
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()


def _write_units(presentation: etree._Element, units: CostUnits) -> None:
    if units.maximize:
        presentation.set("objective", "maximize")
    if units.places:
        presentation.set("scale", scale_text(units.places))
    if units.constant:
        presentation.set("constant", cost_text(units.constant, units))


def _write_precision(presentation: etree._Element, robot: Robot) -> None:
    """Write the precision of real numbers, if the robot or its constraints have any. It is the same for all."""
    found = [variable.domain.real.places for variable in robot.variables if variable.domain.real]
    for constraint in robot.constraints():
        definition = constraint.definition
        if not isinstance(definition, Relation) and definition.real:
            found.append(definition.real.places)
    if found and found[0] != DEFAULT_PLACES:
        presentation.set("precision", scale_text(found[0]))


def _write_domains(instance: etree._Element, robot: Robot) -> None:
    domains = _by_name(variable.domain for variable in robot.variables)
    table = robot.symbol_table
    section = etree.SubElement(instance, "domains", nbDomains=str(len(domains) + bool(table)))
    if table:  # not the domain of a variable: it lists all symbols, so that they have the same codes in every file
        name = next(
            name for number in itertools.count(1) if (name := _TABLE + f".{number}" * (number > 1)) not in domains
        )
        etree.SubElement(section, "domain", name=name, type="symbolic").text = " ".join(table)
    for domain in domains.values():
        element = etree.SubElement(section, "domain", name=domain.name, nbValues=str(len(domain)))
        if domain.symbols:
            element.set("type", "symbolic")
            element.text = " ".join(str(domain.label(value)) for value in domain)
        elif domain.real:
            element.set("type", "real")
            element.text = real_domain_text(domain, domain.real)
        else:
            element.text = " ".join(map(_range, domain.ranges))


def _range(part: range) -> str:
    return f"{part[0]}..{part[-1]}" if len(part) > 1 else str(part[0])


def _write_topics(instance: etree._Element, robot: Robot) -> None:
    if not robot.topics:
        return
    symbolic = [variable.name for variable in robot.variables if variable.domain.symbols]
    section = etree.SubElement(instance, "topics", nbTopics=str(len(robot.topics)))
    for topic in robot.topics:
        element = etree.SubElement(section, "topic", name=topic.name)
        if topic.type != Topic.type:
            element.set("type", topic.type)
        for axis, expression in zip("xyz", topic.sources or (topic.x, topic.y, topic.z), strict=True):
            if expression is not None:
                element.set(axis, text(expression, symbolic, robot.symbol_table))


def _write_definitions(instance: etree._Element, robot: Robot) -> None:
    parts = itertools.chain.from_iterable(child.constraints for child in robot.children)
    constraints = itertools.chain(robot.private, robot.shared, parts)
    definitions = _by_name(one.definition for one in constraints if not isinstance(one.definition, GlobalPredicate))
    relations = [one for one in definitions.values() if isinstance(one, Relation)]
    predicates = [one for one in definitions.values() if isinstance(one, Predicate) and one != PREDEFINED.get(one.name)]
    table = robot.symbol_table
    functions = [one for one in definitions.values() if isinstance(one, Function)]
    if relations:
        section = etree.SubElement(instance, "relations", nbRelations=str(len(relations)))
        for relation in relations:
            _write_relation(section, relation, robot)
    if predicates:
        section = etree.SubElement(instance, "predicates", nbPredicates=str(len(predicates)))
        for predicate in predicates:
            _write_expression(etree.SubElement(section, "predicate", name=predicate.name), predicate, table)
    if functions:
        section = etree.SubElement(instance, "functions", nbFunctions=str(len(functions)))
        for function in functions:
            element = etree.SubElement(section, "function", name=function.name)
            element.set("return", "int")
            if function.places:
                element.set("scale", scale_text(function.places))
            _write_expression(element, function, table)


def _write_relation(section: etree._Element, relation: Relation, robot: Robot) -> None:
    units, table = robot.costs, robot.symbol_table
    element = etree.SubElement(section, "relation", name=relation.name, arity=str(relation.arity))
    element.set("nbTuples", str(len(relation.tuples)))
    element.set("semantics", relation.semantics)
    tuples = [
        " ".join(table[value] if place in relation.symbolic else str(value) for place, value in enumerate(values))
        if relation.symbolic
        else " ".join(map(str, values))
        for values in relation.tuples
    ]
    if relation.semantics == Semantics.SOFT:
        element.set("defaultCost", cost_text(relation.default_cost, units))
        tuples = [f"{cost_text(cost, units)}:{values}" for cost, values in zip(relation.costs, tuples, strict=True)]
    element.text = "|".join(tuples)


def _write_expression(element: etree._Element, definition: Predicate | Function, table: Sequence[str]) -> None:
    """Write the parameters and the body; over real numbers, the expression from which the body was made, if known."""
    kinds = dict.fromkeys(definition.parameters, "int") | dict.fromkeys(definition.symbolic, "symbol")
    body = definition.body
    if definition.real:
        source = source_of(definition, definition.real)
        kinds |= dict.fromkeys(definition.real.names, "steps" if source is None else "real")
        body = source or body
    etree.SubElement(element, "parameters").text = " ".join(f"{kind} {name}" for name, kind in kinds.items())
    expression = etree.SubElement(element, "expression")
    etree.SubElement(expression, "functional").text = text(body, definition.symbolic, table)


def _write_constraints(holder: etree._Element, constraints: Sequence[Constraint], units: CostUnits) -> None:
    if not constraints:
        return
    section = etree.SubElement(holder, "constraints", nbConstraints=str(len(constraints)))
    for constraint in constraints:
        element = etree.SubElement(section, "constraint")
        if constraint.model:
            element.set("model", constraint.model)
        element.set("name", constraint.name)
        element.set("reference", constraint.definition.name)
        element.set("scope", _terms(constraint.scope))
        if constraint.cost != INFINITE:
            element.set("cost", cost_text(constraint.cost, units))
        if constraint.when_absent:
            element.set("when_absent", constraint.when_absent)
        if constraint.objective:
            element.set("objective", constraint.objective)
        if isinstance(constraint.definition, GlobalPredicate):
            parameters = etree.SubElement(element, "parameters")
            write_global(parameters, constraint.definition, constraint.parameters)
        elif not isinstance(constraint.definition, Relation):
            etree.SubElement(element, "parameters").text = _terms(constraint.parameters)


def _write_neighbours(instance: etree._Element, robot: Robot) -> None:
    neighbours = etree.SubElement(instance, "agents_neighbours")
    section = etree.SubElement(neighbours, "agents_parent")
    for parent in robot.parents:
        _write_constraints(etree.SubElement(section, "agent", name=parent.name), parent.constraints, robot.costs)
    section = etree.SubElement(neighbours, "agents_children")
    for child in robot.children:
        agent = etree.SubElement(section, "agent", name=child.name)
        agent.set("variable", " ".join(child.variables))
        _write_constraints(agent, child.constraints, robot.costs)


def _by_name(things: Iterable[_Named]) -> Mapping[str, _Named]:
    return {thing.name: thing for thing in things}


def _terms(terms: Sequence[Term]) -> str:
    return " ".join(map(str, terms))


# Distinct names


def with_distinct_names(robot: Robot) -> Robot:
    """Return `robot` with different names for different domains, and for different definitions.

    The first object keeps its name; others with the same name are renamed to NAME.2, NAME.3, ...
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


def _names(things: Iterable[_Named], predefined: Mapping[str, _Named] = {}) -> dict[_Named, str] | None:
    """Return new names for those `things` whose names are ambiguous, or None if all names are distinct."""
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
