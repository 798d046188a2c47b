"""Writing a team as a folder, whole or not at all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from robochoc.formats.diagnostics import Diagnostic, InvalidInputError
from robochoc.formats.names_file import NAMES_FILE
from robochoc.formats.robot_reader import robot_in
from robochoc.formats.scenario_reader import SCENARIO
from robochoc.formats.scenario_writer import team_files
from robochoc.formats.validation import check_writable
from robochoc.model.problem import Team
from robochoc.system.files import errors_naming, resolved

SKETCH_FILE = "sketch.json"
"""The file in which `robochoc app` keeps beside a team how it was drawn."""
GROUND_FILE = "map.json"
"""The file beside a team that says where its robots stand on a map, and what is blocked: `robochoc fly --map`."""
_SURELY_READ = 1024 * 1024
"""Bytes of a file that meets no limit of its reader, if the robot is valid."""


def write_team(
    team: Team, folder: Path, *, replace: bool = False, beside: Mapping[str, bytes] = MappingProxyType({})
) -> None:
    """Write one XML file per robot into `folder`, and its scenario: it is then complete, or not there at all.

    Args:
        team: A valid team.
        folder: The folder to be written.
        replace: Whether a folder of a team that is there already is replaced: one with XML files only, and those that
            an import, the application or a problem on a map writes.
        beside: The contents of other files that are written there, by their names.

    Raises:
        InvalidInputError: if the team is invalid, files cannot express it, or the folder is there and is not replaced.
        OSError: if it cannot be written.
    """
    import secrets  # noqa: PLC0415 - start-up: only to write a team
    import shutil  # noqa: PLC0415 - the same

    check_writable(team)
    files = team_files(team)
    for path, content in files.items():
        _check_size(path, content)
    if folder.exists() or folder.is_symlink():
        _may_replace(folder, replace=replace)
    folder = resolved(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    new = folder.with_name(f".{secrets.token_hex(8)}.new")
    old = new.with_suffix(".old")
    try:
        with errors_naming(folder):
            new.mkdir()
            for path, content in {**files, **beside}.items():
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
    """Raise `InvalidInputError` when no reader would take a robot's file: it may be too large."""
    if len(content) > _SURELY_READ and path != SCENARIO:
        robot_in(content, Path(path).stem)


def _may_replace(folder: Path, *, replace: bool) -> None:
    if not replace:
        raise _refusal(folder, "it exists already", "choose another folder with -o, or replace it with --force")
    if folder.is_symlink() or not folder.is_dir() or folder.resolve() == Path(folder.resolve().anchor):
        raise _refusal(folder, "it is no folder, and is not replaced", "choose another folder with -o")
    if foreign := sorted(entry.name for entry in folder.iterdir() if not _is_ours(entry)):
        raise _refusal(
            folder,
            f"it holds {foreign[0]!r}, which is no robot's file, and is not replaced",
            "choose another folder with -o, or remove it yourself",
        )


def _is_ours(entry: Path) -> bool:
    if entry.is_dir() and not entry.is_symlink() and re.fullmatch(r"late\d*", entry.name):
        return all(_is_ours(below) for below in entry.iterdir())
    return entry.is_file() and (entry.suffix == ".xml" or entry.name in {NAMES_FILE, SKETCH_FILE, GROUND_FILE})


def _refusal(folder: Path, message: str, hint: str) -> InvalidInputError:
    return InvalidInputError([Diagnostic(str(folder), 0, message, hint)])
