"""`scenario.xml`: how a team's problem changes over time (FORMAT.md, "Changes over time")."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path

from lxml import etree

from robochoc.change import BadChange, changed
from robochoc.formats.constraints import Context, read_shared
from robochoc.formats.diagnostics import MistakeError, Report, shortened
from robochoc.formats.robot import RobotFile, read_robot_file
from robochoc.formats.xml import attribute, line, read_xml
from robochoc.problem import (
    AddAgent,
    AddConstraint,
    AddValue,
    Change,
    Event,
    Model,
    RemoveAgent,
    RemoveConstraint,
    RemoveValue,
    Robot,
    Team,
)

SCENARIO = "scenario.xml"
"""The one XML file in a team's folder that is no robot."""


def has_scenario(folder: Path) -> bool:
    """Whether there is anything of that name in `folder`."""
    return os.path.lexists(folder / SCENARIO)


def read_scenario(folder: Path, team: Team | None, files: Mapping[str, RobotFile]) -> tuple[Event, ...]:
    """The events of the scenario in `folder`, each of which the team as it stands then can take.

    `team` is None when the robots' `files` have mistakes: then only the scenario's own mistakes are looked for. Files
    of added robots lie in the folder or below. Raises `InvalidInput`.
    """
    return _Reader(folder, team, files).events()


class _Reader:
    """Walks through the events, and changes the team on the way."""

    def __init__(self, folder: Path, team: Team | None, files: Mapping[str, RobotFile]) -> None:
        self._folder = folder
        self._inside = folder.resolve()
        self._path = folder / SCENARIO
        self._team = team
        self._contexts: dict[str, Context] = {name: file.context for name, file in files.items()}
        self._report = Report(str(self._path))

    def events(self) -> tuple[Event, ...]:
        events = []
        for element in read_xml(self._path, "scenario").iterchildren("event"):
            changes: list[Change] = []
            for child in element:
                with self._report.at(line(child)):
                    for change in self._changes(child):
                        self._apply(change)
                        changes.append(change)
            after = attribute(element, "after")
            events.append(Event(tuple(changes), None if after == "solved" else int(after.split()[0])))
        self._report.finish()
        return tuple(events)

    def _changes(self, element: etree._Element) -> Iterator[Change]:
        match element.tag:
            case "remove_agent":
                yield RemoveAgent(attribute(element, "name"))
            case "add_agent":
                yield AddAgent(self._added(attribute(element, "file")))
            case "remove_value":
                yield RemoveValue(attribute(element, "variable"), int(attribute(element, "value")))
            case "add_value":
                yield AddValue(attribute(element, "variable"), int(attribute(element, "value")))
            case "remove_constraint":
                names = (attribute(element, name) for name in ("agent", "parent", "name"))
                yield RemoveConstraint(*names)
            case _:
                yield from self._added_constraints(element)

    def _added(self, name: str) -> Robot:
        """The robot in the file `name`; mistakes in there are told with that file's lines."""
        try:
            path = (self._inside / name).resolve()
            there = path.is_file()
        except (OSError, ValueError):
            path, there = self._inside, False
        if not path.is_relative_to(self._inside):
            raise MistakeError(f"the file '{shortened(name)}' lies outside the team's folder", "move it inside")
        if not there:
            message = f"there is no file '{shortened(name)}' in the team's folder"
            raise MistakeError(message, "write late/NAME.xml, below the folder's own robots")
        file = read_robot_file(self._folder / name)
        self._contexts[file.robot.name] = file.context
        return file.robot

    def _added_constraints(self, element: etree._Element) -> Iterator[Change]:
        agent, parent = attribute(element, "agent"), attribute(element, "parent")
        context = self._contexts.get(agent)
        if context is None:
            if self._team is None:
                return
            raise MistakeError(f"there is no robot '{shortened(agent)}'", "name a robot that is there at that time")
        for child in element.iterchildren("constraint"):
            with self._report.at(line(child)):
                constraint = read_shared(child, context)
                if constraint and constraint.model is Model.PKC:
                    message = "a partially known constraint (PKC) in a scenario"
                    raise MistakeError(message, 'each side would need its part: write model="TKC"')
                if constraint:
                    yield AddConstraint(agent, parent, constraint)

    def _apply(self, change: Change) -> None:
        if self._team is None:
            return
        try:
            self._team = changed(self._team, [change])
        except BadChange as bad:
            raise MistakeError(bad.message, bad.hint) from None
