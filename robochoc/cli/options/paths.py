"""Paths on the command line, which are checked before the work starts."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import click

from robochoc.cli.reports.failures import INVALID, Failure

if TYPE_CHECKING:
    from click.shell_completion import CompletionItem

PathLike = str | os.PathLike[str]

_MOST_RECOGNISED = 20
"""The maximum number of files whose format is detected in a folder without a team."""


class InputPath(click.Path):
    """A path to read. An empty path is an error; otherwise an unset shell variable would mean the current folder."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path."""
        if not os.fspath(value):
            self.fail("the path is empty; write '.' for this folder", param, ctx)
        return Path(os.fsdecode(super().convert(value, param, ctx)))


class TeamFolder(InputPath):
    """The path of a team's folder, for which the shell completes folders."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:  # noqa: ARG002 - click's
        """Return the shell's own completion for folders."""
        from click.shell_completion import CompletionItem

        return [CompletionItem(incomplete, type="dir")]


class OutputFile(click.Path):
    """A file to write in an existing, writable folder."""

    def __init__(self) -> None:
        super().__init__(dir_okay=False, path_type=Path)

    def convert(self, value: PathLike, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Return the path."""
        from robochoc.system.files import resolved

        path = Path(os.fsdecode(super().convert(value, param, ctx)))
        if path.is_dir():
            self.fail(f"{path} is a folder; name a file", param, ctx)
        if path.exists() and not path.is_file():  # the path is a device or a pipe
            return path
        try:
            folder = resolved(path).parent
        except OSError as error:
            self.fail(f"{path}: {error.strerror}; name another file", param, ctx)
        if not folder.is_dir():
            self.fail(f"the folder {folder} does not exist; create it first", param, ctx)
        if not os.access(folder, os.W_OK | os.X_OK):
            self.fail(f"the folder {folder} is not writable; choose another folder", param, ctx)
        return path


NamedPlace = tuple[Path | str, str]
"""A file or topic in canonical spelling, and its name on the command line."""


def refuse_same_places(
    outputs: Mapping[str, Path | None],
    inputs: Mapping[str, Path | None] = MappingProxyType({}),
    *,
    teams: Iterable[Path] = (),
    more_outputs: Iterable[NamedPlace] = (),
    more_inputs: Iterable[NamedPlace] = (),
) -> None:
    """Raise `click.UsageError` if a command would overwrite one of its inputs, or write two outputs to the same place.

    Args:
        outputs: The files to write, by their names on the command line.
        inputs: The files to read, by their names on the command line.
        teams: The folders whose files are read.
        more_outputs: Further outputs, which need not be files.
        more_inputs: Further inputs, which need not be files.

    Devices and pipes may be shared.
    """
    from robochoc.system.files import resolved

    taken = dict([*_named(inputs), *more_inputs])
    written = [*_named(outputs), *more_outputs]
    folders = [resolved(team) for team in teams if team.is_dir()]
    for place, option in written:
        other = taken.setdefault(place, option)
        if other is not option:
            same = f"{option} is given twice" if other == option else f"{other} and {option} are the same place"
            raise click.UsageError(same)
        if isinstance(place, Path) and place.suffix == ".xml":
            for folder in folders:
                if place.is_relative_to(folder):
                    raise click.UsageError(f"{option} would be a file of the team in {folder}; name another file")


def _named(files: Mapping[str, Path | None]) -> Iterator[NamedPlace]:
    """Yield the path and name of each given file, which need not exist yet. Devices are left out."""
    from robochoc.system.files import resolved

    for name, path in files.items():
        with suppress(OSError):  # the code that reads or writes the file reports the error
            if path and (path.is_file() or not path.exists()):
                yield resolved(path), f"{name} {path}"


def import_hints(path: Path) -> list[str]:
    """Return a line with the command that imports the problem at `path`; empty if no file has a known format."""
    from robochoc.formats.dialects.registry import recognise

    try:
        files = (
            [path]
            if path.is_file()
            else sorted(entry for entry in path.iterdir() if entry.is_file())[:_MOST_RECOGNISED]
        )
    except OSError:
        return []
    for file in files:
        if dialect := recognise(file):
            return [f"{file}: is {dialect.title}; convert it to a team: robochoc import {path} -o FOLDER"]
    return []


def teams_at(paths: Iterable[Path], *, foreign: bool = False, dialect: str | None = None) -> list[Path]:
    """Return the folders of all teams at or below `paths`, without duplicates.

    With `foreign`, files of other tools are also teams; with `dialect`, all files have this format.

    Raises `Failure`, which lists every path without a team.
    """
    from robochoc.formats import InvalidInputError, find_teams
    from robochoc.formats.problems import is_foreign

    folders: dict[Path, None] = {}
    errors = []
    for path in paths:
        try:
            if foreign and ((dialect and path.is_file()) or is_foreign(path)):
                folders[path] = None
            else:
                folders.update(dict.fromkeys(find_teams(path)))
        except InvalidInputError as invalid:
            errors += [str(invalid), *import_hints(path)]
    if errors:
        raise Failure(INVALID, "\n".join(errors))
    return list(folders)
