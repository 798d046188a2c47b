"""Writes what changes over time: `scenario.xml`, the files of robots that join, and what robots' files say for it."""

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


def team_files(team: Team) -> dict[str, bytes]:
    """Return the files of a valid team, by their paths in its folder: robots, and its scenario if it has one.

    A constraint that an event adds refers to a definition in the file of the robot that gets it.

    Raises:
        ValueError: if a robot cannot be written (`robot_xml`).
    """
    files = {f"{robot.name}.xml": _File(robot) for robot in team.robots}
    present = {robot.name: files[f"{robot.name}.xml"] for robot in team.robots}
    labels = _Labels(team)
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
                element.append(_element(change, labels))
    written = {path: file.content() for path, file in files.items()}
    if team.scenario:
        etree.indent(root)
        body = etree.tostring(root, pretty_print=True, encoding="unicode")
        written[SCENARIO] = f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()
    return written


class _File:
    """A robot's file, and the constraints that events add to it."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._added: list[tuple[Constraint, etree._Element]] = []

    def add(self, constraint: Constraint, holder: etree._Element) -> None:
        """Note a constraint, whose element is to stand in `holder`."""
        self._added.append((constraint, holder))

    def content(self) -> bytes:
        """Return the file, and put the elements of the added constraints where they belong.

        The file is written as if the constraints were private ones; then their elements move, and the definitions stay.
        """
        if not self._added:
            return robot_xml(self._robot)
        extra = tuple(constraint for constraint, _ in self._added)
        private = self._robot.private
        whole = etree.fromstring(robot_xml(replace(self._robot, private=(*private, *extra))))
        section = whole.find("constraints")
        if section is None:  # what is written has them
            raise ValueError(f"the constraints of {self._robot.name} are not written")
        for element, (_, holder) in zip(list(section)[len(private) :], self._added, strict=True):
            holder.append(element)
        if private:
            section.set("nbConstraints", str(len(private)))
        else:
            whole.remove(section)
        etree.indent(whole)
        body = etree.tostring(whole, pretty_print=True, encoding="unicode")
        return f'<?xml version="1.0" encoding="UTF-8"?>\n{body}'.encode()


class _Labels:
    """Values as files write them."""

    def __init__(self, team: Team) -> None:
        joining = [c.robot for event in team.scenario for c in event.changes if isinstance(c, AddAgent)]
        self._variables = {one.name: one for robot in (*team.robots, *joining) for one in robot.variables}

    def of(self, variable: str, value: int) -> str:
        """Return a value of a variable: a symbol by its name."""
        known = self._variables.get(variable)
        return str(known.domain.label(value) if known else value)


def _element(change: RemoveAgent | RemoveValue | AddValue | RemoveConstraint, labels: _Labels) -> etree._Element:
    match change:
        case RemoveAgent(name):
            return etree.Element("remove_agent", name=name)
        case RemoveValue(variable, value):
            return etree.Element("remove_value", variable=variable, value=labels.of(variable, value))
        case AddValue(variable, value):
            return etree.Element("add_value", variable=variable, value=labels.of(variable, value))
        case RemoveConstraint(agent, parent, name):
            return etree.Element("remove_constraint", agent=agent, parent=parent, name=name)


def _free_path(name: str, taken: Mapping[str, object]) -> str:
    """Return a path for the file of a robot that joins; one may join again."""
    path, number = f"late/{name}.xml", 1
    while path in taken:
        number += 1
        path = f"late{number}/{name}.xml"
    return path
