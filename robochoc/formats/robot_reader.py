"""Read the file of one robot. `xml` has checked the file against its schema; this module checks its meaning.

docs/reference/format.md, "One robot"; the paper, Figure 2.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar, cast

from lxml import etree

from robochoc.formats.constraint_reader import ConstraintContext, read_private, read_shared
from robochoc.formats.costs import CostConversion, check_units, places_used, read_units
from robochoc.formats.definition_reader import (
    check_count,
    read_domain,
    read_function,
    read_predicate,
    read_relation,
    read_topic,
)
from robochoc.formats.definitions import check_semantics, refuse_function, refuse_predefined
from robochoc.formats.diagnostics import (
    MAX_PER_FILE,
    Diagnostic,
    DiagnosticCollector,
    InvalidInputError,
    MistakeError,
    invalid_input,
    shortened,
    suggestion,
)
from robochoc.formats.locations import FileLocations
from robochoc.formats.names import check_robot_name, check_unique
from robochoc.formats.objectives import check_objectives
from robochoc.formats.random_variables import check_random, read_random
from robochoc.formats.real_numbers import check_function_places, read_precision
from robochoc.formats.robot_rules import (
    NEIGHBOURS_ONCE,
    check_shown_variables,
    refuse_no_variables,
    repeated_neighbours,
)
from robochoc.formats.schema import SchemaError, schema_for, without_schema_errors
from robochoc.formats.symbols import INTEGER, SYMBOL, SymbolTable, kind_of
from robochoc.formats.team_members import TeamMember
from robochoc.formats.xml import attribute, line, parsed_xml, read_xml
from robochoc.model.problem import (
    Child,
    Constraint,
    ConstraintModel,
    CostUnits,
    Definition,
    Domain,
    Function,
    Parent,
    ProblemKind,
    RandomVariable,
    Robot,
    Semantics,
    Topic,
    Variable,
)
from robochoc.model.real import DEFAULT_PLACES
from robochoc.model.symbols import with_table
from robochoc.model.uncertainty import UncertaintyError, expected_robot
from robochoc.system.lazy_dataclass import dataclass

_Part = TypeVar("_Part", Domain, Definition)


@dataclass(frozen=True, kw_only=True)
class RobotFile(TeamMember):
    """A robot, and data in its file that only the checks of the team need."""

    context: ConstraintContext
    """The names to which constraints in a scenario can refer."""

    def with_table(self, names: tuple[str, ...]) -> RobotFile:
        """Return the file with `names` as the table of symbols."""
        return replace(self, robot=with_table(self.robot, names)) if names else self

    def in_places(self, places: int) -> RobotFile:
        """Return the file with costs in units of `places` decimal places, at least as many places as now.

        Raises:
            InvalidInputError: if a cost in the new unit has too many digits.
        """
        factor = 10 ** (places - self.robot.costs.places)
        if factor == 1:
            return self
        conversion = CostConversion(factor)
        try:
            robot = conversion.robot(self.robot)
            copies = {name: conversion.constraints(copied) for name, copied in self.copies.items()}
            definitions = conversion.definitions(self.context.definitions)
        except MistakeError as mistake:
            hint = f"another file of the team has costs with {places} decimal places, and a team has one unit of costs"
            raise InvalidInputError([self.places.robot().mistake(mistake.message, hint)]) from None
        context = replace(self.context, units=robot.costs, definitions=definitions)
        return replace(self, robot=robot, copies=copies, context=context)


def read_robot(path: Path | str) -> Robot:
    """Return the robot in the XML file `path`. The stem of the file name is the robot's name.

    The files of its neighbours are not checked: see `read_team`.

    Raises:
        InvalidInputError: with all errors in the file.
    """
    table = SymbolTable()
    return with_table(read_robot_file(Path(path), table).robot, table.names)


def read_robot_again(path: Path, symbols: tuple[str, ...], units: CostUnits) -> Robot:
    """Return the robot in the XML file `path`, which rejoins a team that was read before.

    Args:
        path: The file. It may have changed.
        symbols: The symbols of the team. Symbols in the file get the same codes.
        units: The units of the team's costs.

    Raises:
        InvalidInputError: with all errors in the file; or if it has symbols, decimal places or an objective that the
            team does not have.
    """
    table = SymbolTable(symbols)
    file = read_robot_file(path, table)
    costs = file.robot.costs
    if new := table.names[len(symbols) :]:
        raise invalid_input(path, f"the team has no symbol '{new[0]}'", "use the symbols of the team")
    if file.robot.kind == ProblemKind.DISWCSP and (costs.maximize, max(costs.places, units.places)) != (
        units.maximize,
        units.places,
    ):
        hint = "write the costs as in the team's files: the other robots do not read this file"
        raise invalid_input(path, "the objective differs from the team's, or costs have more decimal places", hint)
    return with_table(file.in_places(units.places).robot, symbols)


def read_robot_file(path: Path, table: SymbolTable) -> RobotFile:
    """Return the robot in the XML file `path`, with data for the checks of the team.

    Its symbols are added to the `table`, which grows while other files are read; then call `with_table`. Raises
    `InvalidInputError`.
    """
    _check_name(path.stem, path)
    try:
        return _RobotReader(path, read_xml(path, "instance"), table).robot_file()
    except SchemaError as refused:
        raise InvalidInputError([*refused.diagnostics, *_other_mistakes(path, refused)]) from None


def robot_in(content: bytes, name: str) -> Robot:
    """Return the robot called `name` from the `content` of its XML file. The limits are the same as for a file.

    Raises:
        InvalidInputError: with all errors. Messages use the file name `NAME.xml`.
    """
    path = Path(f"{name}.xml")
    _check_name(name, path)
    table = SymbolTable()
    return with_table(_RobotReader(path, parsed_xml(content, path, "instance"), table).robot_file().robot, table.names)


def _other_mistakes(path: Path, refused: SchemaError) -> list[Diagnostic]:
    """Return further errors in a file that its schema `refused`, in lines where the schema finds no error."""
    if len(refused.diagnostics) > MAX_PER_FILE:
        return []  # the file was not read to its end
    tree = without_schema_errors(refused.tree, schema_for("instance"))
    if tree is None:
        return []
    lines = {mistake.line for mistake in refused.diagnostics}
    try:
        _RobotReader(path, tree, SymbolTable()).robot_file()
    except InvalidInputError as invalid:
        return [mistake for mistake in invalid.diagnostics if mistake.line not in lines]
    return []


def _check_name(name: str, path: Path) -> None:
    """Raise `InvalidInputError` unless `name`, from the file at `path`, is a valid robot name."""
    try:
        check_robot_name(name, "rename the file")
    except MistakeError as mistake:
        raise invalid_input(path, mistake.message, mistake.hint) from None


class _RobotReader:
    """Reads an `instance` that its schema accepts, and collects all errors in one report."""

    def __init__(self, path: Path, instance: etree._Element, table: SymbolTable) -> None:
        self._table = table
        self._name = path.stem
        self._instance = instance
        self._report = DiagnosticCollector(str(path))
        self._own: dict[str, int] = {}
        self._places = DEFAULT_PLACES

    def robot_file(self) -> RobotFile:
        presentation = next(self._instance.iterchildren("presentation"))
        with self._report.at(line(presentation)):
            self._places = read_precision(presentation)
        kind = ProblemKind(attribute(presentation, "type"))
        variables = self._variables(self._domains())
        kinds = {one.name: kind_of(one.domain) for one in variables}
        topics = self._topics(kinds)
        model = ConstraintModel(attribute(presentation, "constraintModel") or ConstraintModel.TKC)
        units = self._units(presentation, kind)
        objectives = self._objectives(presentation, kind, units)
        definitions = self._definitions(kind, units)
        random = self._random_variables()
        kinds |= {one.name: INTEGER for one in random}
        context = ConstraintContext(kind, units, model, self._own, definitions, kinds, objectives, random)
        private = self._constraints(self._instance, context, read_private)
        copies: dict[str, tuple[Constraint, ...]] = {}
        implied: set[str] = set()
        parents = tuple(self._parents(context))
        children = tuple(self._children(context, copies, implied))
        self._check_neighbours(parents, children)
        self._report.finish()
        weight = int(attribute(presentation, "weight") or Robot.weight)
        file = self._report.file
        robot = Robot(
            self._name, variables, kind, private, parents, children, topics, file,
            weight=weight, costs=units, objectives=objectives, random=random,
        )  # fmt: skip
        lines = self._own | {one.name: one.line for one in random}
        places = FileLocations(file, line(presentation), lines)
        return self._expected(RobotFile(robot, places, copies, frozenset(implied), context=context))

    def _expected(self, file: RobotFile) -> RobotFile:
        """Return the deterministic equivalent of a file with random variables."""
        declared = file.robot
        if not declared.random:
            return file
        try:
            robot = expected_robot(declared)
            check_units(robot.costs, robot.kind)
            copies = {one.name: one.copies for one in robot.children if one.copies}
            conversion = CostConversion(10 ** (robot.costs.places - declared.costs.places))
            definitions = conversion.definitions(file.context.definitions)
        except UncertaintyError as error:
            line_number = error.line or file.places.robot().line
            raise InvalidInputError([Diagnostic(declared.file, line_number, error.message, error.hint)]) from None
        except MistakeError as mistake:
            raise InvalidInputError([file.places.robot().mistake(mistake.message, mistake.hint)]) from None
        context = replace(file.context, units=robot.costs, definitions=definitions)
        return replace(file, robot=robot, copies=copies, context=context)

    def _elements(self, section: str, tag: str, count: str) -> Iterator[etree._Element]:
        """Yield the elements in a section of the instance, and check their number."""
        for container in self._instance.iterchildren(section):
            with self._report.at(line(container)):
                check_count(container, count, len(container))
            yield from container.iterchildren(tag)

    def _domains(self) -> dict[str, Domain | None]:
        domains: dict[str, Domain | None] = {}
        for element in self._elements("domains", "domain", "nbDomains"):
            with self._report.at(line(element)):
                check_unique("domain", attribute(element, "name"), domains)
                domains[attribute(element, "name")] = None
                domains[attribute(element, "name")] = self._once(
                    element, lambda one: read_domain(one, self._table, self._places), self._places
                )
        return domains

    def _once(self, element: etree._Element, read: Callable[[etree._Element], _Part], units: object) -> _Part:
        """Return the result of `read`. Elements with equal texts, read in equal `units`, share one object."""
        text = etree.tostring(element, with_tail=False) if len(element) else element.text
        key = units, element.tag, *element.attrib.items(), text
        part = self._table.parts.get(key)
        if part is None:
            part = self._table.parts[key] = read(element)
        return cast("_Part", part)

    def _variables(self, domains: Mapping[str, Domain | None]) -> tuple[Variable, ...]:
        variables = []
        for element in self._elements("variables", "variable", "nbVariables"):
            name, domain = attribute(element, "name"), attribute(element, "domain")
            with self._report.at(line(element)):
                check_unique("variable", name, self._own)
                self._own[name] = line(element)
                if domain not in domains:
                    raise MistakeError(f"unknown domain '{shortened(domain)}'", suggestion(domain, domains, "domains"))
                values = domains[domain]
                if values is not None:
                    variables.append(Variable(name, values))
        if not self._own:
            with self._report.at(line(next(self._instance.iterchildren("variables")))):
                refuse_no_variables(self._own)
            self._report.finish()  # further errors may be consequences of this one
        return tuple(variables)

    def _random_variables(self) -> tuple[RandomVariable, ...]:
        found: dict[str, RandomVariable] = {}
        elements = list(self._elements("random_variables", "random", "nbRandom"))
        for element in elements:
            with self._report.at(line(element)):
                one = read_random(element)
                check_random(one, self._own, found)
                found[one.name] = one
        if len(found) < len(elements):
            self._report.finish()  # further errors may be consequences of this one
        return tuple(found.values())

    def _topics(self, kinds: Mapping[str, str]) -> tuple[Topic, ...]:
        symbolic = [name for name, kind in kinds.items() if kind == SYMBOL]
        reals = [name for name, kind in kinds.items() if kind not in {INTEGER, SYMBOL}], self._places
        topics: dict[str, Topic] = {}
        for element in self._elements("topics", "topic", "nbTopics"):
            with self._report.at(line(element)):
                topic = read_topic(element, self._own, symbolic, self._code_at(line(element)), reals)
                check_unique("topic", topic.name, topics)
                topics[topic.name] = topic
        return tuple(topics.values())

    def _units(self, presentation: etree._Element, kind: ProblemKind) -> CostUnits:
        places = places_used(self._instance)
        units = [CostUnits(attribute(presentation, "objective") == "maximize", places)]  # used if they are invalid
        with self._report.at(line(presentation)):
            units.append(read_units(presentation, kind, places))
        return units[-1]

    def _objectives(self, presentation: etree._Element, kind: ProblemKind, units: CostUnits) -> tuple[str, ...]:
        objectives = tuple(attribute(presentation, "objectives").split())
        with self._report.at(line(presentation)):
            check_objectives(objectives, kind, units)
        return objectives

    def _definitions(self, kind: ProblemKind, units: CostUnits) -> dict[str, Definition | None]:
        definitions: dict[str, Definition | None] = {}
        for element in self._elements("relations", "relation", "nbRelations"):
            self._define(element, lambda one, code: read_relation(one, units, code), definitions, units)
            with self._report.at(line(element)):
                check_semantics(Semantics(attribute(element, "semantics")), kind)
        for element in self._elements("predicates", "predicate", "nbPredicates"):
            self._define(element, lambda one, code: read_predicate(one, code, self._places), definitions, self._places)
        for element in self._elements("functions", "function", "nbFunctions"):
            self._define(element, lambda one, code: read_function(one, code, self._places), definitions, self._places)
            with self._report.at(line(element)):
                refuse_function(kind)
                function = definitions.get(attribute(element, "name"))
                if isinstance(function, Function):
                    check_function_places(function, units)
        return definitions

    def _define(
        self,
        element: etree._Element,
        read: Callable[[etree._Element, Callable[[str], int]], Definition],
        definitions: dict[str, Definition | None],
        units: CostUnits | int,
    ) -> None:
        name = attribute(element, "name")
        with self._report.at(line(element)):
            check_unique("definition", name, definitions)
            definitions[name] = None
            refuse_predefined(name)
            code = self._code_at(line(element))
            definitions[name] = self._once(element, lambda one: read(one, code), units)

    def _code_at(self, line_number: int) -> Callable[[str], int]:
        """Return a function for the codes of symbols that occur in a line."""
        return lambda word: self._table.mention(word, self._report.file, line_number)

    def _constraints(
        self,
        holder: etree._Element,
        context: ConstraintContext,
        read: Callable[[etree._Element, ConstraintContext], Constraint | None],
    ) -> tuple[Constraint, ...]:
        constraints = []
        for container in holder.iterchildren("constraints"):
            with self._report.at(line(container)):
                check_count(container, "nbConstraints", len(container))
            for element in container:
                with self._report.at(line(element)):
                    constraint = read(element, context)
                    if constraint:
                        constraints.append(constraint)
        return tuple(constraints)

    def _agents(self, side: str) -> Iterator[etree._Element]:
        for neighbours in self._instance.iterchildren("agents_neighbours"):
            for container in neighbours.iterchildren(side):
                yield from container.iterchildren("agent")

    def _parents(self, context: ConstraintContext) -> Iterator[Parent]:
        for agent in self._agents("agents_parent"):
            yield Parent(attribute(agent, "name"), self._constraints(agent, context, read_shared), line(agent))

    def _children(
        self, context: ConstraintContext, copies: dict[str, tuple[Constraint, ...]], implied: set[str]
    ) -> Iterator[Child]:
        """Yield the children with this robot's parts of PKCs.

        Copies of TKCs are added to `copies`, and children without the attribute `variable` to `implied`.
        """
        for agent in self._agents("agents_children"):
            name = attribute(agent, "name")
            listed = self._constraints(agent, context, read_shared)
            parts = tuple(constraint for constraint in listed if constraint.model == ConstraintModel.PKC)
            copied = tuple(constraint for constraint in listed if constraint.model == ConstraintModel.TKC)
            if copied:
                copies[name] = copied
            scopes = itertools.chain.from_iterable(constraint.variables for constraint in listed)
            shown = tuple(dict.fromkeys(variable for variable in scopes if variable in self._own))
            given = agent.get("variable")
            if given is None:
                implied.add(name)
            else:
                shown = tuple(given.split())
                with self._report.at(line(agent)):
                    check_shown_variables(shown, self._own)
            yield Child(name, shown, parts, line(agent), copied)

    def _check_neighbours(self, parents: tuple[Parent, ...], children: tuple[Child, ...]) -> None:
        for neighbour, message in repeated_neighbours(self._name, parents, children):
            self._report.add(neighbour.line, message, NEIGHBOURS_ONCE)
