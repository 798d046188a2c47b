"""Read `scenario.xml`: the changes of a team's problem over time (docs/reference/format.md, "Changes over time")."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from lxml import etree

from robochoc.formats.constraint_reader import ConstraintContext, read_shared
from robochoc.formats.costs import places_used
from robochoc.formats.definition_reader import read_integer
from robochoc.formats.diagnostics import Diagnostic, DiagnosticCollector, InvalidInputError, MistakeError, shortened
from robochoc.formats.random_variables import refuse_differing, refuse_uncertain
from robochoc.formats.real_numbers import read_steps
from robochoc.formats.robot_reader import RobotFile, read_robot_file
from robochoc.formats.robot_rules import (
    NO_ROBOTS_LEFT,
    check_added_constraint,
    check_constraint_of_added_robot,
)
from robochoc.formats.symbols import SymbolTable, check_argument_types, kinds_by_variable
from robochoc.formats.xml import attribute, line, read_xml
from robochoc.model.change import apply_changes
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    ScenarioEvent,
    Team,
)
from robochoc.model.team_edits import ChangeError
from robochoc.system.files import resolved

SCENARIO = "scenario.xml"
"""The only XML file in a team's folder that does not describe a robot."""


def has_scenario(folder: Path) -> bool:
    """Return whether `folder` has an entry of that name."""
    return os.path.lexists(folder / SCENARIO)


def read_scenario(
    folder: Path, team: Team | None, files: Mapping[str, RobotFile], table: SymbolTable
) -> tuple[ScenarioEvent, ...]:
    """Return the events of the scenario in `folder`. Each event must be possible for the team at that time.

    Args:
        folder: The team's folder. Files of added robots are in it or below.
        team: The team. None if the robots' files have errors: then only the scenario itself is checked.
        files: The robots' files.
        table: The symbols of the team. Those in the scenario are added to it.

    Raises:
        InvalidInputError: with all errors.
    """
    return _ScenarioReader(folder, team, files, table).events()


def places_of_scenario(folder: Path) -> int:
    """Return the largest number of decimal places in the costs of the scenario in `folder`, or of an added robot."""
    try:
        root = read_xml(folder / SCENARIO, "scenario")
    except InvalidInputError:
        return 0
    places = places_used(root)
    for element in root.iter("add_agent"):
        with suppress(InvalidInputError, MistakeError):
            path = _inside(folder, attribute(element, "file"))
            places = max(places, read_robot_file(path, SymbolTable()).robot.costs.places)
    return places


class _ScenarioReader:
    """Reads the events in order, and applies each event to the team.

    An impossible change is reported and skipped. Later uses of names that it would have added are not reported.
    """

    def __init__(self, folder: Path, team: Team | None, files: Mapping[str, RobotFile], table: SymbolTable) -> None:
        self._folder = folder
        self._table = table
        self._path = folder / SCENARIO
        self._team = team
        self._contexts: dict[str, ConstraintContext] = {name: file.context for name, file in files.items()}
        self._places = max((file.robot.costs.places for file in files.values()), default=0)
        self._report = DiagnosticCollector(str(self._path))
        self._robot_mistakes: list[Diagnostic] = []
        """Mistakes in the files of added robots."""
        self._has_unread_file = False
        """True if a file of an added robot could not be read. Its contents are then unknown."""
        self._not_added: set[str] = set()
        """Robots, variables and constraints that could not be added."""

    def events(self) -> tuple[ScenarioEvent, ...]:
        """Return all events. Raises `InvalidInputError`."""
        try:
            events = tuple([self._event(one) for one in read_xml(self._path, "scenario").iterchildren("event")])
            self._report.finish()
        except InvalidInputError as invalid:
            self._robot_mistakes += invalid.diagnostics
        if self._robot_mistakes:
            raise InvalidInputError(dict.fromkeys(self._robot_mistakes))
        return events

    def _event(self, element: etree._Element) -> ScenarioEvent:
        changes: list[Change] = []
        for child in element:
            with self._report.at(line(child)):
                for place, change in self._changes(child):
                    with self._report.at(place):
                        self._apply(change, place)
                        changes.append(change)
        if self._team and not self._team.robots:
            self._report.add(line(element), *NO_ROBOTS_LEFT)
            self._team = None
        after = attribute(element, "after")
        return ScenarioEvent(tuple(changes), None if after == "solved" else int(after.split()[0]))

    def _changes(self, element: etree._Element) -> Iterator[tuple[int, Change]]:
        """Yield the changes in `element`, with their line numbers."""
        if element.tag == "add_constraint":
            yield from self._added_constraints(element)
        elif element.tag == "add_agent":
            robot = self._read_added_robot(attribute(element, "file"))
            if robot:
                yield line(element), AddAgent(robot)
        else:
            yield line(element), self._change(element)

    def _change(self, element: etree._Element) -> Change:
        """Return the change in an element that does not refer to another file."""
        match element.tag:
            case "remove_agent":
                return RemoveAgent(attribute(element, "name"))
            case "remove_value":
                return RemoveValue(attribute(element, "variable"), self._value(element))
            case "add_value":
                return AddValue(attribute(element, "variable"), self._value(element))
            case _:
                return RemoveConstraint(*(attribute(element, name) for name in ("agent", "parent", "name")))

    def _value(self, element: etree._Element) -> int:
        """Return an integer, the code of a symbol, or the steps of a real number. Raises `MistakeError`."""
        variable, word = attribute(element, "variable"), attribute(element, "value")
        for context in self._contexts.values():
            refuse_uncertain([variable], context.random)
        if self._team is None:
            return 0  # the variable's domain is unknown
        known = self._team.variables.get(variable)
        if known and known.domain.symbols:
            return self._table.declare(word)
        if known and known.domain.real:
            return read_steps(word, known.domain.real)
        return read_integer(word)

    def _read_added_robot(self, name: str) -> Robot | None:
        """Return the robot in the file `name`, or None if the file has errors. The errors are added to the report."""
        if not _inside(self._folder, name).is_file():
            self._not_added.add(Path(name).stem)
            self._has_unread_file = True
            message = f"there is no file '{shortened(name)}' in the team's folder"
            raise MistakeError(message, "write late/NAME.xml, below the folder's own robots")
        robot_name = Path(name).stem
        is_present = self._team is not None and robot_name in self._team
        try:
            file = read_robot_file(self._folder / name, self._table).in_places(self._places)
            if not is_present:
                _refuse_parts(file.robot)
                refuse_differing(file.robot, [one for context in self._contexts.values() for one in context.random])
        except InvalidInputError as invalid:
            self._robot_mistakes += invalid.diagnostics
            self._has_unread_file = True
            if not is_present:
                self._contexts.pop(robot_name, None)
            return None
        if not is_present:
            self._contexts[robot_name] = file.context
        return file.robot

    def _added_constraints(self, element: etree._Element) -> Iterator[tuple[int, Change]]:
        agent, parent = attribute(element, "agent"), attribute(element, "parent")
        context = self._contexts.get(agent)
        if context is None:
            if self._team is None or self._has_unread_file:
                return
            raise MistakeError(f"there is no robot '{shortened(agent)}'", "name a robot of the team at that time")
        for child in element.iterchildren("constraint"):
            with self._report.at(line(child)):
                self._not_added.add(attribute(child, "name"))
                constraint = read_shared(child, context)
                if constraint:
                    refuse_uncertain(constraint.variables, context.random)
                    check_added_constraint(constraint)
                    self._not_added.discard(constraint.name)
                    yield line(child), AddConstraint(agent, parent, constraint)

    def _apply(self, change: Change, place: int) -> None:
        """Apply a change to the team. Raises `MistakeError` if it is impossible."""
        if self._team is not None and isinstance(change, AddConstraint):
            check_argument_types(change.constraint, kinds_by_variable(self._team.robots))
        while self._team is not None:
            try:
                self._team = apply_changes(self._team, [change])
            except ChangeError as bad:
                if isinstance(change, AddAgent) and bad.line:
                    self._report_in_robot_file(change.robot, bad, place)
                    change = AddAgent(_without_line(change.robot, bad.line))
                    continue
                self._not_added |= _added_names(change)
                if not self._is_consequence(bad):
                    raise MistakeError(bad.message, bad.hint) from None
            return

    def _report_in_robot_file(self, robot: Robot, bad: ChangeError, place: int) -> None:
        """Add an error in an added robot's file. The robot joins without the invalid part."""
        if not self._is_consequence(bad):
            message = f"{bad.message}, when {SCENARIO}:{place} adds this robot"
            self._robot_mistakes.append(Diagnostic(robot.file, bad.line, message, bad.hint))

    def _is_consequence(self, bad: ChangeError) -> bool:
        """Return whether `bad` may be a consequence of an error that was reported before."""
        return bool(bad.missing) and (self._has_unread_file or bad.missing in self._not_added)


def _inside(folder: Path, name: str) -> Path:
    """Return the path of the file `name` in `folder`, which need not exist. Raises `MistakeError`."""
    top = folder.resolve()
    try:
        path = resolved(top / name)
    except (OSError, ValueError):
        path = top
    if not path.is_relative_to(top):
        raise MistakeError(f"the file '{shortened(name)}' lies outside the team's folder", "move it inside")
    return path


def _refuse_parts(robot: Robot) -> None:
    """Raise `InvalidInputError` if an added robot has partially known constraints."""
    report = DiagnosticCollector(robot.file)
    for constraint in robot.shared:
        with report.at(constraint.line):
            check_constraint_of_added_robot(constraint)
    report.finish()


def _without_line(robot: Robot, number: int) -> Robot:
    """Return `robot` without the neighbours and constraints in line `number` of its file."""
    parents = (
        replace(parent, constraints=tuple(one for one in parent.constraints if one.line != number))
        for parent in robot.parents
        if parent.line != number
    )
    return replace(
        robot, parents=tuple(parents), children=tuple(child for child in robot.children if child.line != number)
    )


def _added_names(change: Change) -> set[str]:
    """Return the names of the robots, variables and constraints that `change` adds."""
    match change:
        case AddAgent(robot):
            return {robot.name, *(variable.name for variable in robot.variables)}
        case AddConstraint(constraint=constraint):
            return {constraint.name}
        case _:
            return set()
