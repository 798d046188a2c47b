"""Find and read teams: folders with one XML file per robot. The robots are also checked for consistency."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable, invalid_input
from robochoc.formats.robot_reader import RobotFile, read_robot_file
from robochoc.formats.scenario_reader import SCENARIO, has_scenario, places_of_scenario, read_scenario
from robochoc.formats.symbols import SymbolTable
from robochoc.formats.team_consistency import check_between_robots
from robochoc.formats.team_members import TeamMembers
from robochoc.formats.validation import note_valid
from robochoc.model.priorities import natural_key, priority_order
from robochoc.model.problem import ProblemKind, Robot, Team
from robochoc.model.symbols import with_table_everywhere
from robochoc.model.uncertainty import Outcomes, expected_robot
from robochoc.system.garbage import collection_paused

GROUND_FILE = "map.json"
"""The file in a team's folder with the robots' positions on a map, and blocked cells: `robochoc fly --map`."""
_NEXT_STEP = "give a folder with one XML file per robot; 'robochoc generate queens3d --n 4' writes one"


def find_teams(path: Path | str) -> list[Path]:
    """Return the folders of teams at `path` or below, in natural order.

    A folder with XML files is a team, and is not searched. Other folders are searched, except hidden ones and links.

    Raises:
        InvalidInputError: if there is no team, or a folder cannot be read.
    """
    teams = list(_teams(Path(path)))
    if not teams:
        raise invalid_input(path, "there is no team here: no XML file in any folder", _NEXT_STEP)
    return teams


@collection_paused()
def read_team(folder: Path | str) -> Team:
    """Return the team whose robots are the XML files in `folder`, in priority order.

    Args:
        folder: A folder with an XML file for each robot, and `scenario.xml` if the problem changes over time.

    Raises:
        InvalidInputError: with all errors in the files, and between them.
    """
    folder = Path(folder)
    paths = [folder / name for name in _xml_files(_listing(folder)) if name != SCENARIO]
    if not paths:
        raise invalid_input(folder, "there is no robot here: no XML file", _NEXT_STEP)
    found: list[Diagnostic] = []
    table = SymbolTable()
    files: dict[str, RobotFile] = {}
    for path in paths:
        try:
            files[path.stem] = read_robot_file(path, table)
        except InvalidInputError as invalid:
            found.extend(invalid.diagnostics)
    files = {name: file.with_table(table.names) for name, file in _in_one_unit(folder, files, found).items()}
    members = TeamMembers(files, frozenset(path.stem for path in paths) - files.keys())
    found.extend(check_between_robots(members))
    team = None if found else _assembled(folder, members)
    if has_scenario(folder):
        try:
            scenario = read_scenario(folder, team, files, table)
            team = team and replace(team, scenario=scenario)
        except InvalidInputError as invalid:
            found.extend(invalid.diagnostics)
    if not found:
        found.extend(table.undeclared())
    if team is None or found:
        raise InvalidInputError(found)
    team = with_table_everywhere(team, table.names)
    note_valid(team)
    return team


def robot_names(folder: Path | str) -> tuple[str, ...]:
    """Return the names of the robots whose files are in `folder`, in natural order. No file is opened.

    Raises:
        InvalidInputError: if the folder cannot be read, or contains no robot.
    """
    names = tuple(Path(name).stem for name in _xml_files(_listing(Path(folder))) if name != SCENARIO)
    if not names:
        raise invalid_input(folder, "there is no robot here: no XML file", _NEXT_STEP)
    return names


def _in_one_unit(folder: Path, files: dict[str, RobotFile], found: list[Diagnostic]) -> dict[str, RobotFile]:
    """Return `files` with costs in their finest unit, which includes the scenario. Errors are added to `found`."""
    if not any(file.robot.kind == ProblemKind.DISWCSP for file in files.values()):
        return files
    places = max(file.robot.costs.places for file in files.values())
    if has_scenario(folder):
        places = max(places, places_of_scenario(folder))
    converted: dict[str, RobotFile] = {}
    for name, file in files.items():
        try:
            converted[name] = file.in_places(places)
        except InvalidInputError as invalid:
            found.extend(invalid.diagnostics)
    return converted


def _assembled(folder: Path, members: TeamMembers) -> Team:
    order = members.priority or priority_order(members.agreed)
    return Team(encodable(folder.resolve().name), tuple(_with_implied_variables(members, name) for name in order))


def _with_implied_variables(members: TeamMembers, name: str) -> Robot:
    """Return the robot `name` with the variables that its children must know, even if its file only implies them."""
    file = members.files[name]
    if not file.implied_children:
        return file.robot
    robot = file.robot.declared or file.robot
    outcomes = Outcomes(robot.random)
    children = []
    for child in robot.children:
        variables = child.variables
        if child.name in file.implied_children:
            needed = members.needed(name, child.name).keys()
            implied = (one.name for one in robot.variables if not needed.isdisjoint(outcomes.decisions(one.name)))
            variables = tuple(dict.fromkeys([*variables, *implied]))
        children.append(replace(child, variables=variables))
    return expected_robot(replace(robot, children=tuple(children)))


def _teams(top: Path) -> Iterator[Path]:
    waiting = [top]
    while waiting:
        folder = waiting.pop()
        entries = _listing(folder)
        if any(_xml_files(entries)):
            yield folder
            continue
        below = [e.name for e in entries if not e.name.startswith(".") and e.is_dir(follow_symlinks=False)]
        waiting += [folder / name for name in reversed(below)]


def _xml_files(entries: Iterable[os.DirEntry[str]]) -> Iterator[str]:
    """Yield the names of files that end in .xml and are not hidden. Their contents are not checked."""
    return (entry.name for entry in entries if entry.name.endswith(".xml") and not entry.name.startswith("."))


def _listing(folder: Path) -> list[os.DirEntry[str]]:
    """Return the entries of `folder`, in natural order. Raises `InvalidInputError`."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: natural_key(entry.name))
    except NotADirectoryError:
        step = "give a team's folder; 'robochoc import' creates one from a file of another tool"
        if folder.suffix == ".xml":
            step = f"give the robot's folder, {folder.parent}; for a file of another tool, give its --format"
        raise invalid_input(folder, "is not a folder", step) from None
    except FileNotFoundError:
        raise invalid_input(folder, "does not exist", "check its name" if folder.suffix else _NEXT_STEP) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise invalid_input(folder, f"cannot be read: {reason}", "check the path and its permissions") from None
