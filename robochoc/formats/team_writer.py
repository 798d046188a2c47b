"""Write a team as a folder of XML files, either completely or not at all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from robochoc.formats.diagnostics import invalid_input
from robochoc.formats.names_file import NAMES_FILE
from robochoc.formats.robot_reader import robot_in
from robochoc.formats.scenario_reader import SCENARIO
from robochoc.formats.scenario_writer import team_files
from robochoc.formats.team_reader import GROUND_FILE
from robochoc.formats.validation import check_writable
from robochoc.model.problem import Team
from robochoc.system.files import errors_naming, resolved

SKETCH_FILE = "sketch.json"
"""The file in a team's folder where `robochoc app` saves the drawing of the team."""
_ALWAYS_READABLE = 1024 * 1024
"""The file size in bytes up to which a valid robot's file is certainly within the limits of its reader."""


def write_team(
    team: Team, folder: Path, *, replace: bool = False, extra_files: Mapping[str, bytes] = MappingProxyType({})
) -> None:
    """Write the XML files of the robots in `team`, and its scenario. The folder is then complete, or does not exist.

    Args:
        team: A valid team.
        folder: The folder to be written.
        replace: True if an existing folder of a team is replaced. It may contain only XML files, and files written by
            an import, the application or a problem on a map.
        extra_files: The contents of further files in the folder, by name.

    Raises:
        InvalidInputError: if the team is invalid, files cannot express it, or the folder exists and is not replaced.
        OSError: if the folder cannot be written.
    """
    import secrets  # noqa: PLC0415 - start-up: only to write a team
    import shutil  # noqa: PLC0415 - the same

    check_writable(team)
    files = team_files(team)
    for path, content in files.items():
        _check_size(path, content)
    if folder.exists() or folder.is_symlink():
        _check_replaceable(folder, replace=replace)
    folder = resolved(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = folder.with_name(f".{secrets.token_hex(8)}.new")
    old = new.with_suffix(".old")
    try:
        with errors_naming(folder):
            new.mkdir()
            for path, content in {**files, **extra_files}.items():
                (new / path).parent.mkdir(exist_ok=True)
                (new / path).write_bytes(content)
            if folder.exists():
                folder.rename(old)
            new.rename(folder)
    finally:
        if old.exists() and not folder.exists():
            old.rename(folder)
        for rest in (new, old):
            shutil.rmtree(rest, ignore_errors=True)


def _check_size(path: str, content: bytes) -> None:
    """Raise `InvalidInputError` if the reader would reject a robot's file as too large."""
    if len(content) > _ALWAYS_READABLE and path != SCENARIO:
        robot_in(content, Path(path).stem)


def _check_replaceable(folder: Path, *, replace: bool) -> None:
    if not replace:
        raise invalid_input(folder, "the folder exists already", "choose another folder, or replace it with --force")
    if folder.is_symlink() or not folder.is_dir() or folder.resolve() == Path(folder.resolve().anchor):
        raise invalid_input(folder, "it is not a folder, and is not replaced", "choose another folder")
    if foreign := sorted(entry.name for entry in folder.iterdir() if not _is_team_file(entry)):
        raise invalid_input(
            folder,
            f"it contains {foreign[0]!r}, which is not a file of a team, and is not replaced",
            "choose another folder, or delete it yourself",
        )


def _is_team_file(entry: Path) -> bool:
    if entry.is_dir() and not entry.is_symlink() and re.fullmatch(r"late\d*", entry.name):
        return all(_is_team_file(below) for below in entry.iterdir())
    return entry.is_file() and (entry.suffix == ".xml" or entry.name in {NAMES_FILE, SKETCH_FILE, GROUND_FILE})
