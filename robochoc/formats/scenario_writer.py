"""Write the files of a team with a scenario: `scenario.xml`, its robots, and the robots that join later."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from lxml import etree

from robochoc.formats.robot_writer import robot_xml
from robochoc.formats.scenario_reader import SCENARIO
from robochoc.model.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Constraint,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
)
from robochoc.model.uncertainty import is_uncertain, without_random


def team_files(team: Team) -> dict[str, bytes]:
    """Return the contents of the files of a valid team, by path: its robots, and its scenario if it has one.

    The definitions of constraints added by an event are in the file of the robot that gets the constraint.

    Raises:
        ValueError: if a robot cannot be written (`robot_xml`).
    """
    if not is_uncertain(team) or any(isinstance(c, AddConstraint) for event in team.scenario for c in event.changes):
        team = without_random(team)  # all files must declare the same random variables, or none
    files = {f"{robot.name}.xml": _File(robot) for robot in team.robots}
    present = {robot.name: files[f"{robot.name}.xml"] for robot in team.robots}
    texts = _ValueTexts(team)
    root = etree.Element("scenario")
    for event in team.scenario:
        after = "solved" if event.after is None else f"{event.after} messages"
        element = etree.SubElement(root, "event", after=after)
        for change in event.changes:
            if isinstance(change, AddAgent):
                path = _free_path(change.robot.name, files)
                present[change.robot.name] = files[path] = _File(change.robot)
                etree.SubElement(element, "add_agent", file=path)
            elif isinstance(change, AddConstraint):
                added = etree.SubElement(element, "add_constraint", agent=change.agent, parent=change.parent)
                present[change.agent].add(change.constraint, added)
            else:
                element.append(_element(change, texts))
    written = {path: file.content() for path, file in files.items()}
    if team.scenario:
        etree.indent(root)
        body = etree.tostring(root, pretty_print=True, encoding="unicode")
        written[SCENARIO] = f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()
    return written


class _File:
    """The file of a robot, including the definitions of constraints added by events."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._added: list[tuple[Constraint, etree._Element]] = []

    def add(self, constraint: Constraint, holder: etree._Element) -> None:
        """Add a constraint from an event. Its element belongs in `holder`."""
        self._added.append((constraint, holder))

    def content(self) -> bytes:
        """Return the contents of the file, after moving the elements of the added constraints to their events.

        The added constraints are first written as private ones, so that their definitions are written too.
        """
        if not self._added:
            return robot_xml(self._robot)
        added = tuple(constraint for constraint, _ in self._added)
        private = self._robot.private
        root = etree.fromstring(robot_xml(replace(self._robot, private=(*private, *added))))
        section = root.find("constraints")
        if section is None:
            raise ValueError(f"the constraints of {self._robot.name} were not written")
        for element, (_, holder) in zip(list(section)[len(private) :], self._added, strict=True):
            holder.append(element)
        if private:
            section.set("nbConstraints", str(len(private)))
        else:
            root.remove(section)
        etree.indent(root)
        body = etree.tostring(root, pretty_print=True, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()


class _ValueTexts:
    """The values of variables as text: integers, or names of symbols."""

    def __init__(self, team: Team) -> None:
        joining = [c.robot for event in team.scenario for c in event.changes if isinstance(c, AddAgent)]
        self._variables = {one.name: one for robot in (*team.robots, *joining) for one in robot.variables}

    def text(self, variable: str, value: int) -> str:
        """Return the text of a value of `variable`."""
        known = self._variables.get(variable)
        return str(known.domain.label(value) if known else value)


def _element(change: RemoveAgent | RemoveValue | AddValue | RemoveConstraint, texts: _ValueTexts) -> etree._Element:
    match change:
        case RemoveAgent(name):
            return etree.Element("remove_agent", name=name)
        case RemoveValue(variable, value):
            return etree.Element("remove_value", variable=variable, value=texts.text(variable, value))
        case AddValue(variable, value):
            return etree.Element("add_value", variable=variable, value=texts.text(variable, value))
        case RemoveConstraint(agent, parent, name):
            return etree.Element("remove_constraint", agent=agent, parent=parent, name=name)


def _free_path(name: str, taken: Mapping[str, object]) -> str:
    """Return an unused path for the file of a joining robot, which may join several times."""
    path, number = f"late/{name}.xml", 1
    while path in taken:
        number += 1
        path = f"late{number}/{name}.xml"
    return path
