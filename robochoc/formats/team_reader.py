"""A folder of robots as a team: finding it, reading it, and the fourth layer's verdict on the whole."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError, encodable
from robochoc.formats.robot_reader import RobotFile, read_robot_file
from robochoc.formats.scenario_reader import SCENARIO, has_scenario, places_of_scenario, read_scenario
from robochoc.formats.symbols import SymbolTable
from robochoc.formats.team_members import TeamMembers
from robochoc.formats.validation import check_between_robots, note_valid
from robochoc.model.priorities import natural_key, priority_order
from robochoc.model.problem import ProblemKind, Robot, Team
from robochoc.model.symbols import with_table_everywhere
from robochoc.system.garbage import collection_paused

_NEXT_STEP = "give a folder with one XML file per robot; 'robochoc generate queens3d --n 4' writes one"


def find_teams(path: Path | str) -> list[Path]:
    """Return the folders of teams at `path` or below, in natural order.

    A folder with XML files in it is a team, and nothing is looked for below it; other folders are searched, hidden
    ones and symbolic links left out.

    Raises:
        InvalidInputError: when there is no team, or a folder cannot be read.
    """
    teams = list(_teams(Path(path)))
    if not teams:
        raise _invalid(path, "there is no team here: no XML file in any folder", _NEXT_STEP)
    return teams


@collection_paused()
def read_team(folder: Path | str) -> Team:
    """Return the team whose robots are the XML files in `folder`, in priority order.

    Args:
        folder: A folder with an XML file for each robot, and `scenario.xml` if the problem changes over time.

    Raises:
        InvalidInputError: with the mistakes of all files, and of all pairs of files.
    """
    folder = Path(folder)
    paths = [folder / name for name in _xml_files(_listing(folder)) if name != SCENARIO]
    if not paths:
        raise _invalid(folder, "there is no robot here: no XML file", _NEXT_STEP)
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
    team = None if found else _whole(folder, members)
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
    """Return the names of the robots whose files are in `folder`, in natural order, from the files' names alone.

    No file is opened: to know the names, one need not know the robots' problems.

    Raises:
        InvalidInputError: when the folder cannot be read, or has no robot.
    """
    names = tuple(Path(name).stem for name in _xml_files(_listing(Path(folder))) if name != SCENARIO)
    if not names:
        raise _invalid(folder, "there is no robot here: no XML file", _NEXT_STEP)
    return names


def _in_one_unit(folder: Path, files: dict[str, RobotFile], found: list[Diagnostic]) -> dict[str, RobotFile]:
    """Return `files` with costs in the finest unit of any, the scenario's included; mistakes are added to `found`."""
    if not any(file.robot.kind == ProblemKind.DISWCSP for file in files.values()):
        return files
    places = max(file.robot.costs.places for file in files.values())
    if has_scenario(folder):
        places = max(places, places_of_scenario(folder))
    same: dict[str, RobotFile] = {}
    for name, file in files.items():
        try:
            same[name] = file.in_places(places)
        except InvalidInputError as invalid:
            found.extend(invalid.diagnostics)
    return same


def _whole(folder: Path, members: TeamMembers) -> Team:
    order = priority_order(members.agreed)
    return Team(encodable(folder.resolve().name), tuple(_informed(members, name) for name in order))


def _informed(members: TeamMembers, name: str) -> Robot:
    """Return the robot `name`; where its file does not name the variables of a child, constraints do."""
    file = members.files[name]
    children = []
    for child in file.robot.children:
        variables = child.variables
        if child.name in file.unsaid:
            variables = tuple(dict.fromkeys([*variables, *members.needed(name, child.name)]))
        children.append(replace(child, variables=variables))
    return replace(file.robot, children=tuple(children))


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
    """Return names of what claims to be an XML file; whether it is one, its reader says."""
    return (entry.name for entry in entries if entry.name.endswith(".xml") and not entry.name.startswith("."))


def _listing(folder: Path) -> list[os.DirEntry[str]]:
    """Return what is in `folder`, in natural order. Raises `InvalidInputError`."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entries, key=lambda entry: natural_key(entry.name))
    except NotADirectoryError:
        step = "give a team's folder; 'robochoc import' makes one of a file of another tool"
        if folder.suffix == ".xml":
            step = (
                f"a robot's team is its folder: {folder.parent}; the format of another tool's file is named by --format"
            )
        raise _invalid(folder, "is not a folder", step) from None
    except FileNotFoundError:
        raise _invalid(folder, "does not exist", "check its name" if folder.suffix else _NEXT_STEP) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise _invalid(folder, f"cannot be read: {reason}", "check the path and its permissions") from None


def _invalid(path: Path | str, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(str(path), 0, message, hint)])
